//! A run of the firmware in QEMU.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::process::Command;

use evtach_core::{Event, Geometry};
use evtach_firmware::record::{self, Header};
use tempfile::TempDir;

use super::image::root;
use super::{DeviceError, Image, Output};

/// How fast the recording plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// As fast as it is measured, at 1000 million instructions per second, so that a tick is
    /// [`super::INSTRUCTIONS_PER_TICK`].
    File,
    /// As fast as it was recorded, on a processor of 250 million instructions per second: near the
    /// board's 216 MHz.
    Sensor,
}

const RECORDING: &str = "recording.ev8";
pub(super) const STREAM: &str = "stream.spi";

/// Bytes of the serial flash that QEMU has.
pub(super) const FLASH_BYTES: usize = 16 << 20;

/// Whether QEMU is installed.
#[must_use]
pub fn qemu_present() -> bool {
    Command::new("qemu-system-arm").arg("--version").output().is_ok_and(|o| o.status.success())
}

/// Plays events to the firmware from a file and returns what it says.
///
/// # Errors
///
/// When QEMU is missing, a file cannot be written, or the firmware fails.
pub fn run(
    image: &Image,
    geometry: Geometry,
    events: &[Event],
    pace: Pace,
) -> Result<Output, DeviceError> {
    let folder = scratch()?;
    write_recording(&folder.path().join(RECORDING), geometry, events)?;
    start(image, folder.path(), RECORDING, pace)
}

/// Lets the firmware read a stream, as an SPI bridge sends it, through its SPI controller, and returns what it says.
///
/// # Errors
///
/// When the stream is larger than the flash that it stands in, QEMU is missing, a file cannot be written, or the
/// firmware fails.
pub fn run_spi(image: &Image, stream: &[u8], pace: Pace) -> Result<Output, DeviceError> {
    if stream.len() > FLASH_BYTES {
        return Err(DeviceError::TooLongStream(stream.len()));
    }
    let folder = scratch()?;
    let path = folder.path().join(STREAM);
    fs::write(&path, stream).map_err(|source| DeviceError::File { path, source })?;
    start(image, folder.path(), "spi", pace)
}

/// Lets the firmware read a stream as [`run_spi`] does and draw its screen after every reading; returns also the pixels
/// that are there at the end: 480x272, row by row, RGB565 in two bytes, little-endian.
///
/// # Errors
///
/// As [`run_spi`].
pub fn run_screen(image: &Image, stream: &[u8]) -> Result<(Output, Vec<u8>), DeviceError> {
    let folder = scratch()?;
    let file = |path| move |source| DeviceError::File { path, source };
    let path = folder.path().join(STREAM);
    fs::write(&path, stream).map_err(file(path))?;
    let output = start_with(image, folder.path(), &["spi", "screen"], Pace::File)?;
    let path = folder.path().join("screen.rgb565");
    let pixels = fs::read(&path).map_err(file(path))?;
    Ok((output, pixels))
}

/// A folder that goes away.
pub(super) fn scratch() -> Result<TempDir, DeviceError> {
    tempfile::tempdir().map_err(|source| DeviceError::File { path: std::env::temp_dir(), source })
}

/// Runs QEMU in a folder: the program knows files by their name there, so that no path can be too long.
fn start(image: &Image, folder: &Path, input: &str, pace: Pace) -> Result<Output, DeviceError> {
    match pace {
        Pace::File => start_with(image, folder, &[input], pace),
        Pace::Sensor => start_with(image, folder, &[input, "sensor"], pace),
    }
}

fn start_with(
    image: &Image,
    folder: &Path,
    words: &[&str],
    pace: Pace,
) -> Result<Output, DeviceError> {
    let script = fs::canonicalize(root().join("firmware/src/board/mps2_an500/qemu.sh"))
        .map_err(|source| DeviceError::File { path: root(), source })?;
    let mut command = Command::new(&script);
    command.arg(&image.path).args(words).current_dir(folder);
    if folder.join(STREAM).exists() {
        command.env("EVTACH_FLASH", STREAM);
    }
    match pace {
        Pace::File => command.env("EVTACH_ICOUNT_SHIFT", "0"),
        Pace::Sensor => command.env("EVTACH_ICOUNT_SHIFT", "2"),
    };
    let output = command
        .output()
        .map_err(|source| DeviceError::Start { program: script.display().to_string(), source })?;
    match output.status.code() {
        // With or without a speed.
        Some(0 | 1) => Output::parse(&String::from_utf8_lossy(&output.stdout)),
        code => Err(DeviceError::Failed {
            code: code.unwrap_or(-1),
            message: String::from_utf8_lossy(&output.stderr).trim().to_owned(),
        }),
    }
}

/// Writes a recording as the device reads it.
///
/// # Errors
///
/// When the file cannot be written, or there are more events than its header can count.
pub fn write_recording(
    path: &Path,
    geometry: Geometry,
    events: &[Event],
) -> Result<(), DeviceError> {
    let count =
        u32::try_from(events.len()).map_err(|_| DeviceError::TooManyEvents(events.len()))?;
    let first_us = events.first().map_or(0, |event| event.t_us);
    let write = || {
        let mut file = BufWriter::new(File::create(path)?);
        file.write_all(&Header { geometry, first_us, events: count }.encode())?;
        for event in events {
            file.write_all(&record::encode(event))?;
        }
        file.flush()
    };
    write().map_err(|source| DeviceError::File { path: path.to_owned(), source })
}

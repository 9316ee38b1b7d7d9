//! A run of the firmware in QEMU.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::process::Command;

use evtach_core::{Event, Geometry};
use evtach_firmware::record::{self, Header};

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

/// Whether QEMU is installed.
#[must_use]
pub fn qemu_present() -> bool {
    Command::new("qemu-system-arm").arg("--version").output().is_ok_and(|o| o.status.success())
}

/// Plays events to the firmware and returns what it says.
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
    // The program knows files by their name in QEMU's working folder: no path can be too long.
    let folder = tempfile::tempdir()
        .map_err(|source| DeviceError::File { path: std::env::temp_dir(), source })?;
    let path = folder.path().join(RECORDING);
    write_recording(&path, geometry, events)?;
    let (words, shift): (&[&str], _) = match pace {
        Pace::File => (&[RECORDING], "0"),
        Pace::Sensor => (&[RECORDING, "sensor"], "2"),
    };
    let script = fs::canonicalize(root().join("firmware/src/board/mps2_an500/qemu.sh"))
        .map_err(|source| DeviceError::File { path: root(), source })?;
    let output = Command::new(&script)
        .arg(&image.path)
        .args(words)
        .env("EVTACH_ICOUNT_SHIFT", shift)
        .current_dir(folder.path())
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

//! Writing recordings.

use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;

use evtach_core::{Event, Geometry};

use super::aedat4::Aedat4Writer;
use super::csv::CsvWriter;
use super::dat::DatWriter;
use super::error::RecordingError;
use super::es::EsWriter;
use super::ev8::Ev8Writer;
use super::imu::ImuSample;
use super::npy::NpyWriter;
use super::raw::{Evt2Writer, Evt3Writer};
use super::spi::SpiWriter;

/// A format that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WriteFormat {
    /// Prophesee RAW, EVT 2.0.
    Evt2,
    /// Prophesee RAW, EVT 3.0.
    Evt3,
    /// Prophesee DAT.
    Dat,
    /// iniVation AEDAT 4, LZ4.
    Aedat4,
    /// Text `t,x,y,p` with a header line, microseconds, 0/1.
    Csv,
    /// NumPy structured array.
    Npy,
    /// Event Stream 2, type DVS.
    Es,
    /// What the device reads over SPI.
    Spi,
    /// The device's own.
    Ev8,
}

impl WriteFormat {
    /// Every format, in the order of the documentation.
    pub const ALL: [Self; 9] = [
        Self::Evt2,
        Self::Evt3,
        Self::Dat,
        Self::Aedat4,
        Self::Csv,
        Self::Npy,
        Self::Es,
        Self::Spi,
        Self::Ev8,
    ];

    /// The name used on the command line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Evt2 => "evt2",
            Self::Evt3 => "evt3",
            Self::Dat => "dat",
            Self::Aedat4 => "aedat4",
            Self::Csv => "csv",
            Self::Npy => "npy",
            Self::Es => "es",
            Self::Spi => "spi",
            Self::Ev8 => "ev8",
        }
    }

    /// Last time the format can hold, in microseconds, and whether its events must come in the order of time.
    #[must_use]
    pub const fn limits(self) -> (u64, bool) {
        match self {
            Self::Evt2 => ((1 << 34) - 1, true),
            Self::Evt3 => ((1 << 38) - 1, true),
            Self::Dat => ((1 << 32) - 1, false),
            Self::Es => (3_600_000_000, true),
            Self::Aedat4 | Self::Csv | Self::Npy | Self::Spi | Self::Ev8 => {
                (i64::MAX as u64, false)
            }
        }
    }

    /// Whether inertial samples have a place in it.
    #[must_use]
    pub const fn holds_imu(self) -> bool {
        matches!(self, Self::Aedat4)
    }

    /// The format a file name asks for: by `.evt2.raw` and the like, else by its extension (`.raw` is EVT 3.0).
    #[must_use]
    pub fn from_path(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let mut parts = name.rsplit('.');
        match (parts.next()?, parts.next()) {
            ("raw", Some("evt2")) | ("evt2", _) => Some(Self::Evt2),
            ("raw" | "evt3", _) => Some(Self::Evt3),
            ("dat", _) => Some(Self::Dat),
            ("aedat4", _) => Some(Self::Aedat4),
            ("csv" | "txt", _) => Some(Self::Csv),
            ("npy", _) => Some(Self::Npy),
            ("es", _) => Some(Self::Es),
            ("spi", _) => Some(Self::Spi),
            ("ev8", _) => Some(Self::Ev8),
            _ => None,
        }
    }
}

impl std::str::FromStr for WriteFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|format| format.as_str() == text).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.iter().map(|format| format.as_str()).collect();
            format!("\"{text}\" is no format that is written; take one of {}", known.join(", "))
        })
    }
}

/// A recording being written. Without [`Writer::finish`] the file may be cut short.
pub struct Writer {
    sink: Box<dyn Sink>,
}

impl Writer {
    /// Appends events.
    ///
    /// # Errors
    /// When the disk or pipe fails, or an event does not fit the format.
    pub fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.sink.write(events)
    }

    /// Appends inertial samples, before the events of their time. Formats that have no place for them
    /// ([`WriteFormat::holds_imu`]) leave them out.
    ///
    /// # Errors
    /// When the disk or pipe fails.
    pub fn write_imu(&mut self, samples: &[ImuSample]) -> Result<(), RecordingError> {
        self.sink.write_imu(samples)
    }

    /// Closes the recording.
    ///
    /// # Errors
    /// When the disk or pipe fails.
    pub fn finish(self) -> Result<(), RecordingError> {
        self.sink.finish()
    }
}

/// Creates a recording; "-" writes to stdout.
///
/// # Errors
/// When the file cannot be created.
pub fn create(
    path: &Path,
    format: WriteFormat,
    geometry: Geometry,
) -> Result<Writer, RecordingError> {
    let target = if path.as_os_str() == "-" {
        Target::Pipe(Box::new(BufWriter::new(std::io::stdout())))
    } else {
        let file = File::create(path).map_err(RecordingError::Open)?;
        // A pipe may have a name, too, as `>(...)` of a shell.
        if file.metadata().is_ok_and(|found| found.is_file()) {
            Target::File(BufWriter::with_capacity(1 << 18, file))
        } else {
            Target::Pipe(Box::new(BufWriter::with_capacity(1 << 18, file)))
        }
    };
    let sink: Box<dyn Sink> = match format {
        WriteFormat::Evt2 => Box::new(Evt2Writer::new(target, geometry)?),
        WriteFormat::Evt3 => Box::new(Evt3Writer::new(target, geometry)?),
        WriteFormat::Dat => Box::new(DatWriter::new(target, geometry)?),
        WriteFormat::Aedat4 => Box::new(Aedat4Writer::new(target, geometry)?),
        WriteFormat::Csv => Box::new(CsvWriter::new(target)?),
        WriteFormat::Npy => Box::new(NpyWriter::new(target)?),
        WriteFormat::Es => Box::new(EsWriter::new(target, geometry)?),
        WriteFormat::Spi => Box::new(SpiWriter::new(target, geometry)),
        WriteFormat::Ev8 => Box::new(Ev8Writer::new(target, geometry)?),
    };
    Ok(Writer { sink })
}

/// One format's writer.
pub(crate) trait Sink: Send {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError>;
    fn write_imu(&mut self, _samples: &[ImuSample]) -> Result<(), RecordingError> {
        Ok(())
    }
    fn finish(self: Box<Self>) -> Result<(), RecordingError>;
}

/// Where the bytes go: only a file can be patched afterwards.
pub(crate) enum Target {
    File(BufWriter<File>),
    Pipe(Box<dyn Write + Send>),
}

impl Target {
    /// Whether bytes written before can still be changed.
    pub const fn can_patch(&self) -> bool {
        matches!(self, Self::File(_))
    }

    /// Overwrites bytes written before, where that is possible.
    pub fn patch(&mut self, offset: u64, bytes: &[u8]) -> std::io::Result<()> {
        if let Self::File(file) = self {
            file.seek(std::io::SeekFrom::Start(offset))?;
            file.write_all(bytes)?;
            file.seek(std::io::SeekFrom::End(0))?;
        }
        Ok(())
    }
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Pipe(pipe) => pipe.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Pipe(pipe) => pipe.flush(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_asks_for_a_format() {
        let format = |name: &str| WriteFormat::from_path(Path::new(name));
        assert_eq!(format("a/fan.evt2.RAW"), Some(WriteFormat::Evt2));
        assert_eq!(format("fan.raw"), Some(WriteFormat::Evt3));
        assert_eq!(format("fan"), None);
        for known in WriteFormat::ALL {
            assert_eq!(format(&format!("fan.{}", known.as_str())), Some(known));
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_name_need_not_be_utf_8() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt as _;
        let name = OsStr::from_bytes(b"f\xff.csv");
        assert_eq!(WriteFormat::from_path(Path::new(name)), Some(WriteFormat::Csv));
    }
}

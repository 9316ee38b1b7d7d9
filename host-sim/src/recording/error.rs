//! What can be wrong with a recording, with the place in it and what to do about it.

use std::fmt;
use std::io;

/// Where in a recording something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Offset in bytes from the start of the (uncompressed) recording.
    Byte(u64),
    /// Line of a text file, counted from 1.
    Line(u64),
    /// Record or message, counted from 0.
    Record(u64),
}

impl Place {
    /// What to do about damage here.
    const fn what_to_do(self) -> &'static str {
        match self {
            Self::Byte(0) | Self::Line(0 | 1) | Self::Record(0) => {
                "nothing comes before it; check what wrote the file"
            }
            _ => "what came before is good; cut the file there with `evtach convert --end`",
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(offset) => write!(f, "byte {offset}"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Record(record) => write!(f, "record {record}"),
        }
    }
}

/// Why a recording cannot be read or written; each message ends with what to do.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened or created. Whoever asked for it tells its name, as before any other error.
    #[error("cannot open: {0}\nhelp: check the path and its permissions")]
    Open(io::Error),
    /// Reading failed below the format.
    #[error(
        "cannot read on at byte {offset}: {cause}\nhelp: check the disk or the pipe; a compressed file may be cut short"
    )]
    Read {
        /// Bytes read so far.
        offset: u64,
        /// What the system said.
        cause: io::Error,
    },
    /// Writing failed below the format.
    #[error(
        "cannot write: {0}\nhelp: check that the disk has room and that the reader of a pipe still runs"
    )]
    Write(io::Error),
    /// There is nothing in the file.
    #[error("the file is empty\nhelp: record again, or check that the copy finished")]
    Empty,
    /// It is a recording, of nothing.
    #[error("{format} without events\nhelp: record again, or check that the copy finished")]
    NoEvents {
        /// Name of the format.
        format: &'static str,
    },
    /// The content is no known format.
    #[error("not a recording that is known here: {found}\nhelp: {advice}")]
    Unknown {
        /// What the content looks like.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// The format is known but this kind of it is not read.
    #[error("{what}\nhelp: {advice}")]
    Unsupported {
        /// What is not supported.
        what: String,
        /// What to do.
        advice: String,
    },
    /// The format does not say the sensor's size and it could not be inferred.
    #[error(
        "{format} does not say the size of the sensor\nhelp: give it with --geometry WxH, for example --geometry 640x480"
    )]
    NoGeometry {
        /// Name of the format.
        format: &'static str,
    },
    /// The content contradicts its format.
    #[error(
        "{format}, {place}: {what}\nhelp: {}, or record again", .place.what_to_do()
    )]
    Damaged {
        /// Name of the format.
        format: &'static str,
        /// Where.
        place: Place,
        /// What is wrong there.
        what: String,
    },
    /// An event does not fit into the format that is to be written.
    #[error("{format} cannot hold {what}\nhelp: {advice}")]
    DoesNotFit {
        /// Name of the format.
        format: &'static str,
        /// What does not fit.
        what: String,
        /// What to do.
        advice: &'static str,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_good_before_the_first_record() {
        let told = |place| {
            RecordingError::Damaged { format: "CSV", place, what: "x is \"a\"".to_owned() }
                .to_string()
        };
        for first in [Place::Byte(0), Place::Line(1), Place::Record(0)] {
            assert!(!told(first).contains("came before"), "{first}");
        }
        for later in [Place::Byte(9), Place::Line(2), Place::Record(1)] {
            assert!(told(later).contains("what came before is good"), "{later}");
        }
    }
}

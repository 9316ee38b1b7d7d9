//! iniVation AEDAT 4: flatbuffers in packets, uncompressed, LZ4 or Zstandard.

mod build;
mod flat;
mod header;
mod packet;
mod read;
mod write;

pub(crate) use read::open;
pub(crate) use write::Aedat4Writer;

/// First bytes of the file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT4.0\r\n";

/// Number of the stream of events where it is written here.
const EVENT_STREAM: i32 = 0;
/// Number of the stream of inertial samples where it is written here.
const IMU_STREAM: i32 = 1;

/// How packets are compressed (`CompressionType` of the format).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compression {
    None,
    Lz4,
    Zstd,
}

impl Compression {
    const fn from_code(code: i32) -> Option<Self> {
        match code {
            0 => Some(Self::None),
            1 | 2 => Some(Self::Lz4),
            3 | 4 => Some(Self::Zstd),
            _ => None,
        }
    }
}

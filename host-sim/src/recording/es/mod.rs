//! Event Stream (.es): a byte for the time step and polarity, then the pixel.

mod read;
mod write;

pub(crate) use read::open;
pub(crate) use write::EsWriter;

/// First bytes of the file.
pub(crate) const MAGIC: &[u8] = b"Event Stream";
/// The version written; any 2.x is read.
const VERSION: [u8; 3] = [2, 0, 0];
const TYPE_DVS: u8 = 1;
const TYPE_ATIS: u8 = 2;
/// Bytes of magic, version, type and size.
const HEADER_BYTES: usize = 20;

//! NumPy: structured arrays (.npy) and archives of arrays (.npz).

mod header;
mod literal;
mod npz;
mod read;
mod write;

pub(crate) use npz::open as open_npz;
pub(crate) use read::open;
pub(crate) use write::NpyWriter;

/// First bytes of an array file.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";
/// First bytes of an archive.
pub(crate) const ZIP_MAGIC: &[u8] = b"PK\x03\x04";

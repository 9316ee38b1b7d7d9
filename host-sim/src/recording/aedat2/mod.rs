//! jAER's AEDAT 1.0 and 2.0: an ASCII header, then big-endian pairs of address and time.

mod chip;
mod header;
mod read;

pub(crate) use header::Header;
pub(crate) use read::open;

/// First bytes of a file of either version.
pub(crate) const MAGIC_1: &[u8] = b"#!AER-DAT1.0";
pub(crate) const MAGIC_2: &[u8] = b"#!AER-DAT2.0";

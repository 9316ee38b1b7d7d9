//! cAER's AEDAT 3.0 and 3.1: an ASCII header, then packets of one event type each.

mod read;

pub(crate) use read::open;

/// First bytes of either version.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT3.";

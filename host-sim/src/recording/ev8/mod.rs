//! The device's own recording (.ev8): a header and eight bytes an event, as in the firmware's `record`.

mod read;
mod write;

pub(crate) use read::open;
pub(crate) use write::Ev8Writer;

/// First bytes of the file.
pub(crate) const MAGIC: &[u8] = b"evtach8\n";

//! Prophesee DAT: a text header, two type bytes, then records of 8 bytes.

mod read;
mod write;

pub(crate) use read::{is_dat, open};
pub(crate) use write::DatWriter;

/// Event type "2D change detection" as older software writes it.
const TYPE_EVENT_2D: u8 = 0x00;
/// Event type "CD".
const TYPE_CD: u8 = 0x0c;
/// Bytes of a record: u32 time in microseconds, then x (14 bits), y (14 bits), polarity (4 bits).
const RECORD_BYTES: u8 = 8;

//! What a bridge in front of a sensor sends to the device over SPI, kept in a file (`firmware/docs/spi.md`).
//!
//! Parser and encoder are the firmware's own.

mod read;
mod write;

pub(crate) use read::open;
pub(crate) use write::SpiWriter;

/// First bytes of a stream that begins with a frame.
pub(crate) const MAGIC: &[u8] = &evtach_firmware::sensor::spi::MAGIC;

//! A sensor behind a bridge: the device is master of an SPI bus and reads a stream of frames.
//!
//! `firmware/docs/spi.md` tells the framing, its rate limit and its latency. [`Bridge`] is the other end,
//! for tests and for recordings; [`Flash`] replays a stream from a memory chip, with no sensor at all.

mod account;
mod acquire;
mod bridge;
mod checksum;
mod driver;
mod flash;
mod frame;
mod parser;
mod words;

pub use account::{Account, Lost};
pub use acquire::{Acquired, acquire};
pub use bridge::{Bridge, MAX_SPAN_US};
pub use driver::{LinkError, SILENCE, SpiSensor};
pub use flash::{AlwaysReady, Flash, FlashError};
pub use frame::{Header, Hello, Kind, MAGIC, MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES, OVERHEAD_BYTES};
pub use parser::{BUFFER_BYTES, Frame, Parser};
pub use words::Words;

#[cfg(test)]
mod tests;

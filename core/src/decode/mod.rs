//! Wire-word decoders: the same code on the device and on the PC.
//!
//! Each decoder is a small state machine: one word in, the events it completes out through a closure. Time leaves
//! as `u64` microseconds with the wraps of the wire's own counter already undone.

mod checksum;
mod davis;
mod dvxplorer;
mod evt2;
mod evt21;
mod evt3;
mod high;
mod inivation;

pub use checksum::crc32;
pub use davis::Davis;
pub use dvxplorer::Dvxplorer;
pub use evt2::Evt2;
pub use evt3::Evt3;
pub use evt21::Evt21;
pub use inivation::Mounting;

use crate::event::{GyroSample, Polarity};

/// How far a camera's words were decoded at once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Packed {
    /// Words used up.
    pub words: usize,
    /// Events that came of them.
    pub events: usize,
    /// A gyro sample that the last of them completed.
    pub sample: Option<GyroSample>,
    /// Whether the last of them, then the only one, set the camera's clock to zero.
    pub reset: bool,
}

/// What Prophesee's words told beside events, since the start of the stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Times the wire's clock wrapped: after 2^34 us in EVT 2.0 and 2.1, after 2^24 us in EVT 3.0.
    pub wraps: u32,
    /// Events dropped because no time word had come yet.
    pub untimed: u64,
    /// Words of a type the format does not define: many of them mean that this is another format, or another byte order.
    pub unknown: u64,
}

/// The polarity a wire bit stands for: set means brighter in every format read here.
#[inline]
const fn polarity(on: bool) -> Polarity {
    if on { Polarity::On } else { Polarity::Off }
}

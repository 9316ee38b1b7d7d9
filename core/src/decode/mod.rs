//! Wire-word decoders: the same code on the device and on the PC.
//!
//! Each decoder is a small state machine: one word in, the events it completes out through a closure. Time leaves
//! as `u64` microseconds with the wraps of the wire's own counter already undone.

mod davis;
mod dvxplorer;
mod evt2;
mod evt21;
mod evt3;
mod high;
mod inivation;

pub use davis::{Davis, Mounting};
pub use dvxplorer::Dvxplorer;
pub use evt2::Evt2;
pub use evt3::Evt3;
pub use evt21::Evt21;

use crate::event::Polarity;

/// The polarity a wire bit stands for: set means brighter in every format read here.
#[inline]
const fn polarity(on: bool) -> Polarity {
    if on { Polarity::On } else { Polarity::Off }
}

//! The measurement: from events to rotor speed with an error bar.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod decode;
pub mod event;
pub mod limits;
pub mod math;
mod order;
pub mod reading;
pub mod registration;
pub mod rotors;
pub mod settings;
pub mod speed;
pub mod store;
pub mod tachometer;
mod thinning;
pub mod tracker;

pub use event::{Event, Geometry, GyroSample, PackedEvent, Polarity};
pub use reading::{Direction, Evidence, Frame, Reading, Reason, RotorReading, Speed, Status};
pub use settings::{Ignored, Memory, More, Poll, Roi, Settings};
pub use store::StoredEvent;
pub use tachometer::{CLOCK_RESET_US, Tachometer, Work};

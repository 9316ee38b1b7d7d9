//! The other end of the cable, for tests and for the emulated board: cameras that answer as iniVation's do, and a port
//! for them on the PC.
//!
//! Built with the feature `emulated-camera` or under test, for programs with an allocator; never part of an image.

mod camera;
mod port;
mod words;

pub use camera::{Camera, Fault, Filters, Packet, Stalled};
pub use port::{Act, Device, Pipe, Port, World};
pub use words::{DavisWords, DvxplorerWords};

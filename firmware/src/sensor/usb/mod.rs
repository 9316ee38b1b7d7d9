//! Cameras at a USB host port: iniVation's DAVIS346 and DVXplorer.
//!
//! [`acquire`] waits for something to be plugged in, finds out what it is, starts it in the documented order, and hands
//! its events on, until it is unplugged. It is generic over the host traits of `embassy-usb-driver`, so that the board's
//! controller, a published driver and a scripted camera on the PC run the same code. No two things wait for each
//! other: while data is read, the port is watched, and a camera that falls silent is asked whether it is still there.

mod account;
mod acquire;
mod descriptors;
#[cfg(any(test, feature = "emulated-camera"))]
pub mod emulated;
mod limit;
mod model;
mod registers;
mod session;
mod start;
mod stream;
mod trouble;

pub use account::{Acquired, Camera};
pub use acquire::acquire;
pub use limit::Limit;
pub use model::Model;
pub use registers::{Module, Register, Transfer};
pub use trouble::{TROUBLE_BYTES, Trouble};

#[cfg(test)]
mod tests;

//! The two USB cores (DesignWare OTG): one is the host of the camera, the other the device that a PC is the host of.
//!
//! Written after the reference manual's register descriptions and what drivers rely on. They test firmware and drivers; of the
//! silicon they prove nothing.

pub mod camera;
pub mod channel;
pub mod device;
pub mod function;
pub mod globals;
pub mod host;
pub mod pc;

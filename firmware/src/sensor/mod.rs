//! Sensors, each behind the traits of embedded-hal or of embassy's USB host: no pin and no peripheral is named here.

pub(crate) mod outlet;
pub mod spi;
pub mod usb;

pub use outlet::Delivered;

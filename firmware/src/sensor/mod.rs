//! Sensors, each behind the traits of embedded-hal: no pin and no peripheral is named here.

pub mod spi;

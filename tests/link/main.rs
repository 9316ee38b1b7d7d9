//! The link to a PC, with the firmware's own code and made-up light.

mod bench;
mod pyvisa;
mod scpi;

//! The instrument: what a person sets and asks for, without a screen, a port or a clock.

mod preferences;

pub use preferences::{Alarm, Preferences, Unit};

/// What happened to the device itself. Kept over a reset, then shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// The program stopped itself: a panic.
    Panic,
    /// The processor stopped the program: a fault exception, the stack's end among them.
    Exception,
    /// The watchdog reset the device: a task hung.
    Watchdog,
    /// The stored preferences could not be read; the defaults stand.
    Preferences,
}

/// What is known of the sensor, apart from its events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sensor {
    /// None answers.
    #[default]
    Absent,
    /// One answers.
    Present,
}

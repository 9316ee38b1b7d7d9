//! In which state the measurement stands, in words.

use evtach_core::{Reason, Status};

use super::Fault;

/// The one state that the instrument is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// A speed, followed over the whole window.
    Locked,
    /// A speed, from a window too short for the long baseline.
    Coarse,
    /// A speed, but of a reading before the last one, or too long ago: shown grey, soon not at all.
    Held,
    /// No speed, and why.
    Refused(Reason),
    /// The device failed.
    Fault(Fault),
}

impl State {
    /// Whether there is a speed.
    #[must_use]
    pub const fn has_speed(self) -> bool {
        matches!(self, Self::Locked | Self::Coarse | Self::Held)
    }

    /// The word on the screen.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Locked => "LOCKED",
            Self::Coarse => "COARSE",
            Self::Held => "HELD",
            Self::Refused(Reason::NoSensor) => "NO SENSOR",
            Self::Refused(Reason::NoEvents) => "NO EVENTS",
            Self::Refused(Reason::TooFewEvents) => "TOO FEW EVENTS",
            Self::Refused(Reason::NoRotation) => "NO ROTATION",
            Self::Refused(Reason::Flicker) => "FLICKER",
            Self::Refused(Reason::Ambiguous) => "AMBIGUOUS",
            Self::Refused(Reason::Saturated) => "SATURATED",
            Self::Refused(Reason::TooSlow) => "TOO SLOW",
            Self::Refused(Reason::TooFast) => "TOO FAST",
            Self::Refused(Reason::Searching) => "SEARCHING",
            Self::Refused(Reason::Fault) | Self::Fault(_) => "FAULT",
        }
    }

    /// What the person can do about it; nothing where all is well.
    #[must_use]
    pub const fn advice(self) -> &'static str {
        match self {
            Self::Locked | Self::Coarse => "",
            Self::Held => "the last speed, no new one since",
            Self::Refused(reason) => reason.advice(),
            Self::Fault(fault) => fault.advice(),
        }
    }

    /// The state in the terms of screen, SCPI and JSON.
    #[must_use]
    pub const fn reason(self) -> Option<Reason> {
        match self {
            Self::Locked | Self::Coarse | Self::Held => None,
            Self::Refused(reason) => Some(reason),
            Self::Fault(_) => Some(Reason::Fault),
        }
    }
}

impl From<Status> for State {
    fn from(status: Status) -> Self {
        match status {
            Status::Locked => Self::Locked,
            Status::Coarse => Self::Coarse,
            Status::Refused(reason) => Self::Refused(reason),
        }
    }
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Panic,
        Self::Exception,
        Self::Watchdog,
        Self::Preferences,
        Self::Crystal,
        Self::Memory,
    ];

    /// What happened, and what the person can do about it.
    #[must_use]
    pub const fn advice(self) -> &'static str {
        match self {
            Self::Panic => "the program stopped itself and has restarted: press OK",
            Self::Exception => "the processor stopped the program; restarted: press OK",
            Self::Watchdog => "a task hung and the device has restarted: press OK",
            Self::Preferences => "the settings were damaged, the defaults stand: press OK",
            Self::Crystal => "the clock's crystal does not swing: have the board repaired",
            Self::Memory => "the external memory fails: have the board repaired",
        }
    }
}

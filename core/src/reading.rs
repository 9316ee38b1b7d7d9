//! What a measurement says: speed with its error bar, or why there is none.

use heapless::Vec;

use crate::limits::MAX_ROTORS;

/// Why no speed is given. One closed set for screen, SCPI and JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// No sensor is connected.
    NoSensor,
    /// The sensor is silent.
    NoEvents,
    /// Events arrive, but fewer than a registration needs.
    TooFewEvents,
    /// Nothing in view turns.
    NoRotation,
    /// What changes is the light of a lamp, not a rotor; or it makes a fast rotor of a slow one.
    Flicker,
    /// Two or more speeds explain the events, or the witnesses disagree.
    Ambiguous,
    /// The sensor or the link lost so many events that the rest is not to be trusted.
    Saturated,
    /// The rotor turns, but not far enough within the longest window.
    TooSlow,
    /// Blade passages come faster than the method resolves, or than the pixels recover.
    TooFast,
    /// The window is not full yet.
    Searching,
    /// The device itself failed.
    Fault,
}

impl Reason {
    /// Every reason, in the order of the contract.
    pub const ALL: [Self; 11] = [
        Self::NoSensor,
        Self::NoEvents,
        Self::TooFewEvents,
        Self::NoRotation,
        Self::Flicker,
        Self::Ambiguous,
        Self::Saturated,
        Self::TooSlow,
        Self::TooFast,
        Self::Searching,
        Self::Fault,
    ];

    /// The name used in JSON and SCPI.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NoSensor => "no_sensor",
            Self::NoEvents => "no_events",
            Self::TooFewEvents => "too_few_events",
            Self::NoRotation => "no_rotation",
            Self::Flicker => "flicker",
            Self::Ambiguous => "ambiguous",
            Self::Saturated => "saturated",
            Self::TooSlow => "too_slow",
            Self::TooFast => "too_fast",
            Self::Searching => "searching",
            Self::Fault => "fault",
        }
    }

    /// What the person holding the device can do about it, one line.
    #[must_use]
    pub const fn advice(self) -> &'static str {
        match self {
            Self::NoSensor => "check the camera's cable",
            Self::NoEvents => "take off the lens cap, or add light",
            Self::TooFewEvents => "move closer or add light",
            Self::NoRotation => "point the camera at the rotor",
            Self::Flicker => "the light flickers: use daylight or a DC lamp",
            Self::Ambiguous => "hold still, fill the view with one rotor, or give the blade count",
            Self::Saturated => "too many events: narrow the view or dim the light",
            Self::TooSlow => "keep the camera on the rotor for longer",
            Self::TooFast => "the blades pass too fast to be followed",
            Self::Searching => "hold still until the window is full",
            Self::Fault => "restart the device",
        }
    }
}

/// How far a measurement got.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Status {
    /// The long baseline holds: sigma near the physical bound.
    Locked,
    /// Two witnesses agree, but the long baseline does not hold: a larger sigma.
    Coarse,
    /// No speed, and why.
    Refused(Reason),
}

impl Status {
    /// The name used in JSON and SCPI.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Locked => "locked",
            Self::Coarse => "coarse",
            Self::Refused(_) => "refused",
        }
    }

    /// The reason of a refusal.
    #[must_use]
    pub const fn reason(self) -> Option<Reason> {
        match self {
            Self::Refused(reason) => Some(reason),
            Self::Locked | Self::Coarse => None,
        }
    }
}

/// Sense of rotation as seen on the screen (y down).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// Clockwise: atan2(y, x) grows.
    Cw,
    /// Counter-clockwise.
    Ccw,
}

impl Direction {
    /// The name used in JSON and SCPI.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Cw => "cw",
            Self::Ccw => "ccw",
        }
    }
}

/// What a speed is relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Frame {
    /// The camera: its own roll is in the speed, and in sigma.
    Camera,
    /// The room: the camera's roll has been taken out.
    Room,
}

impl Frame {
    /// The name used in JSON and SCPI.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Room => "room",
        }
    }
}

/// A measured speed with its error bar. SI inside; shown as rpm.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Speed {
    /// Mean angular speed over the window in rad/s, positive = clockwise on the screen.
    pub omega_rad_s: f32,
    /// Standard error of `omega_rad_s` in rad/s: +/- 1.96 of it covers 95 %, clock included.
    pub omega_sigma_rad_s: f32,
    /// Angular acceleration in rad/s^2 (sign as `omega_rad_s`), where the window shows it.
    pub alpha_rad_s2: Option<f32>,
    /// What the speed is relative to.
    pub frame: Frame,
}

impl Speed {
    /// rad/s to revolutions per minute.
    pub const RPM_PER_RAD_S: f32 = 9.549_297;

    /// Magnitude in revolutions per minute.
    #[must_use]
    pub fn rpm(&self) -> f32 {
        self.omega_rad_s.abs() * Self::RPM_PER_RAD_S
    }

    /// Standard error in revolutions per minute.
    #[must_use]
    pub fn rpm_sigma(&self) -> f32 {
        self.omega_sigma_rad_s * Self::RPM_PER_RAD_S
    }

    /// Change of the magnitude in rpm per second.
    #[must_use]
    pub fn accel_rpm_per_s(&self) -> Option<f32> {
        let sign = if self.omega_rad_s < 0.0 { -1.0 } else { 1.0 };
        self.alpha_rad_s2.map(|alpha| alpha * sign * Self::RPM_PER_RAD_S)
    }

    /// Sense of rotation.
    #[must_use]
    pub fn direction(&self) -> Direction {
        if self.omega_rad_s < 0.0 { Direction::Ccw } else { Direction::Cw }
    }
}

/// One rotor in one reading.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RotorReading {
    /// Identity over the series: 0 is shown as "A".
    pub id: u8,
    /// Centre of rotation at the middle of the window, in pixels.
    pub x_px: f32,
    /// Centre of rotation at the middle of the window, in pixels.
    pub y_px: f32,
    /// Radius of the swept disc, in pixels.
    pub radius_px: f32,
    /// Number of equal blades (rotational symmetry), where known.
    pub blades: Option<u8>,
    /// How far the measurement got.
    pub status: Status,
    /// The speed; present exactly when `status` is not a refusal.
    pub speed: Option<Speed>,
    /// What each stage found, for those who ask why.
    pub evidence: Evidence,
}

/// What each stage of the measurement found; fields stay `None` for stages that did not run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Evidence {
    /// Events of this rotor in the window that were used.
    pub events: u32,
    /// Scan over frequency and angular harmonic: speed in rad/s.
    pub scan_rad_s: Option<f32>,
    /// Power of the scan's line over what unrelated events would give.
    pub scan_score: Option<f32>,
    /// Share in step of the best rival of the best harmonic over that of the best, less what a rotor seen unevenly around must show: near 1
    /// for vibration.
    pub scan_standing: Option<f32>,
    /// Share of the rotor's events that keep step with it, 0 to 1.
    pub coherence: Option<f32>,
    /// Correlation at the angle of symmetry: below 1 where the parts differ.
    pub symmetry_score: Option<f32>,
    /// Initial alignment (paper, "Initial Estimation"): speed in rad/s.
    pub initial_rad_s: Option<f32>,
    /// Refinement (paper, "Estimation Refinement"): speed in rad/s.
    pub refined_rad_s: Option<f32>,
    /// Standard error of the refinement in rad/s.
    pub refined_sigma_rad_s: Option<f32>,
    /// Refinement repeated from its own result (paper's "further refinement"): speed in rad/s.
    pub further_rad_s: Option<f32>,
    /// Long-baseline registration: speed in rad/s.
    pub lock_rad_s: Option<f32>,
    /// Standard error of the long-baseline registration in rad/s.
    pub lock_sigma_rad_s: Option<f32>,
    /// How sharply the events show the rotor's edges half-way to the rim, in pixels.
    pub sharpness_px: Option<f32>,
    /// Trend of the polar phase: speed in rad/s.
    pub phase_rad_s: Option<f32>,
    /// Standard error of the polar phase's trend in rad/s.
    pub phase_sigma_rad_s: Option<f32>,
    /// Standard deviation of the speed within the window by that trend, in rad/s: that of one swing a window.
    pub swing_rad_s: Option<f32>,
    /// Fractional-baseline test: deviation as a share of the angle of symmetry.
    pub fractional_deviation: Option<f32>,
    /// Symmetry periods in the window.
    pub periods: Option<f32>,
}

/// The result of one window.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// Middle of the window in sensor time, microseconds.
    pub t_us: u64,
    /// Length of the window in microseconds.
    pub window_us: u32,
    /// Events that arrived in the window.
    pub events: u64,
    /// Of these, events left out on purpose: the store is smaller than the window.
    pub thinned: u64,
    /// Events that the sensor or the link reported lost in the window.
    pub lost: u64,
    /// The best status among the rotors, or why there is none.
    pub status: Status,
    /// Rotors found, by their letters; refused ones included.
    pub rotors: Vec<RotorReading, MAX_ROTORS>,
}

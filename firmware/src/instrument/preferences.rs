//! What the person chose, kept over power cycles.

/// Largest blade number that can be typed in.
pub const MAX_BLADES: u8 = evtach_core::limits::MOST_STATED_BLADES;

/// Largest correction of the sensor's clock in ppm, either way.
pub const MAX_TRIM_PPM: f32 = 1_000.0;

/// Unit of the big number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unit {
    /// Revolutions per minute.
    #[default]
    Rpm,
    /// Revolutions per second.
    Hertz,
    /// Radians per second.
    RadPerS,
    /// Milliseconds per revolution.
    MsPerTurn,
}

impl Unit {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Rpm, Self::Hertz, Self::RadPerS, Self::MsPerTurn];

    /// The sign on the screen.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Rpm => "rpm",
            Self::Hertz => "Hz",
            Self::RadPerS => "rad/s",
            Self::MsPerTurn => "ms",
        }
    }

    pub(super) const fn next(self) -> Self {
        match self {
            Self::Rpm => Self::Hertz,
            Self::Hertz => Self::RadPerS,
            Self::RadPerS => Self::MsPerTurn,
            Self::MsPerTurn => Self::Rpm,
        }
    }

    /// A speed in this unit.
    #[must_use]
    pub fn of_rpm(self, rpm: f32) -> f32 {
        match self {
            Self::Rpm => rpm,
            Self::Hertz => rpm / 60.0,
            Self::RadPerS => rpm / evtach_core::Speed::RPM_PER_RAD_S,
            Self::MsPerTurn => 60_000.0 / rpm,
        }
    }

    /// A standard error in this unit, given the speed it belongs to.
    #[must_use]
    pub fn error_of_rpm(self, rpm: f32, sigma_rpm: f32) -> f32 {
        match self {
            Self::Rpm | Self::Hertz | Self::RadPerS => self.of_rpm(sigma_rpm),
            Self::MsPerTurn => self.of_rpm(rpm) * (sigma_rpm / rpm),
        }
    }
}

/// Speeds at which the device calls for attention.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Alarm {
    /// Below this many revolutions per minute; `None`: no lower limit.
    pub low_rpm: Option<f32>,
    /// Above this many revolutions per minute; `None`: no upper limit.
    pub high_rpm: Option<f32>,
}

/// Which limit of the alarm a speed is beyond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Beyond {
    /// Below the lower limit.
    Low,
    /// Above the upper limit.
    High,
}

impl Alarm {
    /// The limit that a measured speed is beyond: the very speed counts, without hysteresis or delay.
    #[must_use]
    pub fn beyond(&self, rpm: f32) -> Option<Beyond> {
        if self.high_rpm.is_some_and(|high| rpm > high) {
            Some(Beyond::High)
        } else if self.low_rpm.is_some_and(|low| rpm < low) {
            Some(Beyond::Low)
        } else {
            None
        }
    }

    /// Whether each limit is a speed.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let valid = |limit: Option<f32>| limit.is_none_or(|rpm| rpm.is_finite() && rpm > 0.0);
        valid(self.low_rpm) && valid(self.high_rpm)
    }
}

/// What the person chose: plain values, without meaning for the measurement unless said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Preferences {
    /// Unit of the big number.
    pub unit: Unit,
    /// Limits that sound the alarm.
    pub alarm: Alarm,
    /// Blade count typed in, 1 to [`MAX_BLADES`]; `None` finds it. Goes into the measurement.
    pub blades: Option<u8>,
    /// What the sensor's clock runs fast by, in parts per million, up to [`MAX_TRIM_PPM`] either way:
    /// readings are corrected by it.
    pub clock_trim_ppm: f32,
}

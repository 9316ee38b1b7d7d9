//! What the person chose, kept over power cycles.

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

/// Speeds at which the device calls for attention.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Alarm {
    /// Below this many revolutions per minute; `None`: no lower limit.
    pub low_rpm: Option<f32>,
    /// Above this many revolutions per minute; `None`: no upper limit.
    pub high_rpm: Option<f32>,
}

/// What the person chose: plain values, without meaning for the measurement unless said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Preferences {
    /// Unit of the big number.
    pub unit: Unit,
    /// Limits that sound the alarm.
    pub alarm: Alarm,
    /// Blade count typed in, 1 to 32; `None` finds it. Goes into the measurement.
    pub blades: Option<u8>,
    /// What the sensor's clock runs fast by, in parts per million, -1000 to 1000: readings are corrected by it.
    pub clock_trim_ppm: f32,
}

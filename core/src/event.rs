//! One change of brightness at one pixel, and the sensor it comes from.

/// Sign of the brightness change of an [`Event`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Polarity {
    /// The pixel became darker.
    Off = 0,
    /// The pixel became brighter.
    On = 1,
}

/// One event of an event camera (paper, section "Dynamic Vision Sensors").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Event {
    /// Sensor time in microseconds, wraps already undone.
    pub t_us: u64,
    /// Column in pixels, 0 at the left.
    pub x: u16,
    /// Row in pixels, 0 at the top: y points down.
    pub y: u16,
    /// Brighter or darker.
    pub polarity: Polarity,
}

/// Size of the sensor's pixel array, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Geometry {
    /// Columns, 1 to 2048.
    pub width_px: u16,
    /// Rows, 1 to 2048.
    pub height_px: u16,
}

impl Geometry {
    /// Largest width and height the event store can address, in pixels.
    pub const MAX_PX: u16 = 2048;

    /// A geometry, or `None` when a side is zero or longer than [`Geometry::MAX_PX`].
    #[must_use]
    pub const fn new(width_px: u16, height_px: u16) -> Option<Self> {
        let fits =
            width_px > 0 && height_px > 0 && width_px <= Self::MAX_PX && height_px <= Self::MAX_PX;
        if fits { Some(Self { width_px, height_px }) } else { None }
    }

    /// Whether the pixel lies on the sensor.
    #[must_use]
    pub const fn contains(self, x: u16, y: u16) -> bool {
        x < self.width_px && y < self.height_px
    }
}

/// Angular rate of the camera about its optical axis, from an inertial sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GyroSample {
    /// Sensor time in microseconds, same clock as the events.
    pub t_us: u64,
    /// Roll rate of the camera in rad/s; positive when the camera turns so that a still scene turns
    /// clockwise on the screen.
    pub roll_rad_s: f32,
}

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

/// One event in eight bytes, as blocks carry it: its pixel, its polarity, and the low 32 bits of its time, so that it
/// means something only beside a time that is near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PackedEvent {
    low_us: u32,
    /// Column in bits 0 to 15, row in bits 16 to 30, bit 31: brighter.
    pixel: u32,
}

impl PackedEvent {
    /// All bits zero.
    pub const ZERO: Self = Self { low_us: 0, pixel: 0 };
    /// Bit of the polarity in the pixel.
    pub(crate) const BRIGHTER: u32 = 1 << 31;
    /// Last row that fits: far off every sensor, so that rows beyond may well be taken for it.
    const LAST_ROW: u16 = 0x7fff;

    /// Low 32 bits of the time in microseconds, column and row in pixels. The row is below 2^15.
    #[must_use]
    #[inline]
    pub const fn new(low_us: u32, x: u16, y: u16, polarity: Polarity) -> Self {
        Self { low_us, pixel: (polarity as u32) << 31 | (y as u32) << 16 | x as u32 }
    }

    /// The same of a pixel that is packed already: column, row, and in the highest bit whether it became brighter.
    #[inline]
    pub(crate) const fn of_pixel(low_us: u32, pixel: u32) -> Self {
        Self { low_us, pixel }
    }

    /// The event with the high bits of its time left out; rows beyond 32 767 become that one.
    #[must_use]
    #[inline]
    pub const fn pack(event: &Event) -> Self {
        let y = if event.y < Self::LAST_ROW { event.y } else { Self::LAST_ROW };
        Self::new(event.t_us as u32, event.x, y, event.polarity)
    }

    /// The event, within 35 minutes before or after `near_us`, in microseconds.
    #[must_use]
    #[inline]
    pub const fn unpack(self, near_us: u64) -> Event {
        let step = self.low_us.wrapping_sub(near_us as u32) as i32;
        Event {
            t_us: near_us.saturating_add_signed(step as i64),
            x: self.pixel as u16,
            y: (self.pixel >> 16) as u16 & Self::LAST_ROW,
            polarity: if self.pixel & Self::BRIGHTER == 0 { Polarity::Off } else { Polarity::On },
        }
    }

    /// The bytes of a record: time, column, row and polarity, little-endian.
    #[must_use]
    #[inline]
    pub const fn to_bytes(self) -> [u8; 8] {
        ((self.pixel as u64) << 32 | self.low_us as u64).to_le_bytes()
    }

    /// What [`PackedEvent::to_bytes`] gave.
    #[must_use]
    #[inline]
    pub const fn from_bytes(bytes: [u8; 8]) -> Self {
        let both = u64::from_le_bytes(bytes);
        Self { low_us: both as u32, pixel: (both >> 32) as u32 }
    }

    /// Low 32 bits of the time in microseconds.
    #[must_use]
    #[inline]
    pub const fn low_us(self) -> u32 {
        self.low_us
    }

    /// Column in bits 0 to 15, row in bits 16 to 30.
    #[inline]
    pub(crate) const fn pixel(self) -> u32 {
        self.pixel & !Self::BRIGHTER
    }

    /// Column in bits 0 to 15, row in bits 16 to 30, bit 31: brighter.
    #[inline]
    pub(crate) const fn pixel_and_polarity(self) -> u32 {
        self.pixel
    }
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
    #[inline]
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

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
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PackedEvent {
    low_us: u32,
    /// As in a word of EVT 2, of which there are most: row in bits 0 to 10, column in bits 11 to 21, bit 28: brighter. The others mean
    /// nothing.
    word: u32,
}

impl PackedEvent {
    /// All bits zero.
    pub const ZERO: Self = Self { low_us: 0, word: 0 };
    /// Where the column stands, and bits of either.
    pub(crate) const COLUMN_AT: u32 = 11;
    pub(crate) const SIDE_MASK: u32 = (1 << Self::COLUMN_AT) - 1;
    const LAST_PIXEL: u32 = Self::SIDE_MASK << Self::COLUMN_AT | Self::SIDE_MASK;
    /// Where the polarity stands.
    pub(crate) const BRIGHTER_AT: u32 = 28;

    /// Low 32 bits of the time in microseconds, column and row in pixels. Where either is beyond 2047, both become that: a pixel
    /// that no sensor has but one of [`Geometry::MAX_PX`] in both directions.
    #[must_use]
    #[inline]
    pub const fn new(low_us: u32, x: u16, y: u16, polarity: Polarity) -> Self {
        let pixel = Self::side(x, Self::COLUMN_AT) | Self::side(y, 0);
        Self { low_us, word: (polarity as u32) << Self::BRIGHTER_AT | pixel }
    }

    /// A column or row where it stands in a packed event; of one beyond 2047 the far corner, whatever is joined to it.
    #[inline]
    pub(crate) const fn side(px: u16, at: u32) -> u32 {
        if px as u32 <= Self::SIDE_MASK { (px as u32) << at } else { Self::LAST_PIXEL }
    }

    /// The event of a word of EVT 2, or of one that is made up alike.
    #[inline]
    pub(crate) const fn of_word(low_us: u32, word: u32) -> Self {
        Self { low_us, word }
    }

    /// The event with the high bits of its time left out; see [`PackedEvent::new`].
    #[must_use]
    #[inline]
    pub const fn pack(event: &Event) -> Self {
        Self::new(event.t_us as u32, event.x, event.y, event.polarity)
    }

    /// The event, within 35 minutes before or after `near_us`, in microseconds.
    #[must_use]
    #[inline]
    pub const fn unpack(self, near_us: u64) -> Event {
        let step = self.low_us.wrapping_sub(near_us as u32) as i32;
        let (x, y) = self.pixel();
        let polarity = if self.is_brighter() { Polarity::On } else { Polarity::Off };
        Event { t_us: near_us.saturating_add_signed(step as i64), x, y, polarity }
    }

    /// Low 32 bits of the time in microseconds.
    #[must_use]
    #[inline]
    pub const fn low_us(self) -> u32 {
        self.low_us
    }

    /// Its pixel, as in a word of EVT 2.
    #[inline]
    pub(crate) const fn word(self) -> u32 {
        self.word
    }

    /// Column and row in pixels.
    #[inline]
    pub(crate) const fn pixel(self) -> (u16, u16) {
        let x = self.word >> Self::COLUMN_AT & Self::SIDE_MASK;
        (x as u16, (self.word & Self::SIDE_MASK) as u16)
    }

    /// Whether the pixel became brighter.
    #[inline]
    pub(crate) const fn is_brighter(self) -> bool {
        self.word >> Self::BRIGHTER_AT & 1 == 1
    }
}

impl PartialEq for PackedEvent {
    fn eq(&self, other: &Self) -> bool {
        let near_us = u64::from(self.low_us);
        self.low_us == other.low_us && self.unpack(near_us) == other.unpack(near_us)
    }
}

impl Eq for PackedEvent {}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fits_comes_back_and_what_does_not_lies_in_the_far_corner() {
        for (x, y, expected) in [
            (0, 0, (0, 0)),
            (345, 259, (345, 259)),
            (2047, 2047, (2047, 2047)),
            (2048, 3, (2047, 2047)),
            (3, 2048, (2047, 2047)),
            (u16::MAX, u16::MAX, (2047, 2047)),
        ] {
            for polarity in [Polarity::On, Polarity::Off] {
                let event = Event { t_us: (1 << 32) + 5, x, y, polarity };
                let (x, y) = expected;
                assert_eq!(
                    PackedEvent::pack(&event).unpack(u64::from(u32::MAX)),
                    Event { x, y, ..event }
                );
            }
        }
    }

    #[test]
    fn bits_that_mean_nothing_make_no_difference() {
        let event = PackedEvent::new(5, 7, 9, Polarity::On);
        assert_eq!(event, PackedEvent::of_word(5, event.word() | 0x3f << 22));
        assert_ne!(event, PackedEvent::new(6, 7, 9, Polarity::On));
        assert_ne!(event, PackedEvent::new(5, 7, 9, Polarity::Off));
    }
}

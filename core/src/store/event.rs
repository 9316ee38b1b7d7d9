//! One stored event.

use crate::event::PackedEvent;

/// One event as the store keeps it, 8 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoredEvent {
    /// Low 32 bits of the sensor time in microseconds: differences within a window are exact.
    t_us: u32,
    x: u16,
    /// Row, weight and polarity.
    y_weight_polarity: u16,
}

impl StoredEvent {
    /// What memory for events is filled with.
    pub const EMPTY: Self = Self { t_us: 0, x: 0, y_weight_polarity: 0 };
}

const POLARITY_BIT: u16 = 0x8000;
/// Bit of the column that no sensor has: what has it lies in no picture.
const OUT_OF_SIGHT_BIT: u16 = 0x8000;
/// Rows fit 11 bits ([`crate::Geometry::MAX_PX`]); the four above hold the weight.
const ROW_BITS: u16 = 11;
const ROW_MASK: u16 = (1 << ROW_BITS) - 1;
const WEIGHT_MASK: u16 = 0xF << ROW_BITS;
/// Most events that one stands for, as a power of two.
pub(crate) const MOST_WEIGHT_LOG2: u8 = 15;

impl StoredEvent {
    #[inline]
    pub(super) const fn store(event: PackedEvent, weight_log2: u8) -> Self {
        let ((x, y), polarity) = (event.pixel(), event.is_brighter() as u16 * POLARITY_BIT);
        let stored = Self { t_us: event.low_us(), x, y_weight_polarity: y | polarity };
        stored.weighing(weight_log2)
    }

    #[inline]
    pub(super) const fn weighing(self, weight_log2: u8) -> Self {
        let most = if weight_log2 < MOST_WEIGHT_LOG2 { weight_log2 } else { MOST_WEIGHT_LOG2 };
        let weight = (most as u16) << ROW_BITS;
        Self { y_weight_polarity: (self.y_weight_polarity & !WEIGHT_MASK) | weight, ..self }
    }

    /// The same event, out of sight or in it: nothing that looks at a place sees it there.
    #[inline]
    pub(super) const fn out_of_sight(self, is: bool) -> Self {
        let bit = if is { OUT_OF_SIGHT_BIT } else { 0 };
        Self { x: (self.x & !OUT_OF_SIGHT_BIT) | bit, ..self }
    }

    /// Time since another event, at most half an hour apart, in microseconds.
    #[inline]
    pub(super) const fn after_us(self, other: Self) -> i32 {
        self.t_us.wrapping_sub(other.t_us) as i32
    }

    /// How many events this one stands for, as a power of two: the others were thinned.
    #[must_use]
    pub const fn weight_log2(self) -> u8 {
        ((self.y_weight_polarity & WEIGHT_MASK) >> ROW_BITS) as u8
    }

    /// Column in pixels; far beyond any sensor where the event is out of sight.
    #[must_use]
    pub const fn x(self) -> u16 {
        self.x
    }

    /// Row in pixels.
    #[must_use]
    pub const fn y(self) -> u16 {
        self.y_weight_polarity & ROW_MASK
    }

    /// Whether the pixel became brighter.
    #[must_use]
    pub const fn is_on(self) -> bool {
        self.y_weight_polarity & POLARITY_BIT != 0
    }

    /// Whether the event is one of those of a share of the pixels: one of `one_of`, at least 1, with all their events. Pixels are chosen
    /// by a hash, evenly and without a pattern.
    #[inline]
    #[must_use]
    pub const fn is_of(self, one_of: u32) -> bool {
        let mixed = (self.x() as u32 | (self.y() as u32) << 16).wrapping_mul(0x9E37_79B1);
        let hash = (mixed ^ (mixed >> 15)).wrapping_mul(0x85EB_CA77) >> 16;
        hash * one_of < 1 << 16
    }

    /// Time since `origin_us` in microseconds.
    #[must_use]
    pub const fn since(self, origin_us: u64) -> i32 {
        self.t_us.wrapping_sub(origin_us as u32) as i32
    }
}

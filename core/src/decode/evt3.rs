//! Prophesee EVT 3.0: 16-bit words that only say what changed.

use super::{Counts, polarity};
use crate::event::{Event, PackedEvent, Polarity};

/// Span of the 12-bit halves of the 24-bit clock, in their own units.
const HALF_CLOCK: u16 = 1 << 12;

/// Most events that one word stands for: a vector.
const VECTOR_EVENTS: usize = 12;

/// Decoder of EVT 3.0 words (Prophesee, "EVT 3.0 format").
#[derive(Clone, Debug)]
pub struct Evt3 {
    /// Time in microseconds, wraps included: `wraps << 24 | high << 12 | low`.
    t_us: u64,
    wraps: u32,
    high: u16,
    low: u16,
    y: u16,
    base_x: u16,
    base_polarity: Polarity,
    timed: bool,
    untimed: u64,
    unknown: u64,
}

impl Default for Evt3 {
    fn default() -> Self {
        Self::new()
    }
}

impl Evt3 {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            t_us: 0,
            wraps: 0,
            high: 0,
            low: 0,
            y: 0,
            base_x: 0,
            base_polarity: Polarity::Off,
            timed: false,
            untimed: 0,
            unknown: 0,
        }
    }

    /// Takes in one word and hands out the events it completes: up to 12 for a vector word.
    #[inline]
    pub fn decode(&mut self, word: u16, mut emit: impl FnMut(Event)) {
        let payload = word & 0x0fff;
        match word >> 12 {
            0x0 => self.y = payload & 0x7ff,
            0x2 => {
                if self.timed {
                    let polarity = polarity(payload & 0x800 != 0);
                    emit(Event { t_us: self.t_us, x: payload & 0x7ff, y: self.y, polarity });
                } else {
                    self.untimed += 1;
                }
            }
            0x3 => {
                self.base_x = payload & 0x7ff;
                self.base_polarity = polarity(payload & 0x800 != 0);
            }
            0x4 => self.vector(payload, 12, emit),
            0x5 => self.vector(payload & 0xff, 8, emit),
            0x6 => self.time_low(payload),
            0x8 => self.time_high(payload),
            // Triggers, continued words and the vendor's own words carry no pixel.
            0x7 | 0xa | 0xe | 0xf => {}
            _ => self.unknown += 1,
        }
    }

    /// Packs the events of words, `base_us` later than the words say, as far as the places are sure to do: one word may be
    /// twelve events. Returns the number of words and of events.
    // Not inlined: what calls it is built for size.
    #[inline(never)]
    pub fn pack(
        &mut self,
        words: &[[u8; 2]],
        base_us: u64,
        places: &mut [PackedEvent],
    ) -> (usize, usize) {
        let words = &words[..words.len().min(places.len() / VECTOR_EVENTS)];
        let (count, mut places) = (places.len(), places.iter_mut());
        for word in words {
            self.decode(u16::from_le_bytes(*word), |event| {
                if let Some(place) = places.next() {
                    // Times that no sensor reaches may wrap.
                    let t_us = base_us.wrapping_add(event.t_us);
                    *place = PackedEvent::pack(&Event { t_us, ..event });
                }
            });
        }
        (words.len(), count - places.len())
    }

    #[inline]
    fn vector(&mut self, mut mask: u16, width: u16, mut emit: impl FnMut(Event)) {
        if self.timed {
            let (t_us, y, polarity) = (self.t_us, self.y, self.base_polarity);
            while mask != 0 {
                let x = self.base_x.wrapping_add(mask.trailing_zeros() as u16);
                emit(Event { t_us, x, y, polarity });
                mask &= mask - 1;
            }
        } else {
            self.untimed += u64::from(mask.count_ones());
        }
        self.base_x = self.base_x.wrapping_add(width);
    }

    #[inline]
    fn time_low(&mut self, low: u16) {
        // A sensor announces every wrap of the low half by TIME_HIGH, and that sets `low` to 0. Some writers send
        // TIME_HIGH only once: then the low half is seen to fall by more than half its span.
        if low < self.low && self.low - low > HALF_CLOCK / 2 {
            self.advance_high((self.high + 1) % HALF_CLOCK);
        }
        self.low = low;
        self.t_us = (self.t_us & !0xfff) | u64::from(low);
    }

    #[inline]
    fn time_high(&mut self, high: u16) {
        // Sensors repeat TIME_HIGH as a heartbeat; only a changed one restarts the low half.
        if high != self.high || !self.timed {
            self.advance_high(high);
            self.timed = true;
        }
    }

    fn advance_high(&mut self, high: u16) {
        if self.timed && high < self.high && self.high - high > HALF_CLOCK / 2 {
            self.wraps += 1;
        }
        self.high = high;
        self.low = 0;
        self.t_us = u64::from(self.wraps) << 24 | u64::from(high) << 12;
    }

    /// What the words told beside events.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        Counts { wraps: self.wraps, untimed: self.untimed, unknown: self.unknown }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::vec::Vec;

    fn decode(words: &[u16]) -> (Vec<Event>, Evt3) {
        let mut decoder = Evt3::new();
        let mut events = Vec::new();
        for &word in words {
            decoder.decode(word, |event| events.push(event));
        }
        (events, decoder)
    }

    fn times(words: &[u16]) -> Vec<u64> {
        decode(words).0.iter().map(|event| event.t_us).collect()
    }

    const PIXEL: u16 = 0x2000;

    #[test]
    fn single_events_take_row_and_time_from_before() {
        let (events, decoder) = decode(&[PIXEL, 0x8001, 0x6002, 0x0005, 0x2803, 0x2004]);
        assert_eq!(
            events,
            [
                Event { t_us: 0x1002, x: 3, y: 5, polarity: Polarity::On },
                Event { t_us: 0x1002, x: 4, y: 5, polarity: Polarity::Off },
            ]
        );
        assert_eq!(decoder.counts().untimed, 1);
    }

    #[test]
    fn vectors_advance_the_base_column() {
        let (events, _) = decode(&[0x8000, 0x6000, 0x0001, 0x3800 | 10, 0x4801, 0x5081, 0x4001]);
        let columns: Vec<u16> = events.iter().map(|event| event.x).collect();
        assert_eq!(columns, [10, 21, 22, 29, 30]);
        assert!(events.iter().all(|event| event.polarity == Polarity::On && event.y == 1));
    }

    #[test]
    fn clock_wraps_after_2_to_the_24() {
        let words = [0x8fff, 0x6fff, PIXEL, 0x8000, 0x6000, PIXEL, 0x8001, 0x6001, PIXEL];
        assert_eq!(times(&words), [0xff_ffff, 0x100_0000, 0x100_1001]);
        assert_eq!(decode(&words).1.counts().wraps, 1);
    }

    #[test]
    fn repeated_time_high_keeps_the_low_half() {
        assert_eq!(times(&[0x8001, 0x6123, 0x8001, PIXEL]), [0x1123]);
    }

    #[test]
    fn low_half_alone_may_carry_the_clock() {
        let words = [0x8fff, 0x6ff0, PIXEL, 0x6001, PIXEL, 0x6ff0, 0x6002, PIXEL];
        assert_eq!(times(&words), [0xff_fff0, 0x100_0001, 0x100_1002]);
    }

    #[test]
    fn time_high_after_a_wrap_of_the_low_half_is_not_counted_twice() {
        assert_eq!(times(&[0x8001, 0x6ff0, 0x6001, PIXEL, 0x8002, PIXEL]), [0x2001, 0x2001]);
    }
}

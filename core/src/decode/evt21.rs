//! Prophesee EVT 2.1: 32 neighbouring pixels in a 64-bit word.

use super::high::HighClock;
use super::{Counts, polarity};
use crate::event::Event;

/// Decoder of EVT 2.1 words (Prophesee, "EVT 2.1 format"). Sensors of the IMX636 generation send the upper half of a
/// word first ("legacy" byte order); turning it round is the caller's part.
#[derive(Clone, Debug, Default)]
pub struct Evt21 {
    clock: HighClock,
    untimed: u64,
    unknown: u64,
}

impl Evt21 {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self { clock: HighClock::new(), untimed: 0, unknown: 0 }
    }

    /// Takes in one word and hands out its events, up to 32.
    #[inline]
    pub fn decode(&mut self, word: u64, mut emit: impl FnMut(Event)) {
        let kind = (word >> 60) as u8;
        match kind {
            0x0 | 0x1 => {
                let mut mask = word as u32;
                let Some(base_us) = self.clock.base_us() else {
                    self.untimed += u64::from(mask.count_ones());
                    return;
                };
                let t_us = base_us | (word >> 54) & 0x3f;
                let base_x = ((word >> 43) & 0x7ff) as u16;
                let y = ((word >> 32) & 0x7ff) as u16;
                while mask != 0 {
                    let x = base_x + mask.trailing_zeros() as u16;
                    emit(Event { t_us, x, y, polarity: polarity(kind == 1) });
                    mask &= mask - 1;
                }
            }
            0x8 => self.clock.set((word >> 32) as u32 & 0x0fff_ffff),
            // Triggers and the vendor's own words carry no pixel.
            0xa | 0xe | 0xf => {}
            _ => self.unknown += 1,
        }
    }

    /// What the words told beside events.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        Counts { wraps: self.clock.wraps(), untimed: self.untimed, unknown: self.unknown }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Polarity;

    extern crate std;
    use std::vec::Vec;

    fn decode(words: &[u64]) -> (Vec<Event>, Evt21) {
        let mut decoder = Evt21::new();
        let mut events = Vec::new();
        for &word in words {
            decoder.decode(word, |event| events.push(event));
        }
        (events, decoder)
    }

    #[test]
    fn mask_bits_are_neighbouring_columns() {
        let time = 8 << 60 | 3 << 32;
        let word = 1 << 60 | 5 << 54 | 64 << 43 | 9 << 32 | 0x8000_0001;
        let (events, decoder) = decode(&[word, time, word]);
        let at = |x| Event { t_us: 3 * 64 + 5, x, y: 9, polarity: Polarity::On };
        assert_eq!(events, [at(64), at(95)]);
        assert_eq!(decoder.counts().untimed, 2);
    }

    #[test]
    fn clock_wraps_after_2_to_the_34() {
        let last = (1_u64 << 28) - 1;
        let (events, _) = decode(&[8 << 60 | last << 32, 63 << 54 | 1, 8 << 60, 1]);
        assert_eq!(events[0].t_us, (1 << 34) - 1);
        assert_eq!(events[1].t_us, 1 << 34);
    }
}

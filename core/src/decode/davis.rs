//! iniVation DAVIS (DAVIS346 and kin): 16-bit USB words.

use super::inivation::{CLOCK_RESET, Common, ImuMaker, Mounting};
use super::{Packed, polarity};
use crate::event::{Event, GyroSample, PackedEvent};

/// Decoder of DAVIS USB words (facts: libcaer, "davis_common").
#[derive(Clone, Debug)]
pub struct Davis {
    common: Common,
    swap_xy: bool,
    /// The address a row word set, until the next one.
    row: u16,
}

impl Davis {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new(mounting: Mounting) -> Self {
        let Mounting { swap_xy, flip_gyro_z } = mounting;
        Self { common: Common::new(ImuMaker::InvenSense, flip_gyro_z), swap_xy, row: 0 }
    }

    /// Takes in one word; hands out the event in it, and returns the gyro sample that it completes.
    #[inline]
    pub fn decode(&mut self, word: u16, mut emit: impl FnMut(Event)) -> Option<GyroSample> {
        if word & 0x8000 != 0 {
            self.common.clock.low(word);
            return None;
        }
        let data = word & 0x0fff;
        match word >> 12 {
            1 => self.row = data,
            code @ (2 | 3) => {
                let (x, y) = if self.swap_xy { (self.row, data) } else { (data, self.row) };
                emit(Event { t_us: self.common.clock.t_us(), x, y, polarity: polarity(code == 3) });
            }
            // Frame samples and exposure.
            4 | 6 => {}
            _ => return self.common.other(word),
        }
        None
    }

    /// Decodes words into `events`, until either is used up, or a gyro sample is complete, or
    /// the clock is set to zero. Times are `offset_us` later than
    /// the camera's, and never earlier than `reached_us`, which they move on.
    // Not inlined: what calls it is built for size.
    #[inline(never)]
    pub fn pack(
        &mut self,
        words: &[[u8; 2]],
        offset_us: u64,
        reached_us: &mut u64,
        events: &mut [PackedEvent],
    ) -> Packed {
        let room = events.len();
        let mut places = events.iter_mut();
        let mut t_us = *reached_us;
        // Where in a packed event what row and event words tell stands.
        let (row_at, at) =
            if self.swap_xy { (PackedEvent::COLUMN_AT, 0) } else { (0, PackedEvent::COLUMN_AT) };
        let mut row = PackedEvent::side(self.row, row_at);
        for (index, word) in words.iter().enumerate() {
            let word = u16::from_le_bytes(*word);
            let data = word & 0x0fff;
            match word >> 12 {
                8.. => {
                    self.common.clock.low(word);
                    t_us = t_us.max(offset_us.wrapping_add(self.common.clock.t_us()));
                }
                1 => {
                    self.row = data;
                    row = PackedEvent::side(data, row_at);
                }
                2 | 3 => {
                    let Some(place) = places.next() else {
                        *reached_us = t_us;
                        return Packed { words: index, events: room, sample: None, reset: false };
                    };
                    let brighter = u32::from(word >> 12 & 1) << PackedEvent::BRIGHTER_AT;
                    let word = brighter | PackedEvent::side(data, at) | row;
                    *place = PackedEvent::of_word(t_us as u32, word);
                }
                _ if word == CLOCK_RESET => {
                    let reset = index == 0;
                    if reset {
                        self.common.reset();
                    }
                    *reached_us = t_us;
                    let events = room - places.len();
                    return Packed { words: index.max(1), events, sample: None, reset };
                }
                _ => {
                    let sample = self.decode(word, |_| {});
                    t_us = t_us.max(offset_us.wrapping_add(self.common.clock.t_us()));
                    if let Some(sample) = sample {
                        *reached_us = t_us;
                        let words = index + 1;
                        let t_us = offset_us.wrapping_add(sample.t_us);
                        let sample = Some(GyroSample { t_us, ..sample });
                        let events = room - places.len();
                        return Packed { words, events, sample, reset: false };
                    }
                }
            }
        }
        *reached_us = t_us;
        Packed { words: words.len(), events: room - places.len(), sample: None, reset: false }
    }

    /// Words of a kind the camera does not send: many of them mean lost bytes.
    #[must_use]
    pub const fn unknown(&self) -> u64 {
        self.common.unknown()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Polarity;

    extern crate std;
    use std::vec::Vec;

    fn decode(mounting: Mounting, words: &[u16]) -> (Vec<Event>, Vec<GyroSample>) {
        let mut decoder = Davis::new(mounting);
        let mut events = Vec::new();
        let mut samples = Vec::new();
        for &word in words {
            samples.extend(decoder.decode(word, |event| events.push(event)));
        }
        (events, samples)
    }

    #[test]
    fn row_then_columns() {
        let words = [0x8005, 0x1007, 0x3009, 0x2008];
        let on = Event { t_us: 5, x: 9, y: 7, polarity: Polarity::On };
        let off = Event { t_us: 5, x: 8, y: 7, polarity: Polarity::Off };
        assert_eq!(decode(Mounting::default(), &words).0, [on, off]);
        let swapped = Mounting { swap_xy: true, ..Mounting::default() };
        assert_eq!(decode(swapped, &words).0[0], Event { x: 7, y: 9, ..on });
    }

    #[test]
    fn wrap_words_carry_their_number() {
        let words = [0xffff, 0x3001, 0x7003, 0x8002, 0x3001, 0x0001, 0x8004, 0x3001];
        let times: Vec<u64> =
            decode(Mounting::default(), &words).0.iter().map(|event| event.t_us).collect();
        assert_eq!(times, [0x7fff, 3 * 0x8000 + 2, 4]);
    }
}

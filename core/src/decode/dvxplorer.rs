//! iniVation DVXplorer (640x480): 16-bit USB words with groups of eight pixels.

use super::inivation::{CLOCK_RESET, Common, ImuMaker, Mounting};
use super::{Packed, polarity};
use crate::event::{Event, GyroSample, PackedEvent};

/// Pixels in a group, one above the other.
const GROUP_PX: u16 = 8;
/// Rows of the sensor.
const ROWS: u16 = 480;

/// Decoder of DVXplorer USB words (facts: libcaer, "dvxplorer").
#[derive(Clone, Debug)]
pub struct Dvxplorer {
    common: Common,
    swap_xy: bool,
    column: u16,
    /// First rows of the two groups that the next masks are for; `None` off the sensor.
    rows: [Option<u16>; 2],
}

impl Dvxplorer {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new(mounting: Mounting) -> Self {
        let Mounting { swap_xy, flip_gyro_z } = mounting;
        let common = Common::new(ImuMaker::Bosch, flip_gyro_z);
        Self { common, swap_xy, column: 0, rows: [None; 2] }
    }

    /// Takes in one word, hands out its events, up to 8, and returns the gyro sample that it completes.
    #[inline]
    pub fn decode(&mut self, word: u16, mut emit: impl FnMut(Event)) -> Option<GyroSample> {
        if word & 0x8000 != 0 {
            self.common.clock.low(word);
            return None;
        }
        let data = word & 0x0fff;
        match word >> 12 {
            1 => self.column = data & 0x3ff,
            code @ (2 | 3) => {
                let row = self.rows[usize::from(code == 2)]?;
                let (t_us, polarity) = (self.common.clock.t_us(), polarity(data & 0x100 == 0));
                let mut mask = data & 0xff;
                while mask != 0 {
                    let (x, y) = (self.column, row + mask.trailing_zeros() as u16);
                    let (x, y) = if self.swap_xy { (y, x) } else { (x, y) };
                    emit(Event { t_us, x, y, polarity });
                    mask &= mask - 1;
                }
            }
            4 => self.groups(data),
            _ => return self.common.other(word),
        }
        None
    }

    /// Decodes words into `events`, until the words are used up, fewer than eight places are left, a gyro sample is complete, or
    /// the clock is set to zero. Times are `offset_us` later than the camera's, and never earlier than `reached_us`, which they
    /// move on.
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
        let (mut used, mut sample, mut reset) = (words.len(), None, false);
        let mut t_us = *reached_us;
        for (index, word) in words.iter().enumerate() {
            if places.len() < usize::from(GROUP_PX) {
                used = index;
                break;
            }
            let word = u16::from_le_bytes(*word);
            if word == CLOCK_RESET {
                reset = index == 0;
                if reset {
                    self.common.reset();
                }
                used = index.max(1);
                break;
            }
            sample = self.decode(word, |event| {
                t_us = t_us.max(offset_us.wrapping_add(event.t_us));
                if let Some(place) = places.next() {
                    *place = PackedEvent::new(t_us as u32, event.x, event.y, event.polarity);
                }
            });
            if let Some(sample) = &mut sample {
                sample.t_us = offset_us.wrapping_add(sample.t_us);
                t_us = t_us.max(sample.t_us);
                used = index + 1;
                break;
            }
        }
        *reached_us = t_us;
        Packed { words: used, events: room - places.len(), sample, reset }
    }

    /// A first group and a second one some groups above or below it.
    fn groups(&mut self, data: u16) {
        let first = data & 0x3f;
        let distance = (data >> 6) & 0x1f;
        let second =
            if data & 0x800 != 0 { first.checked_sub(distance) } else { Some(first + distance) };
        let row = |group: u16| Some(group * GROUP_PX).filter(|&row| row < ROWS);
        self.rows = [row(first), second.and_then(row)];
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

    fn decode(words: &[u16]) -> Vec<Event> {
        let mut decoder = Dvxplorer::new(Mounting::default());
        let mut events = Vec::new();
        for &word in words {
            decoder.decode(word, |event| events.push(event));
        }
        events
    }

    #[test]
    fn masks_go_to_their_groups() {
        // Column 100, first group 10, second three groups further; rows 80 and 87 brighter, row 104 darker.
        let words = [0x8007, 0x1064, 0x4000 | 3 << 6 | 10, 0x3081, 0x2101];
        let at = |y, polarity| Event { t_us: 7, x: 100, y, polarity };
        assert_eq!(
            decode(&words),
            [at(80, Polarity::On), at(87, Polarity::On), at(104, Polarity::Off)]
        );
    }

    #[test]
    fn second_group_may_lie_above() {
        let words = [0x1001, 0x4800 | 3 << 6 | 10, 0x2001];
        assert_eq!(decode(&words)[0].y, 56);
    }

    #[test]
    fn groups_off_the_sensor_are_left_out() {
        assert_eq!(decode(&[0x1001, 0x4000 | 63, 0x30ff]), []);
        assert_eq!(decode(&[0x1001, 0x4800 | 5 << 6 | 2, 0x20ff]), []);
    }

    #[test]
    fn clock_wraps() {
        let words = [0x1001, 0x4001, 0xffff, 0x3001, 0x7001, 0x8000, 0x3001];
        let times: Vec<u64> = decode(&words).iter().map(|event| event.t_us).collect();
        assert_eq!(times, [0x7fff, 0x8000]);
    }
}

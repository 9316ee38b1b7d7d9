//! iniVation DVXplorer (640x480): 16-bit USB words with groups of eight pixels.

use super::inivation::{CLOCK_RESET, Clock};
use super::{Packed, polarity};
use crate::event::{Event, PackedEvent};

/// Pixels in a group, one above the other.
const GROUP_PX: u16 = 8;
/// Rows of the sensor.
const ROWS: u16 = 480;

/// Decoder of DVXplorer USB words (facts: libcaer, "dvxplorer").
#[derive(Clone, Debug)]
pub struct Dvxplorer {
    clock: Clock,
    column: u16,
    /// First rows of the two groups that the next masks are for; `None` off the sensor.
    rows: [Option<u16>; 2],
    unknown: u64,
}

impl Default for Dvxplorer {
    fn default() -> Self {
        Self::new()
    }
}

impl Dvxplorer {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self { clock: Clock::new(), column: 0, rows: [None; 2], unknown: 0 }
    }

    /// Takes in one word and hands out its events, up to 8.
    #[inline]
    pub fn decode(&mut self, word: u16, mut emit: impl FnMut(Event)) {
        if word & 0x8000 != 0 {
            self.clock.low(word);
            return;
        }
        let data = word & 0x0fff;
        match word >> 12 {
            1 => self.column = data & 0x3ff,
            code @ (2 | 3) => {
                let Some(row) = self.rows[usize::from(code == 2)] else { return };
                let polarity = polarity(data & 0x100 == 0);
                let mut mask = data & 0xff;
                while mask != 0 {
                    let y = row + mask.trailing_zeros() as u16;
                    emit(Event { t_us: self.clock.t_us(), x: self.column, y, polarity });
                    mask &= mask - 1;
                }
            }
            4 => self.groups(data),
            0 if data == 1 => self.clock.reset(),
            7 => self.clock.wrap(data),
            // Other special words, inertial samples.
            0 | 5 | 6 => {}
            _ => self.unknown += 1,
        }
    }

    /// Decodes words into `events`, until the words are used up, fewer than eight places are left, or the clock is set to zero.
    /// Times are `offset_us` later than the camera's, and never earlier than `reached_us`, which they move on. With `swap_xy`, columns are
    /// sent as rows.
    // Not inlined: what calls it is built for size.
    #[inline(never)]
    pub fn pack(
        &mut self,
        words: &[[u8; 2]],
        swap_xy: bool,
        offset_us: u64,
        reached_us: &mut u64,
        events: &mut [PackedEvent],
    ) -> Packed {
        let room = events.len();
        let mut places = events.iter_mut();
        let (mut used, mut reset) = (words.len(), false);
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
                    self.clock.reset();
                }
                used = index.max(1);
                break;
            }
            self.decode(word, |event| {
                t_us = t_us.max(offset_us.wrapping_add(event.t_us));
                if let Some(place) = places.next() {
                    let (x, y) = if swap_xy { (event.y, event.x) } else { (event.x, event.y) };
                    *place = PackedEvent::new(t_us as u32, x, y, event.polarity);
                }
            });
        }
        *reached_us = t_us;
        Packed { words: used, events: room - places.len(), sample: None, reset }
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

    /// Times the wire's 15-bit clock wrapped (every 32.768 ms).
    #[must_use]
    pub const fn wraps(&self) -> u32 {
        self.clock.wraps()
    }

    /// Times the camera set its clock to zero: time starts anew there.
    #[must_use]
    pub const fn resets(&self) -> u32 {
        self.clock.resets()
    }

    /// Words of a kind the camera does not send: many of them mean lost bytes.
    #[must_use]
    pub const fn unknown(&self) -> u64 {
        self.unknown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Polarity;

    extern crate std;
    use std::vec::Vec;

    fn decode(words: &[u16]) -> Vec<Event> {
        let mut decoder = Dvxplorer::new();
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

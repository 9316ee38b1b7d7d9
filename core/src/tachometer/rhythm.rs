//! How often what is looked at: a small memory stands for a small processor beside it.

use crate::limits::DEVICE_EVENTS;

/// When the next window is measured, and when the image is searched again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rhythm {
    /// Segments that fill while a window is measured.
    pub spare: usize,
    /// Readings until the whole image is searched again while all rotors are followed, or [`NEVER`].
    pub search_every: u8,
    /// Readings until another part of what is beside them is searched, or [`NEVER`], and how many are left.
    part_every: u8,
    until_part: u8,
    /// Time by which the window moves on from reading to reading on average, as far as segments go, in microseconds.
    hop_us: u32,
    /// Part of that which the last hop left over.
    left_us: u32,
}

/// A number of readings that is never reached.
pub(super) const NEVER: u8 = u8::MAX;
/// Fewest segments by which the window moves on: 50 ms of a window of 150 ms.
const LEAST_HOP: u32 = 2;
/// Most, so that windows overlap.
const MOST_HOP: u32 = 4;

impl Rhythm {
    /// The rhythm with room for so many events.
    ///
    /// On the device a reading takes about 50 ms, beside the taking in of a million events a second; a search of the whole image with
    /// the first measurement behind it takes longer than the spare segments last. So, while all rotors are followed, only what is
    /// beside them is searched, one part in every fourth reading: all of it, where nothing is found, in ten to twenty of them, four to
    /// eight seconds. That leaves it time for ten readings a second and a half.
    pub const fn of(events: usize) -> Self {
        let pc = Self {
            spare: 2,
            search_every: 10,
            part_every: NEVER,
            until_part: NEVER,
            hop_us: 50_000,
            left_us: 0,
        };
        if events > DEVICE_EVENTS {
            pc
        } else {
            Self {
                spare: 4,
                search_every: NEVER,
                part_every: 4,
                until_part: 4,
                hop_us: 95_000,
                ..pc
            }
        }
    }

    /// Whether a part of what is beside the rotors is searched now, in one more reading of those that are followed.
    pub const fn searches_beside(&mut self) -> bool {
        if self.part_every == NEVER {
            return false;
        }
        self.until_part -= 1;
        let now = self.until_part == 0;
        if now {
            self.until_part = self.part_every;
        }
        now
    }

    /// Segments of `segment_us` microseconds by which the window moves on now.
    pub fn hop(&mut self, segment_us: u32) -> usize {
        let due_us = self.left_us + self.hop_us;
        let hop = (due_us / segment_us).clamp(LEAST_HOP, MOST_HOP);
        self.left_us = due_us.saturating_sub(hop * segment_us).min(segment_us);
        hop as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tachometer::{BASE_WINDOW_US, LONGEST_WINDOW_US, segment_us};

    extern crate std;
    use std::vec::Vec;

    fn hops(events: usize, window_us: u32) -> Vec<usize> {
        let mut rhythm = Rhythm::of(events);
        (0..6).map(|_| rhythm.hop(segment_us(window_us))).collect()
    }

    #[test]
    fn the_device_reads_more_than_ten_times_a_second_and_a_pc_twenty_times() {
        assert_eq!(hops(DEVICE_EVENTS, BASE_WINDOW_US), [3, 4, 4, 4, 4, 3]);
        assert_eq!(hops(16 * DEVICE_EVENTS, BASE_WINDOW_US), [2; 6]);
    }

    #[test]
    fn long_windows_move_on_by_a_third_and_short_ones_still_overlap() {
        for events in [DEVICE_EVENTS, 16 * DEVICE_EVENTS] {
            assert_eq!(hops(events, LONGEST_WINDOW_US), [2; 6]);
        }
        assert_eq!(hops(DEVICE_EVENTS, 30_000), [4; 6]);
    }

    #[test]
    fn what_is_beside_is_searched_in_every_fourth_reading_of_the_device() {
        let mut device = Rhythm::of(DEVICE_EVENTS);
        let beside = (1..=20).filter(|_| device.searches_beside());
        assert_eq!(beside.collect::<Vec<_>>(), [4, 8, 12, 16, 20]);
        let mut pc = Rhythm::of(16 * DEVICE_EVENTS);
        assert!((1..=20).all(|_| !pc.searches_beside()));
    }
}

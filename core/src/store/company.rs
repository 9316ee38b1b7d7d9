//! Events that are alone: noise, which a store that is too small for all that comes need not keep.
//!
//! What moves fires pixels side by side, one after the other; noise fires one here, one there. So an event is in company where
//! another came nearby a moment ago. A moment is so many events, not so long a time: whatever the rate, an event that
//! has nothing to do with the others meets one by chance as rarely. What an edge leaves thus never becomes a smaller share of what is
//! kept, and mostly a larger one.

use heapless::Vec;

use crate::event::PackedEvent;

/// Events that are looked at at once.
const AT_ONCE: usize = 64;
/// Side in pixels of a cell, within which events are near each other, as a power of two: an edge leaves several in it.
const SIDE_LOG2: u32 = 2;
/// Columns and rows of cells that are told apart, as powers of two; beyond, they repeat. 512 bytes: all that is left of the
/// device's memory.
const COLUMNS_LOG2: u32 = 6;
const ROWS_LOG2: u32 = 5;
const CELLS: usize = 1 << (COLUMNS_LOG2 + ROWS_LOG2);
const WORDS: usize = CELLS / u32::BITS as usize;
/// Events in a moment, on average: so few that one in six unrelated ones meets another, in this moment or the one before.
const MOMENT: usize = CELLS / 8;
/// Events in a row that tell whether most of what comes is noise.
const PROBE: u32 = 400;
/// How many of these lie in a cell with another where they lie anywhere, in cells of twice the side: so that a large rotor, or one
/// whose edges jitter blurs, does not fill them all.
const BY_CHANCE: u32 = PROBE * PROBE / (2 * CELLS as u32);
/// So many times as many at most, where most is noise; and where it was in the segment before, so that it is not left out by turns.
const MOST_TIMES: u32 = 3;
const STILL_TIMES: u32 = 4;

/// Cells, a bit each, in which events came in this moment and in the one before.
#[derive(Clone, Copy, Debug)]
struct Seen {
    now: u32,
    before: u32,
}

impl Seen {
    const NOTHING: Self = Self { now: 0, before: 0 };
}

/// Where events came a moment ago.
#[derive(Debug)]
pub(super) struct Company {
    seen: [Seen; WORDS],
    /// Events until the moment ends; 0: the next begins with the next event.
    left: usize,
    /// Events of the probe, and those of them that met another.
    probed: u32,
    met: u32,
}

impl Company {
    // Nothing but zeros, so that flash holds no copy of it.
    pub const NONE: Self = Self { seen: [Seen::NOTHING; WORDS], left: 0, probed: 0, met: 0 };

    /// Starts over, with a probe.
    // Not inlined: it is called in several places.
    #[inline(never)]
    pub fn clear(&mut self) {
        *self = Self::NONE;
    }

    /// Takes in consecutive events; whether most of what comes is noise, once there are enough, and until then as it was in the segment
    /// before.
    #[inline(never)]
    pub fn probe(&mut self, events: &[PackedEvent], was_noisy: bool) -> bool {
        let left = PROBE - self.probed;
        if left == 0 {
            return was_noisy;
        }
        for event in events.iter().take(left as usize) {
            self.met += u32::from(self.meets(*event, SIDE_LOG2 + 1));
            self.probed += 1;
        }
        if self.probed < PROBE {
            return was_noisy;
        }
        self.seen.fill(Seen::NOTHING);
        self.met < BY_CHANCE * if was_noisy { STILL_TIMES } else { MOST_TIMES }
    }

    /// Whether another event came in this one's cell.
    #[inline(always)]
    fn meets(&mut self, event: PackedEvent, side_log2: u32) -> bool {
        let (x, y) = event.pixel();
        let column = x as u32 >> side_log2 & ((1 << COLUMNS_LOG2) - 1);
        let row = y as u32 >> side_log2 & ((1 << ROWS_LOG2) - 1);
        let seen = &mut self.seen[(row << (COLUMNS_LOG2 - 5) | column >> 5) as usize % WORDS];
        let bit = 1 << (column & 31);
        let met = (seen.now | seen.before) & bit != 0;
        seen.now |= bit;
        met
    }

    /// As many of the events as the moment has left, and are looked at at once.
    pub fn moment<'e>(&self, events: &'e [PackedEvent]) -> &'e [PackedEvent] {
        let left = if self.left > 0 { self.left } else { AT_ONCE };
        events.get(..left.min(AT_ONCE)).unwrap_or(events)
    }

    /// Those of a [`moment`](Self::moment) near which another event came a moment ago.
    #[inline(never)]
    pub fn found(&mut self, moment: &[PackedEvent]) -> Vec<PackedEvent, AT_ONCE> {
        if let (0, Some(first)) = (self.left, moment.first()) {
            for seen in &mut self.seen {
                *seen = Seen { now: 0, before: seen.now };
            }
            // Half to three halves as long as the average, by the digits of the time: were they all alike, noise would come and go
            // with them, and that is a frequency.
            let digits = first.low_us().wrapping_mul(0x9E37_79B9) >> (32 - MOMENT.ilog2());
            self.left = MOMENT / 2 + digits as usize;
        }
        let mut found = Vec::new();
        for event in moment {
            if self.meets(*event, SIDE_LOG2) {
                found.push(*event).ok();
            }
        }
        self.left = self.left.saturating_sub(moment.len());
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Polarity;
    use crate::store::{Even, MOST_SEGMENTS, MOST_SPARE, Store, StoredEvent};
    use std::vec::Vec;

    /// A number that looks random.
    fn mixed(index: u64) -> u64 {
        let mixed = (index + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB) >> 20
    }

    fn noise(index: u64) -> PackedEvent {
        let place = mixed(index);
        PackedEvent::new(
            index as u32,
            (place % 346) as u16,
            (place / 346 % 260) as u16,
            Polarity::Off,
        )
    }

    /// An upright edge of 60 pixels that moves to the right by a pixel in 1 000 events, a twentieth of which it leaves.
    fn scene(index: u64) -> PackedEvent {
        if !mixed(index).is_multiple_of(20) {
            return noise(index);
        }
        let x = 100 + index / 1_000 % 60;
        PackedEvent::new(index as u32, x as u16, 90 + (mixed(index) / 32 % 60) as u16, Polarity::On)
    }

    #[test]
    fn noise_is_alone_and_an_edge_is_in_company() {
        let mut company = Company::NONE;
        let (mut met, mut all) = ([0; 2], [0; 2]);
        let events: Vec<_> = (0..50_000).map(scene).collect();
        let mut rest = &events[..];
        while !rest.is_empty() {
            let moment = company.moment(rest);
            rest = &rest[moment.len()..];
            moment.iter().for_each(|event| all[usize::from(event.is_brighter())] += 1);
            for event in company.found(moment) {
                met[usize::from(event.is_brighter())] += 1;
            }
        }
        assert!(met[0] * 4 < all[0], "{met:?} of {all:?}");
        assert!(met[1] * 2 > all[1], "{met:?} of {all:?}");
    }

    #[test]
    fn a_probe_tells_noise_from_what_moves() {
        for from in [0, 1_000, 10_000] {
            for was_noisy in [false, true] {
                let events: Vec<_> = (from..from + 1_000).map(noise).collect();
                let mut company = Company::NONE;
                assert_eq!(company.probe(&events[..300], was_noisy), was_noisy);
                assert!(company.probe(&events[300..450], was_noisy));
                assert!(!company.probe(&events[450..], false), "once is enough");
                // A wheel that fills a fifth of the picture.
                let wheel = (20 * from..).map(noise).filter(|event| {
                    let (x, y) = event.pixel();
                    let (dx, dy) = (i32::from(x) - 173, i32::from(y) - 130);
                    dx * dx + dy * dy < 80 * 80
                });
                let wheel: Vec<_> = wheel.take(400).collect();
                company.clear();
                assert!(!company.probe(&wheel, was_noisy));
            }
        }
    }

    /// A store as large as the device's, after six segments of so many events; shares of the edge among what is evenly kept of it, by
    /// segment.
    fn shares(events: impl Fn(u64) -> PackedEvent, segment: u64) -> (Vec<f32>, u64) {
        let mut memory = vec![StoredEvent::default(); MOST_SEGMENTS * 1_638];
        let mut store = Store::new(&mut memory, MOST_SPARE, segment as u32);
        for index in 0..6 * segment - 1 {
            while index >= store.open_end_us() {
                store.close_segment();
            }
            store.push(&[events(index)], 0, |_, _| {});
        }
        let account = store.account(6);
        assert_eq!(account.counted, 6 * segment - 1);
        assert_eq!(account.counted, account.kept + account.noise + store.thinned());
        assert_eq!(account.noise, store.noise());
        let window = store.window(6, u64::MAX);
        let mut even = Even::default();
        let mut found = Vec::new();
        for _ in 0..6 {
            even.weigh(&window, |_| true);
        }
        for _ in 0..6 {
            let (mut edge, mut all) = (0.0, 0.0);
            even.step(&window, usize::MAX, Some, |_, event| {
                edge += f32::from(u8::from(event.is_on()));
                all += 1.0;
            });
            found.push(edge / all);
        }
        (found, account.kept)
    }

    #[test]
    fn a_store_that_is_too_small_keeps_what_moves() {
        let (shares, kept) = shares(scene, 30_000);
        // It is the burst of a full segment that tells of the noise.
        assert!(shares[0] < 0.08, "{shares:?}");
        // Twice as much of the edge.
        assert!(shares[1..].iter().sum::<f32>() > 5.0 * 0.1, "{shares:?}");
        assert!(kept > 6 * 1_100, "{kept}");
    }

    #[test]
    fn what_is_kept_does_not_depend_on_how_many_come_at_once() {
        let kept = |at_once: usize| {
            let mut memory = vec![StoredEvent::default(); MOST_SEGMENTS * 1_638];
            let mut store = Store::new(&mut memory, MOST_SPARE, 30_000);
            let events: Vec<_> = (0..90_000).map(scene).collect();
            for segment in events.chunks(30_000) {
                segment.chunks(at_once).for_each(|some| store.push(some, 0, |_, _| {}));
                store.close_segment();
            }
            assert!(store.noise() > 0);
            (store.noise(), store.window(3, u64::MAX).events().collect::<Vec<_>>())
        };
        let one_by_one = kept(1);
        assert!([7, 64, 128, 30_000].map(kept).iter().all(|kept| *kept == one_by_one));
    }

    #[test]
    fn a_store_that_holds_all_keeps_the_noise() {
        let (shares, kept) = shares(scene, 1_600);
        assert_eq!(kept, 6 * 1_600 - 1);
        assert!(shares.iter().all(|share| *share < 0.08), "{shares:?}");
    }
}

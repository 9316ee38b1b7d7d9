//! Gyro samples into the segments in which they were taken.

use super::Store;
use crate::event::GyroSample;

/// Steps of a rate in which is counted, in one rad/s.
const STEPS: f32 = (1 << 20) as f32;

/// Roll rates of the camera. In whole steps, so that they add up to the same in whatever order they come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Rates {
    steps: i64,
    count: u32,
}

impl Rates {
    fn add(&mut self, roll_rad_s: f32) {
        self.steps += i64::from((roll_rad_s * STEPS) as i32);
        self.count += 1;
    }

    pub fn and(self, other: Self) -> Self {
        Self { steps: self.steps + other.steps, count: self.count + other.count }
    }

    pub const fn is_empty(self) -> bool {
        self.count == 0
    }

    /// Mean rate in rad/s, where one was heard.
    pub fn mean_rad_s(self) -> Option<f32> {
        (self.count > 0).then(|| self.steps as f32 / (STEPS * self.count as f32))
    }
}

impl Store<'_> {
    /// Takes in the camera's roll rate, positive = the scene turns clockwise on the screen. It may come somewhat before or behind the
    /// events of its time: what is measured does not depend on it.
    #[inline(never)]
    pub fn roll(&mut self, sample: GyroSample) {
        let sample = if sample.t_us < self.open_end_us() {
            sample
        } else {
            // Its segment is not open yet. Were there two of them, no events came for longer than a gyro rests.
            let Some(before) = self.ahead.replace(sample) else { return };
            before
        };
        let held = self.held;
        let since = |start_us: u64, segment_us: u32| {
            Some((sample.t_us.checked_sub(start_us)? / u64::from(segment_us.max(1))) as usize)
        };
        let behind = since(self.start_us, self.segment_us).map(|index| held.segments + index);
        let index = match behind {
            Some(index) => index,
            // Else it is older than all that is stored.
            None => match since(held.start_us, held.segment_us) {
                Some(index) if held.segments > 0 => index.min(held.segments - 1),
                _ => return,
            },
        };
        let slot = self.slot(index.min(self.closed));
        self.segments[slot].rates.add(sample.roll_rad_s);
    }

    /// Another segment has been opened: the sample that was ahead may be one of its.
    pub(super) fn settle(&mut self) {
        if let Some(sample) = self.ahead.take() {
            self.roll(sample);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Event, PackedEvent, Polarity};
    use crate::store::{MOST_SEGMENTS, MOST_SPARE, StoredEvent, WINDOW_SEGMENTS};

    /// What a window and what is behind it heard, where each sample comes so many microseconds behind the events of its time.
    fn heard(behind_us: u64) -> Vec<Rates> {
        let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
        let mut store = Store::new(&mut memory, MOST_SPARE, 1_000);
        let mut samples = (0..9_500)
            .step_by(130)
            .map(|t_us| GyroSample { t_us, roll_rad_s: 0.1 + (t_us as f32 * 1e-3).sin() });
        let mut next = samples.next();
        for t_us in (0..9_900).step_by(7) {
            while let Some(sample) = next.filter(|sample| sample.t_us + behind_us <= t_us + 60) {
                store.roll(sample);
                next = samples.next();
            }
            while t_us >= store.open_end_us() {
                store.close_segment();
                if store.closed() == WINDOW_SEGMENTS {
                    store.hold(WINDOW_SEGMENTS);
                }
            }
            let event = Event { t_us, x: 1, y: 2, polarity: Polarity::On };
            store.push(&[PackedEvent::pack(&event)], 0, |_, _| {});
        }
        assert!(next.is_none() && store.ahead.is_none());
        (0..=store.closed()).map(|index| store.segments[store.slot(index)].rates).collect()
    }

    #[test]
    fn a_sample_is_of_the_segment_in_which_it_was_taken_whenever_it_comes() {
        let in_time = heard(60);
        assert_eq!(in_time.len(), 10);
        assert!(in_time.iter().all(|rates| (4..=8).contains(&rates.count)), "{in_time:?}");
        for behind_us in [0, 30, 200, 390] {
            assert_eq!(heard(behind_us), in_time, "{behind_us} us");
        }
    }

    #[test]
    fn what_is_older_than_all_that_is_stored_is_left_out() {
        let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
        let mut store = Store::new(&mut memory, MOST_SPARE, 1_000);
        store.restart(5_000, 1_000);
        store.roll(GyroSample { t_us: 4_999, roll_rad_s: 1.0 });
        assert!(store.segments[store.slot(0)].rates.is_empty());
        store.roll(GyroSample { t_us: 5_000, roll_rad_s: 1.0 });
        assert_eq!(store.segments[store.slot(0)].rates.mean_rad_s(), Some(1.0));
    }
}

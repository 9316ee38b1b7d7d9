//! The blocks that a window is cut into.

use super::{BLOCK_EVENTS, Pose};
use crate::limits::MAX_KNOTS;
use crate::math::{ceil, floor, larger, round};

/// Fewest blocks: a trend needs them.
const LEAST_BLOCKS: usize = 12;
/// Shortest block: a hand trembles up to 12 Hz, a host shakes up to some 60 Hz.
const SHORTEST_BLOCK_US: f32 = 3_000.0;
/// Most blocks in a symmetry period.
const MOST_IN_PERIOD: f32 = 12.0;
/// Most blocks that a path of all knots has: a last one may be a quarter longer.
const MOST_PERIODS: f32 = MAX_KNOTS as f32 - 0.75;

impl Pose {
    /// Lays the path through as many blocks as the phase and the events allow.
    pub(super) fn divide(&mut self) {
        let events = self.events.min(self.schedule.events(self.events));
        let even = (events as f32 * self.even_share) as usize;
        let most = (even / BLOCK_EVENTS).min(self.schedule.blocks());
        let most = most.clamp(LEAST_BLOCKS, MAX_KNOTS - 1) as f32;
        // In a short window a hand does little, and a trend still needs its points.
        let still_us = SHORTEST_BLOCK_US.min(self.window_us / (2 * LEAST_BLOCKS) as f32);
        let shortest = (self.window_us / most).max(still_us);
        let split = floor(self.period_us / shortest);
        // Where few events ask for few blocks, whole periods of a slow rotor must not make them fewer still: in a hand, of six no trend
        // is told.
        let per_block = self.period_us / self.window_us * LEAST_BLOCKS as f32;
        let short = self.schedule.follows_hand() && per_block > 1.0;
        let least = if short { ceil(per_block - 0.25) } else { 0.0 };
        let split = larger(split, least).min(MOST_IN_PERIOD);
        let step_us = if split >= 1.0 {
            self.period_us / split
        } else {
            // Rounded down, more blocks than there are knots would be needed, and the last would be the rest of the window.
            let least = ceil(self.window_us / (self.period_us * MOST_PERIODS));
            self.period_us * larger(round(shortest / self.period_us), least)
        };
        self.in_period = split as usize;
        let blocks = ceil(self.window_us / step_us - 0.25) as usize;
        self.path = self.path.divided(-0.5 * self.window_us, step_us, blocks);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::TAU;
    use crate::rotors::Disc;

    /// Blocks of a window of 200 ms with so many symmetry periods and so many of the rotor's events.
    fn blocks(periods: f32, events: usize) -> usize {
        let disc = Disc { x_px: 100.0, y_px: 100.0, radius_px: 50.0 };
        let mut pose = Pose::new(disc, TAU * periods / 0.2, 1, 1, 200_000).known(true, false);
        pose.events = events;
        pose.divide();
        assert!(pose.path.blocks() < MAX_KNOTS);
        pose.path.blocks()
    }

    #[test]
    fn few_events_of_a_slow_rotor_in_a_hand_leave_blocks_enough_for_a_trend() {
        for hundredths in 100..1_200_u16 {
            let periods = f32::from(hundredths) / 100.0;
            let blocks = blocks(periods, 300);
            // Rounded to whole parts of a period, which a last block may be longer by a quarter than.
            assert!((10..2 * LEAST_BLOCKS).contains(&blocks), "{periods}: {blocks}");
        }
    }

    #[test]
    fn a_period_more_or_less_hardly_changes_the_blocks() {
        assert_eq!([5.998, 6.0, 6.002].map(|periods| blocks(periods, 300)), [12; 3]);
    }

    #[test]
    fn blocks_of_a_fast_rotor_are_whole_periods() {
        assert_eq!([12.0, 24.0, 48.0].map(|periods| blocks(periods, 300)), [12; 3]);
        assert_eq!(blocks(1_000.0, 300), 12);
    }
}

//! Taking in: events, gyro samples, and what was lost; segments and windows as time goes on.

use super::{BASE_WINDOW_US, FIRST_WINDOW_US, Job, LONGEST_WINDOW_US, Tachometer, segment_us};
use crate::event::{Event, GyroSample};
use crate::store::WINDOW_SEGMENTS;

/// Time going back by more than this restarts the window; less is disorder, and the event is left out.
const CLOCK_RESET_US: u64 = 1_000_000;
/// Latest sensor time that is believed: beyond it (292 000 years) sums of times could overflow.
const LATEST_US: u64 = u64::MAX / 2;
/// Fastest roll that is believed, in rad/s: gyros in cameras end at 2000 degrees a second (35 rad/s).
const FASTEST_ROLL_RAD_S: f32 = 100.0;

impl Tachometer<'_> {
    /// Takes in events in time order; never waits for a measurement.
    /// Cost: about 50 instructions an event, and one pass over the heat map for each segment that ends.
    pub fn push(&mut self, events: &[Event]) {
        for event in events {
            self.push_one(event);
        }
    }

    fn push_one(&mut self, event: &Event) {
        if !self.settings.geometry.contains(event.x, event.y) {
            self.ignored.out_of_bounds += 1;
            return;
        }
        if self.settings.roi.is_some_and(|roi| !roi.contains(event.x, event.y)) {
            self.ignored.out_of_roi += 1;
            return;
        }
        if event.t_us > LATEST_US {
            self.ignored.out_of_order += 1;
            return;
        }
        if event.t_us < self.last_us && self.started {
            if self.last_us - event.t_us < CLOCK_RESET_US {
                self.ignored.out_of_order += 1;
                return;
            }
            self.started = false;
        }
        if !self.started {
            self.restart(event.t_us);
        }
        self.last_us = event.t_us;
        if event.t_us >= self.store.open_end_us() && !self.overrun {
            self.advance(event.t_us);
        }
        if self.overrun {
            self.ignored.overrun += 1;
            return;
        }
        self.heat.add(event.x, event.y);
        self.store.push(event);
    }

    /// Forgets the window; rotors keep their letters.
    pub(super) fn restart(&mut self, t_us: u64) {
        self.started = true;
        self.overrun = false;
        self.window_segments = 0;
        self.job = Job::Idle;
        self.target_us = self.settings.window_us.unwrap_or(BASE_WINDOW_US);
        self.store.restart(t_us, segment_us(FIRST_WINDOW_US.min(self.target_us)));
        self.heat.clear();
        self.until_search = 0;
    }

    /// Closes segments until the open one holds `t_us`.
    fn advance(&mut self, t_us: u64) {
        let gap_us = t_us - self.store.open_end_us();
        if gap_us > u64::from(LONGEST_WINDOW_US) && self.window_segments == 0 {
            // Nothing for longer than any window: what went before says nothing about what comes.
            self.restart(t_us);
            return;
        }
        while t_us >= self.store.open_end_us() {
            if self.store.full() {
                self.overrun = true;
                return;
            }
            self.store.close_segment();
            let window_us = self.store.segment_us() * WINDOW_SEGMENTS as u32;
            if self.window_segments == 0 && self.store.closed() >= WINDOW_SEGMENTS {
                if window_us + WINDOW_SEGMENTS as u32 <= self.target_us {
                    self.store.lengthen(segment_us(self.target_us.min(2 * window_us)));
                } else {
                    self.start(WINDOW_SEGMENTS);
                }
            }
        }
    }

    /// Counts events that the sensor or the link lost.
    pub fn lost(&mut self, count: u64) {
        self.store.lost(count);
    }

    /// Takes in a gyro sample. One that no gyro gives (not a number, or faster than any measures) is left out.
    pub fn gyro(&mut self, sample: GyroSample) {
        let believed = sample.roll_rad_s.abs() <= FASTEST_ROLL_RAD_S;
        if self.started && believed {
            self.store.roll(sample.roll_rad_s);
        }
    }

    /// Ends the stream: what is in the window is to be measured even if the window is not full.
    pub fn finish(&mut self) {
        if self.started && self.window_segments == 0 && !self.satisfied {
            self.start((self.store.closed() + 1).min(WINDOW_SEGMENTS));
        }
    }
}

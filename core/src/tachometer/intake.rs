//! Taking in: events, gyro samples, and what was lost; segments and windows as time goes on.

use heapless::Vec;

use super::gate::{Gate, Outside};
use super::{BASE_WINDOW_US, FIRST_WINDOW_US, Job, LONGEST_WINDOW_US, Tachometer, segment_us};
use crate::event::{Event, GyroSample, PackedEvent};
use crate::store::{MOST_WEIGHT_LOG2, WINDOW_SEGMENTS};

/// Time going back by so many microseconds restarts the window; less is disorder, and the event is left out.
pub const CLOCK_RESET_US: u64 = 1_000_000;
/// Latest sensor time that is believed: beyond it (292 000 years) sums of times could overflow.
const LATEST_US: u64 = u64::MAX / 2;
/// Events that are packed before they are taken in.
const PACKED_AT_ONCE: usize = 128;
/// Longest that what comes while a window is measured may last and be measured as one window, in microseconds.
const LONGEST_BEHIND_US: u32 = 2 * LONGEST_WINDOW_US;
/// Fastest roll that is believed, in rad/s: gyros in cameras end at 2000 degrees a second (35 rad/s).
const FASTEST_ROLL_RAD_S: f32 = 100.0;

impl Tachometer<'_> {
    /// Takes in events in time order; never waits for a measurement.
    pub fn push(&mut self, events: &[Event]) {
        let mut packed = Vec::<PackedEvent, PACKED_AT_ONCE>::new();
        let mut rest = events;
        while let Some(first) = rest.first() {
            packed.clear();
            let mut before_us = first.t_us;
            for event in rest {
                // Further apart, the low bits of the times would not tell them apart.
                if event.t_us.abs_diff(before_us) > i32::MAX as u64
                    || packed.push(PackedEvent::pack(event)).is_err()
                {
                    break;
                }
                before_us = event.t_us;
            }
            self.push_packed(first.t_us, &packed);
            rest = &rest[packed.len()..];
        }
    }

    /// Takes in events of which the first is of the time `first_us` in microseconds, and each other lies within 35 minutes
    /// of the one before.
    ///
    /// Cost: `evtach bench cost`; besides, one pass over the heat map for each segment that ends.
    pub fn push_packed(&mut self, first_us: u64, events: &[PackedEvent]) {
        self.push_thinned(first_us, events, 0);
    }

    /// Takes in events that were thinned evenly before, so that each stands for 2^`weight_log2`, up to 2^15; the rest as
    /// [`push_packed`](Self::push_packed).
    pub fn push_thinned(&mut self, first_us: u64, events: &[PackedEvent], weight_log2: u8) {
        let weight_log2 = weight_log2.min(MOST_WEIGHT_LOG2);
        let (mut rest, mut before_us) = (events, first_us);
        loop {
            let seen = self.take_in(rest, weight_log2, &mut before_us);
            rest = &rest[seen..];
            let Some((event, later)) = rest.split_first() else { return };
            let event = event.unpack(before_us);
            before_us = event.t_us;
            self.push_one(&event, weight_log2);
            rest = later;
        }
    }

    /// Takes in events as long as nothing but the counts changes with them, and returns how many; `before_us` becomes
    /// the time of the last of them.
    fn take_in(&mut self, events: &[PackedEvent], weight_log2: u8, before_us: &mut u64) -> usize {
        let end_us = if self.overrun { u64::MAX } else { self.store.open_end_us() };
        let far = before_us.abs_diff(self.last_us) > CLOCK_RESET_US;
        if !self.started || far {
            return 0;
        }
        let gate = Gate::new(&self.settings, self.last_us, end_us.min(LATEST_US + 1));
        let Some(mut gate) = gate else { return 0 };
        let mut taken = 0;
        loop {
            let rest = &events[taken..];
            let passed = &rest[..gate.admit(rest)];
            if self.overrun {
                self.ignored.overrun += passed.len() as u64;
            } else if !passed.is_empty() {
                self.store_all(passed, weight_log2);
            }
            taken += passed.len();
            let inside = taken;
            while let Some(place) = events.get(taken).and_then(|event| gate.outside(*event)) {
                match place {
                    Outside::Sensor => self.ignored.out_of_bounds += 1,
                    Outside::Roi => self.ignored.out_of_roi += 1,
                }
                taken += 1;
            }
            if taken == inside {
                break;
            }
        }
        if let Some(last) = events[..taken].last() {
            let reached_us = self.last_us + u64::from(gate.since(self.last_us as u32));
            *before_us = last.unpack(reached_us).t_us;
            self.last_us = reached_us;
        }
        taken
    }

    fn push_one(&mut self, event: &Event, weight_log2: u8) {
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
        self.store_all(&[PackedEvent::pack(event)], weight_log2);
    }

    /// Takes in events of the open segment. The heat map counts what the store keeps, each for as many as it stands for.
    fn store_all(&mut self, events: &[PackedEvent], weight_log2: u8) {
        self.store
            .push(events, weight_log2, |event, stands_log2| self.heat.count(event, stands_log2));
    }

    /// Forgets the window; rotors keep their letters.
    // Not inlined, as other rare things in this module: it stands in flash once.
    #[inline(never)]
    pub(super) fn restart(&mut self, t_us: u64) {
        self.started = true;
        self.overrun = false;
        self.catching_up = false;
        self.anew_us = None;
        self.window_segments = 0;
        self.job = Job::Idle;
        self.target_us = self.settings.window_us.unwrap_or(BASE_WINDOW_US);
        let first_us = segment_us(FIRST_WINDOW_US.min(self.target_us));
        self.ignored.overrun += self.store.restart(t_us, first_us);
        self.heat.clear();
        self.until_search = 0;
        self.satisfied = false;
    }

    /// Forgets the window, but not when the whole image is to be searched: what is known of the rotors still holds.
    pub(super) fn begin_anew(&mut self, t_us: u64) {
        let (until_search, satisfied) = (self.until_search, self.satisfied);
        self.restart(t_us);
        (self.until_search, self.satisfied) = (until_search, satisfied);
    }

    /// Closes segments until the open one holds `t_us`.
    fn advance(&mut self, t_us: u64) {
        let gap_us = t_us - self.store.open_end_us();
        let spare_us = self.store.spare() as u64 * u64::from(self.store.segment_us());
        let goes_on = self.window_segments == 0 || gap_us < spare_us;
        if gap_us > u64::from(LONGEST_WINDOW_US) && self.window_segments == 0 {
            // Nothing for longer than any window: what went before says nothing about what comes.
            self.restart(t_us);
            return;
        }
        while t_us >= self.store.open_end_us() {
            if self.anew_us.is_some_and(|at_us| at_us <= self.store.open_end_us()) {
                self.begin_anew(t_us);
                return;
            }
            if self.store.full() {
                if !goes_on {
                    self.overrun = true;
                    return;
                }
                let twice_us = self.store.segment_us().saturating_mul(2);
                if twice_us.saturating_mul(self.store.spare() as u32) <= LONGEST_BEHIND_US {
                    self.store.lengthen(twice_us);
                    continue;
                }
                self.ignored.overrun += self.store.give_up();
                self.heat.fade(1, WINDOW_SEGMENTS as u16);
            }
            self.store.close_segment();
            self.begin();
        }
    }

    /// Whether segments are longer than those of the window should be, because a measurement took longer than these last.
    pub(super) fn is_behind(&self) -> bool {
        self.store.segment_us() > segment_us(self.target_us)
    }

    /// Begins to measure the window once it is full, or makes it longer first.
    #[inline(never)]
    pub(super) fn begin(&mut self) {
        let waits = self.anew_us.is_some();
        if waits || self.window_segments > 0 {
            return;
        }
        if self.is_behind() {
            if self.store.stored_us(self.last_us) >= u64::from(self.target_us) {
                let segments = self.store.hold_all(self.last_us, segment_us(self.target_us));
                self.catching_up = segments > 0;
                if self.catching_up {
                    self.start(segments);
                }
            }
            return;
        }
        while self.window_segments == 0 && self.store.closed() >= WINDOW_SEGMENTS {
            let window_us = self.store.segment_us() * WINDOW_SEGMENTS as u32;
            if window_us + WINDOW_SEGMENTS as u32 <= self.target_us {
                self.store.lengthen(segment_us(self.target_us.min(2 * window_us)));
            } else {
                self.store.hold(WINDOW_SEGMENTS);
                self.start(WINDOW_SEGMENTS);
            }
        }
    }

    /// Counts events that the sensor or the link lost.
    pub fn lost(&mut self, count: u64) {
        self.store.lost(count);
    }

    /// Takes in a gyro sample, before or behind the events of its time, but before a window with these has been measured. One that no
    /// gyro gives (not a number, or faster than any measures) is left out.
    pub fn gyro(&mut self, sample: GyroSample) {
        let believed = sample.roll_rad_s.abs() <= FASTEST_ROLL_RAD_S;
        if self.started && believed {
            self.store.roll(sample);
        }
    }

    /// Ends the stream: what is in the window is to be measured even if the window is not full.
    pub fn finish(&mut self) {
        if self.started && self.window_segments == 0 && !self.satisfied {
            // One that waits to begin short again was measured as it was.
            while self.store.closed() >= WINDOW_SEGMENTS {
                self.store.drop_oldest();
            }
            let segments = (self.store.closed() + 1).min(WINDOW_SEGMENTS);
            self.store.hold(segments);
            self.start(segments);
        }
    }
}

//! What is held while it is measured, and how what came meanwhile goes on from it.

use super::{Held, Segment, Store};

impl Store<'_> {
    /// Holds the oldest segments, so many, for being measured (the open one counts as the last when all closed ones are taken).
    pub const fn hold(&mut self, segments: usize) {
        let most = self.closed + 1;
        let segments = if segments < most { segments } else { most };
        self.held = Held { segments, start_us: self.start_us, segment_us: self.segment_us };
        self.start_us = self.held.end_us();
    }

    /// Time that is stored behind what is held, in microseconds, where the last event came at `last_us`.
    #[must_use]
    pub fn stored_us(&self, last_us: u64) -> u64 {
        let closed = (self.closed - self.held.segments.min(self.closed)) as u64;
        let closed_us = closed * u64::from(self.segment_us);
        if self.is_open_empty() {
            return closed_us;
        }
        last_us.saturating_sub(self.start_us)
    }

    fn is_open_empty(&self) -> bool {
        let Segment { counted, lost, rates, .. } = self.segments[self.slot(self.closed)];
        counted == 0 && lost == 0 && rates.is_empty()
    }

    /// Holds all that is stored for being measured, up to the last event, which came at `last_us`, and goes on with segments of
    /// `segment_us`. Returns how many segments that are: none where the ring has no place for another.
    pub fn hold_all(&mut self, last_us: u64, segment_us: u32) -> usize {
        let is_open_empty = self.is_open_empty();
        if self.full() && !is_open_empty {
            return 0;
        }
        let segments = self.closed + usize::from(!is_open_empty);
        let mut lasted_us = u64::from(self.segment_us);
        let before = self.segments[self.slot(segments.saturating_sub(1))];
        if is_open_empty {
            self.hold(segments);
        } else {
            let open_us = self.open_end_us() - lasted_us;
            lasted_us = (last_us.saturating_sub(open_us)).clamp(1, lasted_us);
            self.hold(segments);
            self.start_us = last_us;
            self.closed += 1;
        }
        let counted = before.counted * u64::from(segment_us) / lasted_us.max(1);
        let slot = self.slot(self.closed);
        self.segments[slot] = Segment::after(&Segment { counted, ..before }, self.capacity);
        self.segment_us = segment_us.max(1);
        self.settle();
        segments
    }

    /// What is held has been measured; returns whether what came meanwhile goes on from it in segments as long. If so, it stays, and the
    /// next window may begin within it; else it goes.
    pub fn release(&mut self) -> bool {
        for index in 0..self.held.segments.min(self.closed + 1) {
            let slot = self.slot(index);
            self.segments[slot].unmeasured = 0;
        }
        let Held { segments, start_us, segment_us } = self.held;
        let goes_on = self.held.end_us() == self.start_us && segment_us == self.segment_us;
        if goes_on {
            self.start_us = start_us;
        } else {
            for _ in 0..segments.min(self.closed) {
                self.forget_oldest();
            }
            // Only now: what is measured must not know of what came behind it.
            self.rolled = self.rolled.and(core::mem::take(&mut self.rolled_behind));
        }
        self.held = Held::default();
        goes_on
    }
}

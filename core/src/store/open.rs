//! The open segment: which of its events are kept.

use super::event::MOST_WEIGHT_LOG2;
use super::{Store, StoredEvent};
use crate::event::PackedEvent;

/// Sixteenths of a segment that keep consecutive events.
const DENSE_SIXTEENTHS: usize = 4;
/// Sixteenths before the reservoir starts.
const BURST_SIXTEENTHS: usize = 7;

/// What is known of a segment beside its events.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// Events kept.
    pub len: usize,
    /// Events that came.
    pub counted: u64,
    /// Events that were lost before.
    pub lost: u64,
    pub roll_sum_rad_s: f32,
    pub roll_count: u32,
    /// The reservoir keeps every 2^stride_log2-th event.
    pub stride_log2: u8,
    /// Events to pass over before the next is kept.
    pub skip: u32,
    /// Until so many are kept, every 2^step_log2-th event is.
    pub until: usize,
    pub step_log2: u8,
}

impl Default for Segment {
    fn default() -> Self {
        // Where the octaves end, the reservoir goes on as densely as the last of them.
        let stride_log2 = (BURST_SIXTEENTHS - DENSE_SIXTEENTHS) as u8;
        Self {
            len: 0,
            counted: 0,
            lost: 0,
            roll_sum_rad_s: 0.0,
            roll_count: 0,
            stride_log2,
            skip: 0,
            until: 0,
            step_log2: 0,
        }
    }
}

impl Store<'_> {
    /// Takes in events of the open segment, each of which stands for 2^`weight_log2`: the others were thinned before. `kept` hears
    /// of those that it keeps, and of how many each stands for then, as a power of two.
    // A function of its own, so that all it needs stays in registers.
    #[inline(never)]
    pub fn push(
        &mut self,
        events: &[PackedEvent],
        weight_log2: u8,
        mut kept: impl FnMut(PackedEvent, u8),
    ) {
        let slot = self.slot(self.closed);
        let skip = self.segments[slot].skip;
        // What is to be passed over, in these events, and what is left of it that is less than one stands for.
        let (mut next, mut rest) = ((skip >> weight_log2) as usize, skip);
        let mut count = 0;
        while next < events.len() {
            if self.segments[slot].len >= self.segments[slot].until {
                self.turn(slot);
            }
            let segment = &mut self.segments[slot];
            let step_log2 = segment.step_log2;
            let stride_log2 = step_log2.saturating_sub(weight_log2);
            let stands_log2 = step_log2.max(weight_log2);
            let base = slot * self.capacity;
            let places = self.events.get_mut(base + segment.len..base + segment.until);
            let places = places.unwrap_or_default();
            // As many as go by the same step.
            let every = events[next..].iter().step_by(1 << stride_log2);
            let before = count;
            for (place, event) in places.iter_mut().zip(every) {
                *place = StoredEvent::store(*event, stands_log2);
                kept(*event, stands_log2);
                count += 1;
            }
            if count == before {
                // No memory at all.
                break;
            }
            segment.len += count - before;
            next += (count - before) << stride_log2;
            rest = (1 << step_log2) - 1;
        }
        let segment = &mut self.segments[slot];
        rest &= (1 << weight_log2) - 1;
        segment.skip = (next.saturating_sub(events.len()) as u32) << weight_log2 | rest;
        let arrived = (events.len() as u64) << weight_log2;
        segment.counted += arrived;
        self.thinned += arrived - count as u64;
    }

    /// Chooses how many events the next ones stand for, and up to where; a full segment makes room first.
    #[cold]
    fn turn(&mut self, slot: usize) {
        let (base, burst, octave) = (slot * self.capacity, self.burst(), self.capacity / 16);
        let segment = &mut self.segments[slot];
        if segment.len == self.capacity {
            let reservoir = &mut self.events[base + burst..base + self.capacity];
            let mut kept = reservoir.len();
            while kept == reservoir.len() && segment.stride_log2 < MOST_WEIGHT_LOG2 {
                segment.stride_log2 += 1;
                kept = thin(reservoir, segment.stride_log2);
            }
            kept = kept.min(reservoir.len().saturating_sub(1));
            self.thinned += (reservoir.len() - kept) as u64;
            segment.len = burst + kept;
        }
        let part = segment.len.checked_div(octave).unwrap_or(0);
        (segment.step_log2, segment.until) = if octave == 0 {
            (0, self.capacity)
        } else if part < DENSE_SIXTEENTHS {
            (0, DENSE_SIXTEENTHS * octave)
        } else if part < BURST_SIXTEENTHS {
            ((part - DENSE_SIXTEENTHS + 1) as u8, (part + 1) * octave)
        } else {
            (segment.stride_log2, self.capacity)
        };
    }

    /// Events of a segment that come before its reservoir.
    pub(super) const fn burst(&self) -> usize {
        BURST_SIXTEENTHS * (self.capacity / 16)
    }
}

/// Thins events until each stands for 2^`weight_log2` or, where it already does, for more; returns how many are left. Those that are
/// stay evenly spread: every other one of events that all stand for half as many.
fn thin(events: &mut [StoredEvent], weight_log2: u8) -> usize {
    let (mut passed, mut kept, mask) = (0_u32, 0, (1_u32 << weight_log2) - 1);
    for index in 0..events.len() {
        let event = events[index];
        let after = passed + (1 << event.weight_log2());
        // The first of each stretch of so many.
        if (passed + mask) & !mask < after {
            events[kept] = event.weighing(weight_log2.max(event.weight_log2()));
            kept += 1;
        }
        passed = after;
    }
    kept
}

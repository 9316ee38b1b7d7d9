//! The open segment: which of its events are kept.

use super::event::MOST_WEIGHT_LOG2;
use super::{Store, StoredEvent};
use crate::event::PackedEvent;

/// Sixteenths of a segment that keep consecutive events.
const DENSE_SIXTEENTHS: usize = 4;
/// Sixteenths that keep every second, every fourth and every eighth, each in one.
const OCTAVES: u8 = 3;

/// What is known of a segment beside its events.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Segment {
    /// Events kept.
    pub len: usize,
    /// Events that came.
    pub counted: u64,
    /// Events that were lost before.
    pub lost: u64,
    pub roll_sum_rad_s: f32,
    pub roll_count: u32,
    /// Every 2^stride_log2-th event is kept.
    pub stride_log2: u8,
    /// Events to pass over before the next is kept.
    pub skip: u32,
}

impl Store<'_> {
    /// Takes in events of the open segment.
    // A function of its own, so that all it needs stays in registers.
    #[inline(never)]
    pub fn push(&mut self, events: &[PackedEvent]) {
        let slot = self.slot(self.closed);
        let mut rest = events;
        let mut kept = 0;
        loop {
            let skip = self.segments[slot].skip as usize;
            let Some((event, later)) = rest.get(skip..).and_then(<[_]>::split_first) else { break };
            self.keep(slot, *event);
            kept += 1;
            rest = later;
        }
        let segment = &mut self.segments[slot];
        segment.skip -= rest.len() as u32;
        segment.counted += events.len() as u64;
        self.thinned += (events.len() - kept) as u64;
    }

    #[inline(always)]
    fn keep(&mut self, slot: usize, event: PackedEvent) {
        if self.segments[slot].len == self.capacity {
            self.thin(slot);
        }
        let segment = &mut self.segments[slot];
        if let Some(place) = self.events.get_mut(slot * self.capacity + segment.len) {
            *place = StoredEvent::store(event, segment.stride_log2);
            segment.len += 1;
        }
        segment.skip = (1 << segment.stride_log2) - 1;
    }

    /// Makes room in a full segment: every other event goes, those kept stay evenly spread.
    #[cold]
    fn thin(&mut self, slot: usize) {
        let base = slot * self.capacity;
        let segment = &mut self.segments[slot];
        let first = as_they_came(self.capacity, segment.stride_log2);
        let sparser = &mut self.events[base + first..base + self.capacity];
        let kept = sparser.len() / 2;
        self.thinned += (sparser.len() - kept) as u64;
        segment.len = first + kept;
        segment.stride_log2 = (segment.stride_log2 + 1).min(MOST_WEIGHT_LOG2);
        for i in 0..kept {
            sparser[i] = sparser[2 * i].weighing(segment.stride_log2);
        }
    }
}

/// Events at a segment's start that stay as they are when those behind them are thinned from one in 2^stride_log2 to half of
/// that: the dense burst, and one octave more each time, up to where the reservoir starts.
pub(super) const fn as_they_came(capacity: usize, stride_log2: u8) -> usize {
    let octaves = if stride_log2 < OCTAVES { stride_log2 } else { OCTAVES };
    (DENSE_SIXTEENTHS + octaves as usize) * (capacity / 16)
}

/// What an event at this place of a segment stands for at least once all behind the burst is thinned, as a power of two.
pub(super) const fn level(capacity: usize, place: usize) -> u8 {
    let mut level = 0;
    while level < OCTAVES && place >= as_they_came(capacity, level) {
        level += 1;
    }
    level
}

//! The open segment: which of its events are kept.

use core::cell::Cell;

use super::event::MOST_WEIGHT_LOG2;
use super::gyro::Rates;
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
    /// Events that came, each for as many as it stands for.
    pub counted: u64,
    /// Events that were handed in and that no window has measured yet.
    pub unmeasured: u32,
    /// Events that were lost before.
    pub lost: u64,
    /// What the camera's gyro said.
    pub rates: Rates,
    /// Every 2^stride_log2-th event is kept, behind the burst and its octaves.
    pub stride_log2: u8,
    /// Events to pass over before the next is kept.
    pub skip: u32,
    /// Most that an event stood for when it came, as a power of two.
    pub heaviest_log2: u8,
}

impl Segment {
    /// The segment after one: it begins with the stride that it will need, or one a little finer, if as many events come as
    /// before. The same is kept as if it began with every event, but for the work of thinning them; where so few come that it need not
    /// have been so sparse, fewer are.
    pub fn after(before: &Self, capacity: usize) -> Self {
        let overfull = before.counted.checked_div(capacity as u64).unwrap_or(0);
        let stride_log2 = overfull.checked_ilog2().unwrap_or(0) as u8;
        Self { stride_log2: stride_log2.min(MOST_WEIGHT_LOG2), ..Self::default() }
    }

    /// How many events the next that is kept stands for, as a power of two, and the place up to which that holds.
    fn step(&self, capacity: usize) -> (u8, usize) {
        for octave in 0..self.stride_log2.min(OCTAVES + 1) {
            let end = as_they_came(capacity, octave);
            if self.len < end {
                return (octave, end);
            }
        }
        (self.stride_log2, capacity)
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
        let segment = &mut self.segments[slot];
        segment.heaviest_log2 = segment.heaviest_log2.max(weight_log2);
        let skip = segment.skip;
        // What is to be passed over, in these events, and what is left of it that is less than one stands for.
        let (mut next, mut rest) = ((skip >> weight_log2) as usize, skip);
        let mut count = 0;
        while next < events.len() {
            if self.segments[slot].len >= self.capacity {
                self.make_room(slot);
            }
            let segment = &mut self.segments[slot];
            let (step_log2, end) = segment.step(self.capacity);
            let stride_log2 = step_log2.saturating_sub(weight_log2);
            let stands_log2 = step_log2.max(weight_log2);
            let base = slot * self.capacity;
            let places = self.events.get_mut(base + segment.len..base + end);
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
        segment.unmeasured = segment.unmeasured.saturating_add(events.len() as u32);
        self.thinned += arrived - count as u64;
    }

    /// Makes room in a full segment: every other event behind the burst goes.
    #[cold]
    fn make_room(&mut self, slot: usize) {
        let base = slot * self.capacity;
        let segment = &mut self.segments[slot];
        let first = as_they_came(self.capacity, segment.stride_log2);
        let sparser = &mut self.events[base + first..base + self.capacity];
        let mut kept = sparser.len();
        while kept == sparser.len() && segment.stride_log2 < MOST_WEIGHT_LOG2 {
            let alike = segment.heaviest_log2 <= segment.stride_log2;
            segment.stride_log2 += 1;
            kept = if alike {
                halve(sparser, segment.stride_log2)
            } else {
                thin(sparser, segment.stride_log2)
            };
        }
        kept = kept.min(sparser.len().saturating_sub(1));
        self.thinned += (sparser.len() - kept) as u64;
        segment.len = first + kept;
    }
}

/// Thins events that all stand for the same, so that each that is left stands for 2^`weight_log2`, twice as many; returns how many
/// are left. What [`thin`] does, in a fifth of the time.
fn halve(events: &mut [StoredEvent], weight_log2: u8) -> usize {
    let left = events.len().div_ceil(2);
    let events = Cell::from_mut(events).as_slice_of_cells();
    for (place, event) in events.iter().zip(events.iter().step_by(2)) {
        place.set(event.get().weighing(weight_log2));
    }
    left
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

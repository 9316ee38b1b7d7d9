//! Longer segments out of shorter ones.

use super::event::MOST_WEIGHT_LOG2;
use super::open::{as_they_came, level};
use super::{MOST_SEGMENTS, Segment, Store};

impl Store<'_> {
    /// Makes the segments behind those that are held longer, keeping what is stored: each new segment keeps the burst and the octaves of the first old one in
    /// it, and of the rest every event that stands for as many as the new reservoir's stride says.
    /// `segment_us` is at least the length so far. Cost: two passes over the store.
    pub fn lengthen(&mut self, segment_us: u32) {
        let old: [Segment; MOST_SEGMENTS] = core::array::from_fn(|i| self.segments[self.slot(i)]);
        let old_us = u64::from(self.segment_us);
        let held = self.held.segments;
        if held > self.closed {
            return;
        }
        let closed = held + ((self.closed - held) as u64 * old_us / u64::from(segment_us)) as usize;
        // Reading runs ahead of writing: new segments start no earlier than old ones and hold no more events.
        let (mut from, mut index) = (held, 0);
        for new in held..=closed {
            let nth = (new - held) as u64;
            let end_us = ((nth + 1) * u64::from(segment_us)).min(i32::MAX as u64) as i32;
            let mut merged = self.plan_merge(&old, (from, index), end_us);
            let burst = as_they_came(self.capacity, merged.stride_log2);
            let first = from;
            let (mut passed, mut next) = (0_u64, 0_u64);
            let base = self.slot(new) * self.capacity;
            while from <= self.closed {
                let (source, segment) = (self.slot(from) * self.capacity, old[from]);
                let before = index;
                while index < segment.len {
                    let event = self.events[source + index];
                    if event.since(self.start_us) >= end_us {
                        break;
                    }
                    index += 1;
                    let level = if from == first && merged.len < burst {
                        level(self.capacity, merged.len)
                    } else {
                        merged.stride_log2
                    };
                    let kept = passed >= next;
                    passed += 1 << event.weight_log2();
                    if kept && merged.len < self.capacity {
                        let weight = event.weight_log2().max(level);
                        next += 1 << weight;
                        self.events[base + merged.len] = event.weighing(weight);
                        merged.len += 1;
                    } else {
                        self.thinned += 1;
                    }
                }
                // An old segment that is split gives each part of its count as it gives events.
                let share =
                    |index: usize| segment.counted * index as u64 / segment.len.max(1) as u64;
                merged.counted += share(index) - share(before);
                if index < segment.len {
                    break;
                }
                merged.counted += if segment.len == 0 { segment.counted } else { 0 };
                (from, index) = (from + 1, 0);
            }
            for (i, segment) in old.iter().enumerate().take(self.closed + 1).skip(held) {
                if ((i - held) as u64 * old_us) / u64::from(segment_us) == nth {
                    merged.lost = merged.lost.saturating_add(segment.lost);
                    merged.unmeasured = merged.unmeasured.saturating_add(segment.unmeasured);
                    merged.rates = merged.rates.and(segment.rates);
                }
            }
            let slot = self.slot(new);
            self.segments[slot] = merged;
        }
        self.closed = closed;
        self.segment_us = segment_us;
    }

    /// An empty segment whose stride lets the reservoir hold what comes after the first burst and before `end_us`.
    fn plan_merge(
        &self,
        old: &[Segment; MOST_SEGMENTS],
        (from, index): (usize, usize),
        end_us: i32,
    ) -> Segment {
        let mut weight = 0_u64;
        let mut stride_log2 = 0;
        for (i, segment) in old.iter().enumerate().take(self.closed + 1).skip(from) {
            let source = self.slot(i) * self.capacity;
            let burst = as_they_came(self.capacity, 0);
            let skipped = if i == from { index + burst } else { 0 };
            for event in &self.events[source..source + segment.len][skipped.min(segment.len)..] {
                if event.since(self.start_us) >= end_us {
                    break;
                }
                weight += 1 << event.weight_log2();
                stride_log2 = stride_log2.max(event.weight_log2());
            }
        }
        let room = |stride_log2| self.capacity - as_they_came(self.capacity, stride_log2);
        while weight >> stride_log2 >= room(stride_log2) as u64 && stride_log2 < MOST_WEIGHT_LOG2 {
            stride_log2 += 1;
        }
        // What is kept stands for at least as many, and some for more.
        Segment { stride_log2, heaviest_log2: MOST_WEIGHT_LOG2, ..Segment::default() }
    }
}

//! The event store: a window of events in a fixed memory.
//!
//! Time is cut into segments of equal length; [`WINDOW_SEGMENTS`] of them are the window, and
//! [`SPARE_SEGMENTS`] more take in events while the window is measured. A segment first keeps a dense
//! burst of consecutive events (what a registration of neighbouring slices needs), then, octave by octave, every
//! second, fourth and eighth event, so that the baseline grows geometrically from the burst on; what is left of
//! its memory is a reservoir thinned evenly (what a long baseline needs): every 2^s-th event, s growing as
//! the reservoir fills. What is kept depends on the events and the capacity alone, never on when a task ran.

use crate::event::{Event, Polarity};

/// Segments in a window.
pub const WINDOW_SEGMENTS: usize = 6;
/// Segments filled while a window is measured.
pub const SPARE_SEGMENTS: usize = 2;
/// Segments in the ring.
pub const SEGMENTS: usize = WINDOW_SEGMENTS + SPARE_SEGMENTS;

/// One event as the store keeps it, 8 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoredEvent {
    /// Low 32 bits of the sensor time in microseconds: differences within a window are exact.
    t_us: u32,
    x: u16,
    /// Row, weight and polarity.
    y_weight_polarity: u16,
}

/// Sixteenths of a segment that keep consecutive events.
const DENSE_SIXTEENTHS: usize = 4;
/// Sixteenths before the reservoir starts.
const BURST_SIXTEENTHS: usize = 7;

const POLARITY_BIT: u16 = 0x8000;
/// Rows fit 11 bits ([`crate::Geometry::MAX_PX`]); the four above hold the weight.
const ROW_BITS: u16 = 11;
const ROW_MASK: u16 = (1 << ROW_BITS) - 1;
const WEIGHT_MASK: u16 = 0xF << ROW_BITS;
const MOST_WEIGHT_LOG2: u8 = 15;

impl StoredEvent {
    fn pack(event: &Event, weight_log2: u8) -> Self {
        let polarity = if event.polarity == Polarity::On { POLARITY_BIT } else { 0 };
        let packed = Self {
            t_us: event.t_us as u32,
            x: event.x,
            y_weight_polarity: (event.y & ROW_MASK) | polarity,
        };
        packed.weighing(weight_log2)
    }

    fn weighing(self, weight_log2: u8) -> Self {
        let weight = u16::from(weight_log2.min(MOST_WEIGHT_LOG2)) << ROW_BITS;
        Self { y_weight_polarity: (self.y_weight_polarity & !WEIGHT_MASK) | weight, ..self }
    }

    /// How many events this one stands for, as a power of two: the others were thinned.
    #[must_use]
    pub const fn weight_log2(self) -> u8 {
        ((self.y_weight_polarity & WEIGHT_MASK) >> ROW_BITS) as u8
    }

    /// Column in pixels.
    #[must_use]
    pub const fn x(self) -> u16 {
        self.x
    }

    /// Row in pixels.
    #[must_use]
    pub const fn y(self) -> u16 {
        self.y_weight_polarity & ROW_MASK
    }

    /// Whether the pixel became brighter.
    #[must_use]
    pub const fn is_on(self) -> bool {
        self.y_weight_polarity & POLARITY_BIT != 0
    }

    /// Time since `origin_us` in microseconds.
    #[must_use]
    pub const fn since(self, origin_us: u64) -> i32 {
        self.t_us.wrapping_sub(origin_us as u32) as i32
    }
}

#[derive(Clone, Copy, Debug)]
struct Segment {
    len: usize,
    counted: u64,
    lost: u64,
    roll_sum_rad_s: f32,
    roll_count: u32,
    /// The reservoir keeps every 2^stride_log2-th event.
    stride_log2: u8,
    /// Events to pass over before the next is kept.
    skip: u32,
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
        }
    }
}

/// Events of the recent past, in time order.
#[derive(Debug)]
pub struct Store<'m> {
    events: &'m mut [StoredEvent],
    /// Events in one segment: 4/16 dense, 3/16 in octaves, 9/16 reservoir.
    capacity: usize,
    segments: [Segment; SEGMENTS],
    /// Ring position of the oldest segment.
    first: usize,
    /// Closed segments.
    closed: usize,
    /// Start of the oldest segment.
    start_us: u64,
    segment_us: u32,
    thinned: u64,
}

impl<'m> Store<'m> {
    /// An empty store over the lent memory; `segment_us` is at least 1.
    pub fn new(events: &'m mut [StoredEvent], segment_us: u32) -> Self {
        let capacity = events.len() / SEGMENTS;
        Self {
            events,
            capacity,
            segments: [Segment::default(); SEGMENTS],
            first: 0,
            closed: 0,
            start_us: 0,
            segment_us: segment_us.max(1),
            thinned: 0,
        }
    }

    /// Forgets everything; the next segment starts at `start_us`.
    pub fn restart(&mut self, start_us: u64, segment_us: u32) {
        self.segments = [Segment::default(); SEGMENTS];
        self.first = 0;
        self.closed = 0;
        self.start_us = start_us;
        self.segment_us = segment_us.max(1);
    }

    /// Events left out on purpose since the beginning.
    #[must_use]
    pub const fn thinned(&self) -> u64 {
        self.thinned
    }

    /// Length of one segment in microseconds.
    #[must_use]
    pub const fn segment_us(&self) -> u32 {
        self.segment_us
    }

    /// First instant after the segment that is being filled.
    #[must_use]
    pub const fn open_end_us(&self) -> u64 {
        self.start_us + (self.closed as u64 + 1) * self.segment_us as u64
    }

    /// Closed segments.
    #[must_use]
    pub const fn closed(&self) -> usize {
        self.closed
    }

    /// Whether the open segment is the last of the ring, so that closing it needs [`Self::drop_oldest`].
    #[must_use]
    pub const fn full(&self) -> bool {
        self.closed + 1 == SEGMENTS
    }

    const fn slot(&self, index: usize) -> usize {
        (self.first + index) % SEGMENTS
    }

    /// Takes in one event of the open segment. Cost: about 30 instructions, constant on average.
    pub fn push(&mut self, event: &Event) {
        let slot = self.slot(self.closed);
        let segment = &mut self.segments[slot];
        segment.counted += 1;
        if segment.skip > 0 {
            segment.skip -= 1;
            self.thinned += 1;
            return;
        }
        let base = slot * self.capacity;
        let octave = self.capacity / 16;
        let burst = BURST_SIXTEENTHS * octave;
        if segment.len == self.capacity {
            // Halve the reservoir: every other event goes, those kept stay evenly spread.
            let reservoir = &mut self.events[base + burst..base + self.capacity];
            let kept = reservoir.len() / 2;
            self.thinned += (segment.len - burst - kept) as u64;
            segment.len = burst + kept;
            segment.stride_log2 = (segment.stride_log2 + 1).min(MOST_WEIGHT_LOG2);
            for i in 0..kept {
                reservoir[i] = reservoir[2 * i].weighing(segment.stride_log2);
            }
        }
        let stride_log2 = match segment.len.checked_div(octave).unwrap_or(0) {
            0..DENSE_SIXTEENTHS => 0,
            sixteenth if sixteenth < BURST_SIXTEENTHS => (sixteenth - DENSE_SIXTEENTHS + 1) as u8,
            _ => segment.stride_log2,
        };
        if let Some(place) = self.events.get_mut(base + segment.len) {
            *place = StoredEvent::pack(event, stride_log2);
            segment.len += 1;
        }
        segment.skip = (1_u32 << stride_log2) - 1;
    }

    /// Counts events lost before they reached the store.
    pub fn lost(&mut self, count: u64) {
        let slot = self.slot(self.closed);
        self.segments[slot].lost = self.segments[slot].lost.saturating_add(count);
    }

    /// Makes segments longer, keeping what is stored: each new segment keeps the burst of the first old one in
    /// it, and of the rest every event that stands for as many as the new reservoir's stride says.
    /// `segment_us` is at least the length so far. Cost: two passes over the store.
    pub fn lengthen(&mut self, segment_us: u32) {
        let old: [Segment; SEGMENTS] = core::array::from_fn(|i| self.segments[self.slot(i)]);
        let old_us = u64::from(self.segment_us);
        let closed = (self.closed as u64 * old_us / u64::from(segment_us)) as usize;
        // Reading runs ahead of writing: new segments start no earlier than old ones and hold no more events.
        let (mut from, mut index) = (0, 0);
        for new in 0..=closed {
            let end_us = ((new as u64 + 1) * u64::from(segment_us)).min(i32::MAX as u64) as i32;
            let mut merged = self.plan_merge(&old, (from, index), end_us);
            let stride = 1_u64 << merged.stride_log2;
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
                    let in_burst = from == first && merged.len < self.burst();
                    let kept = in_burst || passed >= next;
                    if !in_burst {
                        passed += 1 << event.weight_log2();
                    }
                    if kept && merged.len < self.capacity {
                        if !in_burst {
                            next += stride;
                        }
                        let weight =
                            if in_burst { event.weight_log2() } else { merged.stride_log2 };
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
            for (i, segment) in old.iter().enumerate().take(self.closed + 1) {
                if (i as u64 * old_us) / u64::from(segment_us) == new as u64 {
                    merged.lost = merged.lost.saturating_add(segment.lost);
                    merged.roll_sum_rad_s += segment.roll_sum_rad_s;
                    merged.roll_count += segment.roll_count;
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
        old: &[Segment; SEGMENTS],
        (from, index): (usize, usize),
        end_us: i32,
    ) -> Segment {
        let mut weight = 0_u64;
        let mut stride_log2 = Segment::default().stride_log2;
        for (i, segment) in old.iter().enumerate().take(self.closed + 1).skip(from) {
            let source = self.slot(i) * self.capacity;
            let skipped = if i == from { index + self.burst() } else { 0 };
            for event in &self.events[source..source + segment.len][skipped.min(segment.len)..] {
                if event.since(self.start_us) >= end_us {
                    break;
                }
                weight += 1 << event.weight_log2();
                stride_log2 = stride_log2.max(event.weight_log2());
            }
        }
        let room = (self.capacity - self.burst()).max(1) as u64;
        while weight >> stride_log2 >= room && stride_log2 < MOST_WEIGHT_LOG2 {
            stride_log2 += 1;
        }
        Segment { stride_log2, ..Segment::default() }
    }

    /// Events of a segment that come before its reservoir.
    const fn burst(&self) -> usize {
        BURST_SIXTEENTHS * (self.capacity / 16)
    }

    /// Takes in the camera's roll rate, positive = the scene turns clockwise on the screen.
    pub fn roll(&mut self, roll_rad_s: f32) {
        let slot = self.slot(self.closed);
        self.segments[slot].roll_sum_rad_s += roll_rad_s;
        self.segments[slot].roll_count += 1;
    }

    /// Closes the open segment and opens the next. The ring must not be [`Self::full`].
    pub fn close_segment(&mut self) {
        debug_assert!(!self.full());
        self.closed += 1;
        let slot = self.slot(self.closed);
        self.segments[slot] = Segment::default();
    }

    /// Gives up the oldest closed segment.
    pub fn drop_oldest(&mut self) {
        if self.closed > 0 {
            self.first = self.slot(1);
            self.closed -= 1;
            self.start_us += u64::from(self.segment_us);
        }
    }

    /// The window over the oldest `segments` segments (the open one counts as the last when all closed
    /// ones are taken), no longer than to `end_us`.
    #[must_use]
    pub fn window(&self, segments: usize, end_us: u64) -> Window<'_> {
        let mut parts: [&[StoredEvent]; SEGMENTS] = [&[]; SEGMENTS];
        let segments = segments.min(self.closed + 1);
        for (index, part) in parts.iter_mut().enumerate().take(segments) {
            let slot = self.slot(index);
            let base = slot * self.capacity;
            *part = &self.events[base..base + self.segments[slot].len];
        }
        Window {
            parts,
            start_us: self.start_us,
            duration_us: (self.segment_us * segments as u32)
                .min(end_us.saturating_sub(self.start_us).min(u64::from(u32::MAX)) as u32),
            segments,
        }
    }

    /// Events counted, kept and lost in the oldest `segments` segments.
    #[must_use]
    pub fn account(&self, segments: usize) -> Account {
        let mut account = Account::default();
        for index in 0..segments.min(self.closed + 1) {
            let segment = &self.segments[self.slot(index)];
            account.counted += segment.counted;
            account.kept += segment.len as u64;
            account.lost = account.lost.saturating_add(segment.lost);
            account.roll_sum_rad_s += segment.roll_sum_rad_s;
            account.roll_count += segment.roll_count;
        }
        account
    }
}

/// Where the events of a window went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Account {
    /// Arrived.
    pub counted: u64,
    /// Stand in the store.
    pub kept: u64,
    /// Reported lost by the sensor or the link.
    pub lost: u64,
    /// Sum of the camera's roll rates.
    roll_sum_rad_s: f32,
    /// Number of roll rates.
    roll_count: u32,
}

impl Account {
    /// Mean roll rate of the camera in rad/s, where a gyro was heard.
    #[must_use]
    pub fn roll_rad_s(&self) -> Option<f32> {
        (self.roll_count > 0).then(|| self.roll_sum_rad_s / self.roll_count as f32)
    }
}

/// The stored events of a stretch of time, in time order.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    parts: [&'a [StoredEvent]; SEGMENTS],
    /// Sensor time at which the window starts, in microseconds.
    pub start_us: u64,
    /// Length in microseconds.
    pub duration_us: u32,
    segments: usize,
}

impl<'a> Window<'a> {
    /// All events, oldest first.
    pub fn events(&self) -> impl Iterator<Item = StoredEvent> + use<'a> {
        let parts = self.parts;
        parts.into_iter().take(self.segments).flat_map(|part| part.iter().copied())
    }

    /// Events that each stand for the same number of arrived ones, at most `most` of those for which `inside` gives a value,
    /// and how many of these are stored.
    ///
    /// The stored events are dense at the start of each segment; whoever looks for frequencies must not take
    /// that rhythm for one of the scene.
    pub fn even<T: Copy>(
        &self,
        most: usize,
        inside: impl Fn(StoredEvent) -> Option<T>,
    ) -> (usize, impl Iterator<Item = (StoredEvent, T)>) {
        let (mut count, mut weight, mut coarsest) = (0, 0_u64, 0);
        for event in self.events() {
            if inside(event).is_some() {
                count += 1;
                weight += 1 << event.weight_log2();
                coarsest = coarsest.max(event.weight_log2());
            }
        }
        // Fixed-point, so that any ratio thins evenly.
        let stride = ((weight << 8) / most.max(1) as u64 + 1).max(1 << (coarsest + 8));
        let (mut passed, mut next) = (0_u64, 0_u64);
        let even = self.events().filter_map(move |event| {
            let value = inside(event)?;
            let kept = passed >= next;
            passed += 1 << (event.weight_log2() + 8);
            if kept {
                next += stride;
            }
            kept.then_some((event, value))
        });
        (count, even)
    }

    /// Number of stored events.
    #[must_use]
    pub fn len(&self) -> usize {
        self.parts.iter().take(self.segments).map(|part| part.len()).sum()
    }

    /// Whether nothing is stored.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of segments.
    #[must_use]
    pub const fn segments(&self) -> usize {
        self.segments
    }

    /// The events of one segment: consecutive ones first, then ever sparser.
    #[must_use]
    pub fn segment(&self, segment: usize) -> &'a [StoredEvent] {
        self.parts.get(segment).copied().unwrap_or(&[])
    }

    /// Events with `from_us <= t < to_us`, both in microseconds since the window's start. O(log n).
    pub fn between(&self, from_us: i32, to_us: i32) -> impl Iterator<Item = StoredEvent> + use<'a> {
        let start_us = self.start_us;
        let parts = self.parts;
        parts.into_iter().take(self.segments).flat_map(move |part| {
            let from = part.partition_point(|event| event.since(start_us) < from_us);
            let to = part.partition_point(|event| event.since(start_us) < to_us);
            part[from..to.max(from)].iter().copied()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(t_us: u64) -> Event {
        Event { t_us, x: (t_us % 300) as u16, y: 7, polarity: Polarity::On }
    }

    fn fill(store: &mut Store<'_>, times: impl Iterator<Item = u64>) {
        for t_us in times {
            while t_us >= store.open_end_us() {
                store.close_segment();
            }
            store.push(&event(t_us));
        }
    }

    fn times(store: &Store<'_>) -> Vec<i32> {
        store.window(SEGMENTS, u64::MAX).events().map(|event| event.since(0)).collect()
    }

    #[test]
    fn a_segment_keeps_a_dense_burst_then_thins_evenly_and_counts_all() {
        let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
        let mut store = Store::new(&mut memory, 100_000);
        fill(&mut store, 0..5_000);
        let kept = times(&store);
        assert_eq!(&kept[..16], &(0..16).collect::<Vec<_>>()[..]);
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(kept.len() <= 64 && kept.len() > 44);
        assert!(*kept.last().unwrap_or(&0) > 4_500);
        let account = store.account(1);
        assert_eq!((account.counted, account.kept), (5_000, kept.len() as u64));
    }

    #[test]
    fn even_events_stand_for_the_same_number_each() {
        let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
        let mut store = Store::new(&mut memory, 10_000);
        fill(&mut store, 0..60_000);
        let kept: Vec<_> = store
            .window(6, u64::MAX)
            .even(100, |event| Some(event.since(0)))
            .1
            .map(|(_, t_us)| t_us)
            .collect();
        assert!(kept.len() > 80 && kept.len() <= 101, "{}", kept.len());
        // The reservoir itself comes in steps of 512, and begins anew behind each burst.
        let gaps: Vec<i32> = kept.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(gaps.iter().all(|gap| (1..=1_536).contains(gap)), "{gaps:?}");
        let first_half = kept.iter().filter(|t_us| **t_us < 30_000).count();
        assert!(first_half.abs_diff(kept.len() - first_half) <= 2);
    }

    #[test]
    fn lengthening_keeps_order_counts_and_the_first_burst() {
        let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
        let mut store = Store::new(&mut memory, 1_000);
        fill(&mut store, (0..6_500).step_by(3));
        let before = store.account(SEGMENTS);
        assert_eq!(store.closed(), 6);
        for segment_us in [2_000, 2_700, 5_400] {
            store.lengthen(segment_us);
            let kept = times(&store);
            assert!(kept.windows(2).all(|pair| pair[0] < pair[1]), "{kept:?}");
            assert_eq!(&kept[..4], &[0, 3, 6, 9]);
            assert!(*kept.last().unwrap_or(&0) > 6_000);
            assert_eq!(store.account(SEGMENTS).counted, before.counted);
        }
        assert_eq!(store.closed(), 1);
        fill(&mut store, 6_500..40_000);
        assert!(times(&store).windows(2).all(|pair| pair[0] < pair[1]));
    }
}

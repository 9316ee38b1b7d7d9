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
    y_polarity: u16,
}

/// Eighths of a segment that keep consecutive events.
const DENSE_EIGHTHS: usize = 2;
/// Eighths before the reservoir starts.
const BURST_EIGHTHS: usize = 5;

const POLARITY_BIT: u16 = 0x8000;

impl StoredEvent {
    fn pack(event: &Event) -> Self {
        let polarity = if event.polarity == Polarity::On { POLARITY_BIT } else { 0 };
        Self { t_us: event.t_us as u32, x: event.x, y_polarity: event.y | polarity }
    }

    /// Column in pixels.
    #[must_use]
    pub const fn x(self) -> u16 {
        self.x
    }

    /// Row in pixels.
    #[must_use]
    pub const fn y(self) -> u16 {
        self.y_polarity & !POLARITY_BIT
    }

    /// Whether the pixel became brighter.
    #[must_use]
    pub const fn is_on(self) -> bool {
        self.y_polarity & POLARITY_BIT != 0
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
    /// The reservoir keeps every 2^stride_log2-th event.
    stride_log2: u8,
    /// Events to pass over before the next is kept.
    skip: u32,
}

impl Default for Segment {
    fn default() -> Self {
        // Where the octaves end, the reservoir goes on as densely as the last of them.
        let stride_log2 = (BURST_EIGHTHS - DENSE_EIGHTHS) as u8;
        Self { len: 0, counted: 0, lost: 0, stride_log2, skip: 0 }
    }
}

/// Events of the recent past, in time order.
#[derive(Debug)]
pub struct Store<'m> {
    events: &'m mut [StoredEvent],
    /// Events in one segment: 2/8 dense, 3/8 in octaves, 3/8 reservoir.
    capacity: usize,
    segments: [Segment; SEGMENTS],
    /// Ring position of the oldest segment.
    first: usize,
    /// Closed segments.
    closed: usize,
    /// Start of the oldest segment.
    start_us: u64,
    segment_us: u32,
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
            return;
        }
        let base = slot * self.capacity;
        let octave = self.capacity / 8;
        let burst = BURST_EIGHTHS * octave;
        if segment.len == self.capacity {
            // Halve the reservoir: every other event goes, those kept stay evenly spread.
            let reservoir = &mut self.events[base + burst..base + self.capacity];
            let kept = reservoir.len() / 2;
            for i in 0..kept {
                reservoir[i] = reservoir[2 * i];
            }
            segment.len = burst + kept;
            segment.stride_log2 += 1;
        }
        if let Some(place) = self.events.get_mut(base + segment.len) {
            *place = StoredEvent::pack(event);
            segment.len += 1;
        }
        let stride_log2 = match segment.len.checked_div(octave).unwrap_or(0) {
            0..DENSE_EIGHTHS => 0,
            eighth if eighth < BURST_EIGHTHS => (eighth - DENSE_EIGHTHS + 1) as u8,
            _ => segment.stride_log2,
        };
        segment.skip = (1_u32 << stride_log2.min(31)) - 1;
    }

    /// Counts events lost before they reached the store.
    pub fn lost(&mut self, count: u64) {
        let slot = self.slot(self.closed);
        self.segments[slot].lost += count;
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
    /// ones are taken).
    #[must_use]
    pub fn window(&self, segments: usize) -> Window<'_> {
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
            duration_us: self.segment_us * segments as u32,
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
            account.lost += segment.lost;
        }
        account
    }
}

/// Where the events of a window went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Arrived.
    pub counted: u64,
    /// Stand in the store.
    pub kept: u64,
    /// Reported lost by the sensor or the link.
    pub lost: u64,
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
    pub fn between(
        &self,
        from_us: i32,
        to_us: i32,
    ) -> impl Iterator<Item = StoredEvent> + use<'a> {
        let start_us = self.start_us;
        let parts = self.parts;
        parts.into_iter().take(self.segments).flat_map(move |part| {
            let from = part.partition_point(|event| event.since(start_us) < from_us);
            let to = part.partition_point(|event| event.since(start_us) < to_us);
            part[from..to.max(from)].iter().copied()
        })
    }
}

//! The event store: a window of events in a fixed memory.
//!
//! Time is cut into segments of equal length; [`WINDOW_SEGMENTS`] of them are the window, which is held while it is measured, and
//! a few more take in events meanwhile; when these are full, they become half as many of twice the length, sparser than before,
//! so that what stands behind the window has no gap. A segment
//! keeps all its events until it is full; then every second one behind a dense burst of consecutive events goes, and so on as it
//! fills again. The burst (what a registration of
//! neighbouring slices needs) stays, and behind it one octave each time: every second, fourth and eighth event, so that
//! the baseline grows geometrically from the burst on; what is left of
//! its memory is a reservoir thinned evenly (what a long baseline needs): every 2^s-th event, s growing as
//! the reservoir fills. What is kept depends on the events and the capacity alone, never on when a task ran.

mod even;
mod event;
mod gyro;
mod hold;
mod lamp;
mod lengthen;
mod open;
mod roll;
mod window;

pub use even::Even;
pub(crate) use event::MOST_WEIGHT_LOG2;
pub use event::StoredEvent;
pub use roll::Roll;
pub use window::{Account, Window};

use crate::event::GyroSample;
use open::Segment;

/// Segments in a window.
pub const WINDOW_SEGMENTS: usize = 6;
/// Most segments filled while a window is measured.
pub const MOST_SPARE: usize = 4;
/// Most segments in the ring.
pub const MOST_SEGMENTS: usize = WINDOW_SEGMENTS + MOST_SPARE;

/// The oldest segments, so many, are being measured; those behind them may be longer.
#[derive(Clone, Copy, Debug, Default)]
struct Held {
    segments: usize,
    start_us: u64,
    segment_us: u32,
}

impl Held {
    const fn end_us(self) -> u64 {
        self.start_us + self.segments as u64 * self.segment_us as u64
    }
}

/// Events of the recent past, in time order.
#[derive(Debug)]
pub struct Store<'m> {
    events: &'m mut [StoredEvent],
    /// Events in one segment: 4/16 dense, 3/16 in octaves, 9/16 reservoir.
    capacity: usize,
    segments: [Segment; MOST_SEGMENTS],
    /// Where in the memory the segments lie, the oldest first.
    places: [u8; MOST_SEGMENTS],
    /// Segments in use.
    ring: usize,
    /// Closed segments.
    closed: usize,
    held: Held,
    /// Start of the oldest segment behind those that are held, and how long each of them is.
    start_us: u64,
    segment_us: u32,
    thinned: u64,
    /// Where the stream began.
    began_us: u64,
    /// A gyro sample of a time behind the open segment.
    ahead: Option<GyroSample>,
    /// The camera's roll in all segments that went by, and in those given up behind the ones that are measured.
    rolled: Roll,
    rolled_behind: Roll,
}

impl<'m> Store<'m> {
    /// An empty store over the lent memory, which is cut into a window and `spare` segments more, 2 to [`MOST_SPARE`];
    /// `segment_us` is at least 1.
    pub fn new(events: &'m mut [StoredEvent], spare: usize, segment_us: u32) -> Self {
        let ring = WINDOW_SEGMENTS + spare.clamp(2, MOST_SPARE);
        let capacity = events.len() / ring;
        Self {
            events,
            capacity,
            segments: [Segment::default(); MOST_SEGMENTS],
            places: core::array::from_fn(|place| place as u8),
            ring,
            closed: 0,
            held: Held::default(),
            start_us: 0,
            segment_us: segment_us.max(1),
            thinned: 0,
            began_us: 0,
            ahead: None,
            rolled: Roll::NONE,
            rolled_behind: Roll::NONE,
        }
    }

    /// Forgets everything; the next segment starts at `start_us`. Returns how many events went that no window had measured.
    pub fn restart(&mut self, start_us: u64, segment_us: u32) -> u64 {
        let unmeasured = (0..=self.closed).map(|index| self.forget(index)).sum();
        // What was lost since the last segment was closed was told before the event that begins this one.
        let lost = self.segments[self.slot(self.closed)].lost;
        self.segments = [Segment::default(); MOST_SEGMENTS];
        self.closed = 0;
        self.lost(lost);
        self.held = Held::default();
        self.start_us = start_us;
        self.began_us = start_us;
        self.segment_us = segment_us.max(1);
        self.ahead = None;
        self.rolled_behind = Roll::NONE;
        unmeasured
    }

    /// What no window has measured of a segment that goes: that many events were not used, and none of them were thinned.
    #[inline(never)]
    fn forget(&mut self, index: usize) -> u64 {
        let Segment { counted, len, unmeasured, .. } = self.segments[self.slot(index)];
        if unmeasured > 0 {
            self.thinned = self.thinned.saturating_sub(counted.saturating_sub(len as u64));
        }
        u64::from(unmeasured)
    }

    /// Events left out on purpose since the beginning.
    #[must_use]
    pub const fn thinned(&self) -> u64 {
        self.thinned
    }

    /// Length of one segment behind those that are held, in microseconds.
    #[must_use]
    pub const fn segment_us(&self) -> u32 {
        self.segment_us
    }

    /// Start of the oldest segment behind those that are held, in microseconds.
    #[must_use]
    pub const fn start_us(&self) -> u64 {
        self.start_us
    }

    /// First instant after the segment that is being filled.
    #[must_use]
    pub const fn open_end_us(&self) -> u64 {
        self.start_us + (self.closed + 1 - self.held.segments) as u64 * self.segment_us as u64
    }

    /// Closed segments.
    #[must_use]
    pub const fn closed(&self) -> usize {
        self.closed
    }

    /// Segments of the ring that are not held, the open one among them.
    #[must_use]
    pub const fn spare(&self) -> usize {
        self.ring - self.held.segments
    }

    /// Whether the open segment is the last of the ring, so that closing it needs [`Self::drop_oldest`], [`Self::lengthen`] or
    /// [`Self::give_up`].
    #[must_use]
    pub const fn full(&self) -> bool {
        self.closed + 1 == self.ring
    }

    const fn slot(&self, index: usize) -> usize {
        self.places[index] as usize
    }

    /// Counts events lost before they reached the store.
    pub fn lost(&mut self, count: u64) {
        let slot = self.slot(self.closed);
        self.segments[slot].lost = self.segments[slot].lost.saturating_add(count);
    }

    /// What a segment's gyro samples say, if it has any.
    #[inline(never)]
    fn roll_of(&self, index: usize) -> Roll {
        let Some(mean_rad_s) = self.segments[self.slot(index)].rates.mean_rad_s() else {
            return Roll::NONE;
        };
        let held = index < self.held.segments;
        Roll::at(mean_rad_s, if held { self.held.segment_us } else { self.segment_us })
    }

    /// Forgets what the gyro said: it is another one.
    pub const fn forget_roll(&mut self) {
        self.rolled = Roll::NONE;
    }

    /// Closes the open segment and opens the next. The ring must not be [`Self::full`].
    pub fn close_segment(&mut self) {
        debug_assert!(!self.full());
        let before = self.segments[self.slot(self.closed)];
        self.closed += 1;
        let slot = self.slot(self.closed);
        self.segments[slot] = Segment::after(&before, self.capacity);
        self.settle();
    }

    /// Moves on from the oldest closed segment. None is held.
    pub fn drop_oldest(&mut self) {
        if self.closed > 0 {
            self.forget_oldest();
            self.start_us += u64::from(self.segment_us);
        }
    }

    #[inline(never)]
    fn forget_oldest(&mut self) {
        self.rolled = self.rolled.and(self.roll_of(0));
        self.places[..self.ring].rotate_left(1);
        self.closed -= 1;
    }

    /// Gives up the oldest closed segment behind those that are held, and returns how many events went with it, each counted
    /// once, whatever it stands for.
    pub fn give_up(&mut self) -> u64 {
        let oldest = self.held.segments;
        if oldest >= self.closed {
            return 0;
        }
        let unmeasured = self.forget(oldest);
        self.rolled_behind = self.rolled_behind.and(self.roll_of(oldest));
        self.places[oldest..self.ring].rotate_left(1);
        self.closed -= 1;
        self.start_us += u64::from(self.segment_us);
        unmeasured
    }
}

#[cfg(test)]
mod tests;

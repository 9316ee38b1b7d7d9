//! What the store hands out: the events of a stretch of time, and where they went.

use super::gyro::Rates;
use super::{Held, MOST_SEGMENTS, Roll, Store, StoredEvent};

impl Store<'_> {
    /// The window over the oldest `segments` segments, or over as many of those that are held (the open one counts as the last when
    /// all closed ones are taken), no longer than to `end_us`.
    #[must_use]
    #[inline(never)]
    pub fn window(&self, segments: usize, end_us: u64) -> Window<'_> {
        let mut parts: [&[StoredEvent]; MOST_SEGMENTS] = [&[]; MOST_SEGMENTS];
        let segments = segments.min(self.closed + 1);
        for (index, part) in parts.iter_mut().enumerate().take(segments) {
            let slot = self.slot(index);
            let base = slot * self.capacity;
            *part = &self.events[base..base + self.segments[slot].len];
        }
        let Held { segments: held, .. } = self.held;
        let (start_us, segment_us) = if held > 0 {
            (self.held.start_us, self.held.segment_us)
        } else {
            (self.start_us, self.segment_us)
        };
        let duration_us = (segment_us * segments as u32)
            .min(end_us.saturating_sub(start_us).min(u64::from(u32::MAX)) as u32);
        let first = start_us == self.began_us;
        Window { parts, start_us, duration_us, segments, first, ignores_polarity: false }
    }

    /// Events counted, kept and lost in the oldest `segments` segments.
    #[must_use]
    pub fn account(&self, segments: usize) -> Account {
        let mut account = Account { rolled: self.rolled, ..Account::default() };
        for index in 0..segments.min(self.closed + 1) {
            let segment = &self.segments[self.slot(index)];
            account.counted += segment.counted;
            account.kept += segment.len as u64;
            account.lost = account.lost.saturating_add(segment.lost);
            account.rates = account.rates.and(segment.rates);
            account.rolled = account.rolled.and(self.roll_of(index));
        }
        account
    }
}

/// Share of events lost beyond which the rest is not trusted.
const MOST_LOST: f32 = 0.5;

/// Where the events of a window went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Account {
    /// Arrived.
    pub counted: u64,
    /// Stand in the store.
    pub kept: u64,
    /// Reported lost by the sensor or the link.
    pub lost: u64,
    rates: Rates,
    /// The camera's roll up to the end of the window, as far as it was heard.
    pub rolled: Roll,
}

impl Account {
    /// Whether so many were lost that the rest is not trusted.
    #[must_use]
    pub fn is_mostly_lost(&self) -> bool {
        self.lost as f32 > MOST_LOST * self.counted.saturating_add(self.lost) as f32
    }

    /// Mean roll rate of the camera in rad/s, where a gyro was heard.
    #[must_use]
    pub fn roll_rad_s(&self) -> Option<f32> {
        self.rates.mean_rad_s()
    }
}

/// The stored events of a stretch of time, in time order.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    parts: [&'a [StoredEvent]; MOST_SEGMENTS],
    /// Sensor time at which the window starts, in microseconds.
    pub start_us: u64,
    /// Length in microseconds.
    pub duration_us: u32,
    segments: usize,
    first: bool,
    /// Whether all events count as ON.
    pub ignores_polarity: bool,
}

impl<'a> Window<'a> {
    /// All events, oldest first.
    #[cfg(test)]
    pub fn events(&self) -> impl Iterator<Item = StoredEvent> + use<'a> {
        let parts = self.parts;
        parts.into_iter().take(self.segments).flat_map(|part| part.iter().copied())
    }

    /// Whether the stream, or what is left of it, begins with this window.
    #[must_use]
    pub const fn is_first(&self) -> bool {
        self.first
    }

    /// Whether one of its events counts as ON.
    #[inline]
    #[must_use]
    pub const fn is_on(&self, event: StoredEvent) -> bool {
        event.is_on() | self.ignores_polarity
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
        let holds = move |part: &&[StoredEvent]| match part {
            [first, .., last] => first.since(start_us) < to_us && last.since(start_us) >= from_us,
            _ => true,
        };
        // Most stretches lie within one segment: the others are not searched.
        parts.into_iter().take(self.segments).filter(holds).flat_map(move |part| {
            let from = part.partition_point(|event| event.since(start_us) < from_us);
            let to = part.partition_point(|event| event.since(start_us) < to_us);
            part[from..to.max(from)].iter().copied()
        })
    }
}

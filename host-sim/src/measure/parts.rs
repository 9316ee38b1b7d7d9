//! A recording, part by part.

use evtach_core::Event;

use super::{Capacity, Ties, Timeline};
use crate::recording::{Recording, RecordingError};

/// The events of a recording in parts, across none of which its clock is set back: whoever measures or plays one steps through it so.
///
/// [`Parts::next`] hands out the next part. Where it tells a time instead, the clock is set to it: the caller ends what came before, by
/// the timeline as it is, and begins anew with [`Parts::set_back_to`].
pub struct Parts<'a> {
    pub recording: &'a mut Recording,
    /// Lays the parts end to end.
    pub timeline: Timeline,
    /// Whether there may be more to read.
    pub more: bool,
    /// Events so far.
    pub events_read: u64,
    /// What the recording ends with, behind its last events.
    pub damage: Option<RecordingError>,
    ties: Option<Ties>,
    /// What was read, and how much of it was handed out.
    events: Vec<Event>,
    taken: usize,
    known_lost: u64,
}

impl<'a> Parts<'a> {
    pub fn of(recording: &'a mut Recording, capacity: Capacity) -> Self {
        Self {
            recording,
            timeline: Timeline::default(),
            more: true,
            events_read: 0,
            damage: None,
            ties: (capacity == Capacity::Full).then(Ties::default),
            events: Vec::new(),
            taken: 0,
            known_lost: 0,
        }
    }

    /// Whether all was handed out.
    pub const fn is_done(&self) -> bool {
        !self.more && self.taken == self.events.len()
    }

    /// Puts the next events in place of `part`. Where the clock is set back, there are none, and the time that it is set to is told.
    pub fn next(&mut self, part: &mut Vec<Event>) -> Option<u64> {
        if self.taken == self.events.len() {
            if self.recording.starts_anew() {
                self.timeline.start_anew();
            }
            self.read();
        }
        let rest = &self.events[self.taken..];
        let length = self.timeline.part(rest);
        part.clear();
        part.extend_from_slice(&rest[..length]);
        self.taken += length;
        rest.first().filter(|_| length == 0).map(|event| event.t_us)
    }

    /// Begins the next part. Tells whether a tachometer has to be told, too, as the times alone do not.
    pub fn set_back_to(&mut self, t_us: u64) -> bool {
        self.timeline.set_back_to(t_us)
    }

    /// Events that were told to be lost since this was asked last.
    pub const fn newly_lost(&mut self) -> u64 {
        let lost = self.recording.lost();
        let newly = lost.saturating_sub(self.known_lost);
        self.known_lost = lost;
        newly
    }

    fn read(&mut self) {
        self.events.clear();
        self.taken = 0;
        self.more = self.recording.read_chunk(&mut self.events).unwrap_or_else(|damage| {
            self.damage = Some(damage);
            false
        });
        self.events_read += self.events.len() as u64;
        if let Some(ties) = &mut self.ties {
            ties.order(&mut self.events, self.more && !self.recording.starts_anew());
        }
    }
}

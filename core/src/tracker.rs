//! Rotors over a series of readings: identity and what is known of them.

use heapless::Vec;

use crate::limits::MAX_ROTORS;
use crate::reading::{Reason, Status};
use crate::rotors::{Disc, Found};
use crate::speed::measurement::Outcome;

/// Readings that a rotor's letter is kept for after it was last seen.
const REMEMBERED: u8 = 20;

/// A rotor that was seen.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Identity: 0 is shown as "A".
    pub id: u8,
    /// Axis and speed when last seen.
    pub found: Found,
    /// Equal parts.
    pub parts: Option<u8>,
    /// Whether the parts are alike.
    pub alike: bool,
    /// How far its measurement got when it was last seen.
    status: Status,
    /// Readings since it was last seen; 0 = in the last one.
    missed: u8,
}

impl Known {
    /// Whether the last reading saw it.
    #[must_use]
    pub const fn is_seen(&self) -> bool {
        self.missed == 0
    }

    /// Whether the last reading saw it and could not tell its speed.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        self.is_seen() && self.status == Status::Refused(Reason::Ambiguous)
    }

    /// Whether the last reading locked it, so that it can be followed: what was only suspected is not.
    #[must_use]
    pub fn can_be_followed(&self) -> bool {
        self.is_seen() && self.status == Status::Locked
    }

    /// What is measured afresh where the last reading saw a rotor and this window has none in its place, even if a search misses
    /// it: by its parts, which keep step also where its speed is not known so well yet.
    #[must_use]
    pub fn afresh(&self) -> Option<Found> {
        let windings = self.parts.map_or(self.found.windings, u32::from);
        self.is_seen().then_some(Found { windings, ..self.found })
    }

    /// What is measured again in the very next window, search or not: a speed that was told must not come and go.
    #[must_use]
    pub fn told(&self) -> Option<Found> {
        self.afresh().filter(|_| self.status == Status::Coarse)
    }
}

/// The rotors seen so far.
#[derive(Debug, Default)]
pub struct Tracker {
    known: Vec<Known, MAX_ROTORS>,
}

impl Tracker {
    /// The rotors seen so far.
    #[must_use]
    pub fn known(&self) -> &[Known] {
        &self.known
    }

    /// Starts a new reading: whoever is not seen in it has been missed once more.
    pub fn start_reading(&mut self) {
        for known in &mut self.known {
            known.missed = known.missed.saturating_add(1);
        }
        self.known.retain(|known| known.missed <= REMEMBERED);
    }

    /// The letter of a rotor: that of the nearest known one within half a radius, else the first free.
    pub fn identify(&mut self, outcome: &Outcome) -> u8 {
        let disc = outcome.found.disc;
        let status = outcome.status;
        let near = |known: &Disc| {
            let reach = 0.5 * disc.radius_px.max(known.radius_px);
            disc.distance2(known) < reach * reach
        };
        let nearest =
            self.known.iter_mut().filter(|known| near(&known.found.disc)).min_by(|a, b| {
                disc.distance2(&a.found.disc).total_cmp(&disc.distance2(&b.found.disc))
            });
        if let Some(known) = nearest {
            known.found = outcome.found;
            known.parts = outcome.parts;
            known.alike = outcome.alike;
            known.status = status;
            known.missed = 0;
            return known.id;
        }
        let taken = |id: u8| self.known.iter().any(|known| known.id == id);
        let id = (0..=u8::MAX).find(|id| !taken(*id)).unwrap_or(u8::MAX);
        if self.known.is_full()
            && let Some(oldest) =
                self.known.iter().enumerate().max_by_key(|(_, k)| k.missed).map(|(i, _)| i)
        {
            self.known.swap_remove(oldest);
        }
        let (parts, alike) = (outcome.parts, outcome.alike);
        self.known.push(Known { id, found: outcome.found, parts, alike, status, missed: 0 }).ok();
        id
    }
}

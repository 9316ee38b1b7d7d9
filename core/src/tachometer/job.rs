//! The running measurement, step by step.

use heapless::Vec;

use super::rhythm::NEVER;
use super::{Job, Scratch, Suspect, Tachometer};
use crate::limits::MAX_SUSPECTS;
use crate::reading::{Reason, Status};
use crate::rotors::extraction::{Extraction, View};
use crate::rotors::{Disc, Found, Visits};
use crate::settings::Poll;
use crate::speed::measurement::{Measurement, Outcome};
use crate::tracker::Known;

impl Tachometer<'_> {
    /// Starts measuring the window over the oldest segments.
    pub(super) fn start(&mut self, segments: usize) {
        self.window_segments = segments;
        self.window_end_us = self.last_us + 1;
        if self.dark {
            self.job = Job::Darken(0, false);
        } else {
            self.look();
        }
    }

    /// Begins with what is known, or with a search.
    // Not inlined: flash is short.
    #[inline(never)]
    fn look(&mut self) {
        self.candidates.clear();
        self.outcomes.clear();
        self.too_fast = false;
        self.lost = false;
        self.searched = false;
        self.ignores_polarity = false;
        let known = self.tracker.known().iter().filter(|known| known.can_be_followed());
        for known in known {
            let followed = Some((known.parts, known.alike));
            self.candidates.push(Suspect { found: known.found, followed }).ok();
        }
        let only_follows = self.catching_up && !self.candidates.is_empty();
        let searches = self.until_search == 0 && !only_follows;
        let seen = self.tracker.known().iter().filter(|known| known.is_seen()).count();
        if self.candidates.is_empty() || searches && self.candidates.len() < seen {
            self.search_anew();
            return;
        }
        if searches {
            // What is locked is followed: measuring it afresh takes a PC twenty times as long.
            self.search_all();
            return;
        }
        for found in self.tracker.known().iter().filter_map(Known::told) {
            suspect(&mut self.candidates, found);
        }
        if only_follows {
            // What is searched for takes so long that there would be as much to catch up with again.
            self.measure_next(0);
            return;
        }
        if self.until_search != NEVER {
            self.until_search -= 1;
        }
        if self.rhythm.searches_beside() {
            // All of it, in parts: once a round is often enough to ask what moves there.
            self.searched = self.round.begins();
            self.search(Extraction::go_on(self.round));
        } else {
            self.measure_next(0);
        }
    }

    /// Searches the image outside of what was measured in this window.
    // Not inlined: flash is short.
    #[inline(never)]
    fn search_anew(&mut self) {
        self.candidates.clear();
        self.search_all();
    }

    // Nor this.
    #[inline(never)]
    fn search_all(&mut self) {
        self.until_search = self.rhythm.search_every;
        self.searched = true;
        self.search(Extraction::default());
    }

    /// Searches the image outside of what was measured, or is going to be.
    // Not inlined: flash is short.
    #[inline(never)]
    fn search(&mut self, mut extraction: Extraction) {
        self.scratch.ready_for_search();
        for known in &self.candidates {
            extraction.leave_out(known.found.disc);
        }
        for measured in self.outcomes.iter().filter(|o| o.status.reason().is_none()) {
            extraction.leave_out(measured.found.disc);
        }
        self.job = Job::Search(extraction);
    }

    /// Advances the measurement by at most `steps` steps, each of less than a million instructions with the device's memory (`evtach bench cost`).
    pub fn poll(&mut self, steps: u32) -> Poll {
        for _ in 0..steps {
            if self.window_segments == 0 {
                return Poll::Idle;
            }
            if self.step()
                && let Some(reading) = self.conclude()
            {
                return Poll::Ready(reading);
            }
        }
        Poll::Pending
    }

    /// One step of the running job; `true` once the window has been measured.
    fn step(&mut self) -> bool {
        if let Job::Darken(segment, found) = &mut self.job {
            let found = self.store.darken(*segment, self.lamp_hz) || *found;
            let next = *segment + 1;
            if next < self.window_segments {
                self.job = Job::Darken(next, found);
            } else if found || self.dark {
                self.dark = found;
                self.look();
            } else {
                self.all_measured();
            }
            return false;
        }
        let mut window = self.store.window(self.window_segments, self.window_end_us);
        match &mut self.job {
            Job::Idle | Job::Darken(..) => true,
            Job::Search(extraction) => {
                let grid = Visits::grid(self.settings.geometry, self.weights.len());
                let Some(weights) = self.weights.get_mut(..grid.len()) else { return true };
                let Scratch::Search { scratch, times } = self.scratch else { return true };
                let (times, polar) = match &mut self.more {
                    Some(more) => (&mut *more.times, &mut *more.track),
                    None => (times.as_mut_slice(), self.polar.as_mut_view()),
                };
                window.ignores_polarity = self.ignores_polarity;
                let mut view = View { window, grid, weights, times };
                if extraction.step(&mut view, polar, self.spectrum, scratch) {
                    self.too_fast = extraction.too_fast();
                    // A rotor that explains all in the first look leaves none for a lamp.
                    let lamp_hz = extraction.lamp_hz();
                    let none = extraction.candidates().is_empty() && !self.dark;
                    if lamp_hz > 0.0 || none {
                        self.lamp_hz = lamp_hz;
                    }
                    self.round = extraction.round();
                    for candidate in extraction.candidates() {
                        let found = Found::new(candidate, self.ignores_polarity);
                        suspect(&mut self.candidates, found);
                    }
                    // What a search missed this time comes last, where nothing else was measured in its place.
                    for found in self.tracker.known().iter().filter_map(Known::afresh) {
                        suspect(&mut self.candidates, found);
                    }
                    self.measure_next(0);
                }
                false
            }
            Job::Measure(index, measurement) => {
                let Scratch::Measure(bench) = self.scratch else { return true };
                let polar = match &mut self.more {
                    Some(more) => &mut *more.track,
                    None => self.polar.as_mut_view(),
                };
                let Some(candidate) = self.candidates.get(*index) else { return true };
                window.ignores_polarity = candidate.found.ignores_polarity;
                if !measurement.step(&window, &self.settings, polar, bench) {
                    return false;
                }
                let (index, mut outcome) = (*index, measurement.result());
                let rival = measurement.rival(window.ignores_polarity);
                outcome.found.ignores_polarity = window.ignores_polarity;
                if candidate.followed.is_some() && outcome.status != Status::Locked {
                    // The others are followed all the same.
                    self.lost = true;
                } else {
                    self.keep(outcome);
                }
                if let Some(rival) = rival {
                    suspect(&mut self.candidates, rival);
                }
                self.measure_next(index + 1);
                false
            }
        }
    }

    /// Keeps an outcome unless it says that nothing turns there.
    fn keep(&mut self, outcome: Outcome) {
        let refused = outcome.status.reason().is_some();
        if outcome.status == Status::Refused(Reason::NoRotation) || self.ignores_polarity && refused
        {
            return;
        }
        let rank = |outcome: &Outcome| match outcome.status {
            Status::Locked => 2,
            Status::Coarse => 1,
            Status::Refused(_) => 0,
        };
        let place = outcome.found.disc;
        let rival = self.outcomes.iter_mut().find(|o| o.found.disc.overlaps(&place));
        match rival {
            // The rotor that was measured stands, whatever else was thought to be in its place.
            Some(rival) if rank(&outcome) > rank(rival) => *rival = outcome,
            Some(_) => {}
            None => {
                self.outcomes.push(outcome).ok();
            }
        }
    }

    /// Starts measuring the next candidate from `index` on that no measured rotor overlaps; where none is left, what remains is to
    /// ask for a lamp, where nothing is locked, and to conclude, in steps of their own.
    fn measure_next(&mut self, index: usize) {
        let taken = |disc: &Disc| {
            // Nor is a part of a rotor that is too fast a rotor.
            let stands = |o: &&Outcome| {
                o.status.reason().is_none() || o.status == Status::Refused(Reason::TooFast)
            };
            self.outcomes.iter().filter(stands).any(|o| o.found.disc.overlaps(disc))
        };
        let next = (index..self.candidates.len()).find(|i| !taken(&self.candidates[*i].found.disc));
        let Some(next) = next else {
            let locked = self.outcomes.iter().any(|outcome| outcome.status == Status::Locked);
            if locked || self.dark || self.catching_up {
                self.all_measured();
            } else {
                // In this very window, without what a lamp makes, if there is one.
                self.job = Job::Darken(0, false);
            }
            return;
        };
        self.scratch.ready_for_measuring();
        let Suspect { found, followed } = self.candidates[next];
        let measurement = match followed {
            Some((parts, alike)) => Measurement::follow(&found, parts, alike),
            None => Measurement::new(&found, self.lamp_hz, self.dark),
        };
        self.job = Job::Measure(next, measurement);
    }

    /// Ends with what was measured, or searches once more.
    // Not inlined: flash is short.
    #[inline(never)]
    fn all_measured(&mut self) {
        let unsure = |o: &Outcome| o.status == Status::Refused(Reason::Ambiguous);
        let still_unsure = !self.ignores_polarity
            && self.outcomes.iter().any(unsure)
            && self.tracker.known().iter().any(Known::is_ambiguous);
        if (self.lost || still_unsure) && !self.catching_up {
            // In this very window, outside of what was not lost. Where nothing was, without polarity: before what is brighter
            // than the blades here and darker there, an edge changes its own on the way round.
            self.ignores_polarity = !core::mem::take(&mut self.lost);
            self.search_anew();
        } else {
            self.job = Job::Idle;
        }
    }
}

/// Enters what is to be measured, unless it stands there, while there is room.
// Not inlined: flash is short.
#[inline(never)]
fn suspect(suspects: &mut Vec<Suspect, MAX_SUSPECTS>, found: Found) {
    if suspects.iter().all(|known| known.found.disc != found.disc) {
        suspects.push(Suspect { found, followed: None }).ok();
    }
}

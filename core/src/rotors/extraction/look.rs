//! A look at what keeps step with a line: which rotation explains it.

use super::{Candidate, Extraction, For, LEAST_LAMP_HZ, Scratch, Stage, View};
use crate::limits::WINDING_PHASORS;
use crate::math::{TAU, TurnRate, sqrt};
use crate::rotors::belief::{LEAST_PHASORS, believe, inside};
use crate::rotors::coherence::{LocalGrid, Phasor};
use crate::rotors::disc::{Disc, Sifted, Sifting};
use crate::rotors::kmeans::{KMeans, nearest};
use crate::store::{Even, StoredEvent};

/// Half the side of a local map in radii of its disc.
const LOCAL_SHARE: f32 = 1.25;
/// A rotation that explains this share of the whole map makes k = 1.
const SHARE_OF_ONE: f32 = 0.75;
/// But where no more than this share of its disc is covered, its parts are asked first: of a disc around rotors that stand far apart
/// they cover no more, and what few cells show fits many a rotation.
const SPARSE: f32 = 0.2;
/// Events of a cell and polarity that a phase is taken from.
const EVENTS_A_PHASE: f32 = 8.0;
/// Largest side of a cell in radii: the phase of eight blades turns once in 0.8 radii at the rim.
const MOST_CELL_SHARE: f32 = 0.3;
/// Cells with a phase below which a disc in a quarter is also looked at event by event.
const FEW_PHASORS: usize = 32;

/// Whether what was found covers so little of its disc that it may be several rotors.
fn is_sparse(found: &Candidate) -> bool {
    found.cover < SPARSE
}

/// Whether what was found in the whole picture, or in a part of it, is one rotor for all that is known.
pub(super) fn is_one(found: &Candidate) -> bool {
    found.share >= SHARE_OF_ONE || !is_sparse(found)
}

impl Extraction {
    /// Fills the map of the line at hand.
    pub(super) fn map(&mut self, view: &mut View<'_>, scratch: &mut Scratch) {
        let Some(weights) = view.weights.get_mut(..self.grid.len()) else { return self.end() };
        if scratch.visits.map(self.line.hz, weights, view.times) {
            self.stage = Stage::Judge;
        }
    }

    pub(super) fn judge(&mut self, view: &mut View<'_>, scratch: &mut Scratch) {
        let weights = view.weights.get_mut(..self.grid.len()).unwrap_or_default();
        if !scratch.visits.judge(weights, self.reach) {
            self.reach += 1;
            scratch.visits.start_map();
            self.stage = Stage::Map;
            return;
        }
        self.stage = Stage::Seed;
    }

    /// Takes the map for one cluster.
    pub(super) fn seed(&mut self, view: &View<'_>) {
        let cells = self.cells(view);
        self.kmeans = KMeans::seed(cells);
        self.kmeans.sweep(cells);
        match Sifting::new(self.kmeans.clusters(), 0) {
            Some(sifting) => {
                self.sifting = sifting;
                self.stage = Stage::Around;
            }
            None => self.gathered(None),
        }
    }

    /// Looks where it lies.
    pub(super) fn around(&mut self, view: &View<'_>) {
        match self.sifting.step(self.cells(view), self.kmeans.clusters()) {
            Sifted::Running => {}
            Sifted::Nothing => self.gathered(None),
            Sifted::Disc(all) => self.gathered(Some(all)),
        }
    }

    /// Goes on with the disc that holds all of the map.
    pub(super) fn gathered(&mut self, all: Option<Disc>) {
        match (self.looked_for, all) {
            (For::Slow, all) => self.start_track(all.unwrap_or_default()),
            // Does one rotation explain it?
            (For::Fast, Some(all)) => self.look(For::Fast, all),
            (For::Fast, None) => self.stage = Stage::Fast,
            (_, Some(all)) => self.look(For::Whole, all),
            (_, None) => self.stage = Stage::Line,
        }
    }

    /// Starts to look for the rotation that explains a disc.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn look(&mut self, looked_for: For, disc: Disc) {
        self.looked_for = looked_for;
        self.disc = disc;
        self.events = 0;
        self.even = Even::default();
        self.stage = Stage::Size;
    }

    /// Side of the cells in which the disc is looked at: as small as the events let a cell and polarity have a phase, and no
    /// larger than what blades can be told apart with.
    pub(super) fn size(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let disc = self.disc;
        let inside = |event: StoredEvent| {
            let at = Disc { x_px: event.x().into(), y_px: event.y().into(), radius_px: 0.0 };
            (disc.distance2(&at) < disc.radius_px * disc.radius_px).then_some(())
        };
        if !self.even.step(&view.window, usize::MAX, inside, |_, ()| self.events += 1) {
            return;
        }
        let share = sqrt(TAU * EVENTS_A_PHASE / self.events.max(1) as f32);
        let cell_px = disc.radius_px * share.min(MOST_CELL_SHARE);
        let half_px = LOCAL_SHARE * disc.radius_px + self.grid.cell_px();
        self.local = LocalGrid::around(disc.x_px, disc.y_px, half_px, cell_px);
        scratch.coherence.clear();
        self.even = Even::default();
        self.stage = Stage::Fill;
    }

    pub(super) fn fill(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        if scratch.coherence.fill(&view.window, self.local, self.line.hz, &mut self.even) {
            self.stage = Stage::Collect;
        }
    }

    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn collect(&mut self, scratch: &mut Scratch) {
        let disc = self.disc;
        let mine = |p: &Phasor| {
            inside(p, &disc)
                && (self.looked_for != For::Part
                    || nearest(&self.best, p.x_px, p.y_px).0 == self.part)
        };
        let Scratch { coherence, explainer, .. } = scratch;
        explainer.start(coherence.phasors(self.local), mine, disc, self.local.cell_px());
        self.stage = match self.looked_for {
            For::Whole => Stage::Whole,
            For::Part => Stage::Part,
            For::Fast | For::Slow => Stage::Slow,
        };
    }

    /// Takes the events of the disc for phasors, one by one.
    pub(super) fn events(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let window = &view.window;
        let mid_us = (window.duration_us / 2) as i32;
        let rate = TurnRate::from_rad_s(self.line.hz * TAU);
        let disc = self.disc;
        let inside = |event: StoredEvent| {
            let at = Phasor { x_px: event.x().into(), y_px: event.y().into(), ..Phasor::default() };
            inside(&at, &disc).then_some(at)
        };
        let explainer = &mut scratch.explainer;
        let all = self.even.step(window, WINDING_PHASORS, inside, |event, at| {
            let (sin, cos) = rate.after(event.since(window.start_us) - mid_us).sin_cos();
            explainer.add(Phasor {
                re: cos,
                im: -sin,
                amplitude: 1.0,
                on: window.is_on(event),
                ..at
            });
        });
        if all {
            explainer.collected(self.even.count());
            self.stage = Stage::Whole;
        }
    }

    /// One step of the look for one rotation; k = 1 when it explains the whole map.
    pub(super) fn whole(&mut self, scratch: &mut Scratch) {
        if !scratch.explainer.step() {
            return;
        }
        let (region, _, _, winding) = scratch.explainer.result();
        let empty = region.len() < LEAST_PHASORS;
        let few = region.len() < FEW_PHASORS && scratch.explainer.cell_px().is_some();
        if self.quarter == 0 && winding.windings == 0 && winding.share > SHARE_OF_ONE && !empty {
            if self.lamp_hz == 0.0 && self.line.hz > LEAST_LAMP_HZ {
                self.lamp_hz = self.line.hz;
            }
            self.all_over.push(self.line.hz).ok();
        }
        self.whole = believe(&scratch.explainer, self.line.hz);
        if let Some(whole) = self.whole
            && (whole.share >= SHARE_OF_ONE && !is_sparse(&whole) || self.quarter > 0)
        {
            self.take(whole);
            self.stage = Stage::Visits;
            return;
        }
        if self.quarter > 0 && few {
            scratch.explainer.start_events(self.disc);
            self.even = Even::default();
            self.stage = Stage::Events;
            return;
        }
        if self.quarter > 0 {
            // Two in a quarter were told apart in the whole, or are in quarters of their own.
            self.stage = Stage::Line;
            return;
        }
        self.whole = self.whole.filter(is_one);
        self.k = 2;
        self.best.clear();
        self.best_index = f32::MAX;
        self.stage = Stage::Split;
    }
}

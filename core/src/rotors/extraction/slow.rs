//! What turns too slowly to pass anywhere twice, looked for in the middle of all that moves; and before that, what turns too fast to be followed.

use super::quarters::LEAST_COMPANY;
use super::{Extraction, For, Scratch, Stage, View};
use crate::rotors::belief::believe;
use crate::rotors::disc::Disc;
use crate::rotors::heat::CellGrid;
use crate::rotors::lines::{Line, Spectrum};
use crate::rotors::sweep::Sweep;
use crate::speed::polar::{PolarTrack, track};
use crate::store::Even;

/// Frequency in Hz above which blades are not followed.
const MOST_HZ: f32 = 2_500.0;
/// How far beside its centre a disc is swept from, in radii.
const BESIDE: f32 = 0.5;

impl Extraction {
    /// Where nothing passes anywhere twice, or all does so too fast to be seen, what turns slowly is looked for in the middle of
    /// all that moves.
    pub(super) fn moving(
        &mut self,
        view: &mut View<'_>,
        spectrum: &mut Spectrum,
        scratch: &mut Scratch,
    ) {
        let Some(filling) = &mut self.filling else {
            if self.grid.is_empty() {
                self.grid = view.grid;
            }
            return self.start_filling(view, scratch);
        };
        let View { window, times, .. } = view;
        if scratch.visits.fill(window, &[], filling, LEAST_COMPANY, times).is_none() {
            return;
        }
        self.filling = None;
        self.grid = scratch.visits.cells();
        self.looked_for = For::Fast;
        spectrum.clear();
        self.stage = Stage::Lags;
    }

    /// Takes up the next line of blades that would be too fast.
    pub(super) fn fast(&mut self, scratch: &mut Scratch) {
        self.stage = Stage::Heat;
        while let Some(line) = self.lines.pop() {
            if line.hz > MOST_HZ {
                self.line = line;
                self.reach = 1;
                scratch.visits.start_map();
                self.stage = Stage::Map;
                return;
            }
        }
    }

    pub(super) fn heat(&mut self, view: &mut View<'_>, scratch: &Scratch) {
        let weights = view.weights.get_mut(..self.grid.len()).unwrap_or_default();
        scratch.visits.heat(weights, view.times);
        self.looked_for = For::Slow;
        self.stage = Stage::Seed;
    }

    pub(super) fn start_track(&mut self, all: Disc) {
        self.swept = Some(all);
        // Seen from beside its centre: about the centre of n blades all harmonics but n and its multiples are silent.
        self.disc = Disc { x_px: all.x_px + BESIDE * all.radius_px, ..all };
        self.even = Even::default();
        self.stage = Stage::Track;
    }

    pub(super) fn track(&mut self, view: &View<'_>, polar: &mut PolarTrack) {
        if track(&view.window, self.disc, polar, &mut self.even) {
            self.sweeping = Sweep::default();
            self.stage = Stage::Sweep;
        }
    }

    pub(super) fn sweep(&mut self, view: &View<'_>, polar: &PolarTrack) {
        if self.sweeping.step(polar, view.window.duration_us) {
            self.lines.clear();
            for hz in core::mem::take(&mut self.sweeping).hz().into_iter().rev() {
                self.lines.push(Line { hz, sigmas: 0.0 }).ok();
            }
            self.next_slow();
        }
    }

    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn next_slow(&mut self) {
        let (Some(line), Some(disc)) = (self.lines.pop(), self.swept) else { return self.end() };
        self.line = line;
        self.look(For::Slow, disc);
    }

    /// One step of the look for the rotation of all that moves.
    pub(super) fn slow(&mut self, scratch: &mut Scratch) {
        if !scratch.explainer.step() {
            return;
        }
        let found = believe(&scratch.explainer, self.line.hz);
        let fast = self.looked_for == For::Fast;
        if let Some(found) = found.filter(|found| within(self.grid, found.disc)) {
            if fast {
                self.too_fast = true;
                return self.done();
            }
            self.enter(found);
        }
        if fast {
            self.stage = Stage::Fast;
        } else {
            self.next_slow();
        }
    }
}

/// Whether a disc lies within the picture. What turns once and over all of the picture is the camera.
fn within(grid: CellGrid, disc: Disc) -> bool {
    let (width_px, height_px) =
        (grid.columns as f32 * grid.cell_px(), grid.rows as f32 * grid.cell_px());
    let Disc { x_px, y_px, radius_px } = disc;
    x_px > radius_px
        && y_px > radius_px
        && x_px + radius_px < width_px
        && y_px + radius_px < height_px
}

//! Rotating objects extraction: from heat map and window to a list of discs that turn.
//!
//! 1. *Tiles*: K-means on the heat map cuts what is active into [`MAX_CLUSTERS`] tiles, whatever they hold.
//! 2. *Lines*: the spectrum of each tile shows the frequencies at which blades pass there.
//! 3. For each line the coherence map shows where events keep step with it, and K-means with the
//!    Davies-Bouldin index splits that map into rotors. The index does not exist for k = 1, the most
//!    common case; there the rule is: *if one rotation explains the whole map, it is one rotor*.
//!    Otherwise the k of the lowest index is taken, and each of its clusters must be explained by a rotation of
//!    its own (see [`super::winding`]).
//!
//! The paper clusters the heat map directly; ARCHITECTURE.md says where that fails and what this changes.

use heapless::Vec;

use super::coherence::{Coherence, Phasor};
use super::disc::{Disc, without_outliers};
use super::heat::{CellGrid, Cells};
use super::kmeans::{Cluster, KMeans, Seeding, davies_bouldin, nearest};
use super::winding::{Explainer, Winding};
use crate::limits::{COHERENCE_CELLS, MAX_CANDIDATES, MAX_CLUSTERS, MAX_LINES};
use crate::math::{TAU, sqrt};
use crate::speed::polar::{PolarTrack, track};
use crate::speed::scan::{Peak, Scanner};
use crate::store::Window;

/// How far beside its centre a tile is looked at from, in radii.
const BESIDE: f32 = 0.5;
/// Passes over the heat map, and the share of the highest weight that makes a cell hot: a rotor before a moving
/// background is hotter than all of that, but small.
const PASSES: u8 = 2;
const HOT_SHARE: f32 = 0.55;
/// Half the side of a local map in radii of its tile, and at least in pixels.
const LOCAL_SHARE: f32 = 1.6;
const LEAST_LOCAL_PX: f32 = 24.0;
/// Lines nearer to each other than this, in lines of the spectrum, are the same.
const SAME_LINE: f32 = 0.5;
/// Least share of its disc that a rotor's phasors cover: a mark on a rim sweeps a fifth.
const LEAST_COVER: f32 = 0.08;
/// Tiles with the same line nearer to each other than this, in sums of their radii, show the same rotor.
const SAME_PLACE: f32 = 2.0;
/// Power of a line over the mean of its spectrum below which it is noise.
const LEAST_LINE_POWER: f32 = 12.0;
/// Floor under the heat map, as a share of its reference.
const TILE_FLOOR: f32 = 0.08;
/// Floor under the coherence map.
const MAP_FLOOR: f32 = 0.1;
/// A rotation must explain this share of one cluster's phasors.
const LEAST_SHARE: f32 = 0.6;
/// A rotation that explains this share of the whole map makes k = 1.
const SHARE_OF_ONE: f32 = 0.75;
/// By how much it must explain more than "all in step" does.
const LEAST_LEAD: f32 = 0.2;
/// Fewest phasors that a rotation is believed on.
const LEAST_PHASORS: usize = 12;
/// Farthest axis from the disc's centre, in radii.
const MOST_OFF_CENTRE: f32 = 0.7;

/// A rotor as extraction sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Axis and radius.
    pub disc: Disc,
    /// Speed in rad/s, positive = clockwise on the screen; good to the resolution of the spectrum.
    pub omega_rad_s: f32,
    /// Angular harmonic of the line it was found by: a multiple of the blade count, or less with an odd blade.
    pub windings: u32,
    /// Frequency of that line in Hz.
    pub line_hz: f32,
    /// Share of the coherence map it explains.
    pub share: f32,
    /// Events in step that it explains.
    pub explained: f32,
}

/// A line of the spectrum and the tile it was seen in.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    line_hz: f32,
    power: f32,
    tile: Disc,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    Seed,
    Tiles,
    Spectrum,
    Map,
    Whole,
    Split,
    Part,
    Local,
    Done,
}

/// An extraction in progress.
#[derive(Debug, Default)]
pub struct Extraction {
    stage: Stage,
    kmeans: KMeans,
    tile: usize,
    /// Pass over the heat map: hot cells first, then all.
    pass: u8,
    tile_disc: Disc,
    lines: Vec<Line, MAX_LINES>,
    line: usize,
    /// Grid of the map at hand.
    grid: CellGrid,
    /// Whether that is the map of one tile.
    local: bool,
    k: usize,
    /// Cluster at hand.
    part: usize,
    /// Clustering with the lowest index so far.
    best_index: f32,
    best: Vec<Cluster, MAX_CLUSTERS>,
    /// Rotors by every line: the same one may stand here by several of its lines.
    candidates: Vec<Found, MAX_CANDIDATES>,
    in_step_hz: Option<f32>,
}

/// Memory that an extraction works in.
#[derive(Debug)]
pub struct Scratch {
    /// Map of one line.
    pub coherence: Coherence,
    /// Its heat.
    pub map: [u16; COHERENCE_CELLS],
    /// Its weights.
    pub map_weights: [u8; COHERENCE_CELLS],
    /// The search for a rotation that explains it.
    pub explainer: Explainer,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            coherence: Coherence::default(),
            map: [0; COHERENCE_CELLS],
            map_weights: [0; COHERENCE_CELLS],
            explainer: Explainer::default(),
        }
    }
}

/// What an extraction looks at.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The stored events.
    pub window: Window<'a>,
    /// Grid of the heat map.
    pub grid: CellGrid,
    /// Grid of the coherence map.
    pub map_grid: CellGrid,
    /// Weights of the heat map, see [`weigh_heat`].
    pub weights: &'a [u8],
}

impl Extraction {
    /// Starts over.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// One bounded piece of work; `true` once [`Self::candidates`] stand.
    pub fn step(
        &mut self,
        view: &View<'_>,
        track: &mut PolarTrack,
        scanner: &mut Scanner,
        scratch: &mut Scratch,
    ) -> bool {
        match self.stage {
            Stage::Seed => {
                let cells = self.cells(view);
                self.kmeans = KMeans::seed(cells, MAX_CLUSTERS, Seeding::FarthestNearest);
                self.stage = Stage::Tiles;
            }
            Stage::Tiles => {
                if self.kmeans.sweep(self.cells(view)) {
                    self.tile = 0;
                    self.stage = Stage::Spectrum;
                    self.start_tile(view, track, scanner);
                }
            }
            Stage::Spectrum => self.spectrum(view, track, scanner),
            Stage::Map => self.map(view, scratch),
            Stage::Whole => self.whole(scratch),
            Stage::Split => self.split(scratch),
            Stage::Part => self.part(scratch),
            Stage::Local => self.local(view, scratch),
            Stage::Done => {}
        }
        self.stage == Stage::Done
    }

    /// Name of the stage that the next step belongs to.
    #[must_use]
    pub const fn stage(&self) -> &'static str {
        match self.stage {
            Stage::Seed | Stage::Tiles => "tiles",
            Stage::Spectrum => "spectrum",
            Stage::Map => "map",
            Stage::Whole | Stage::Part => "winding",
            Stage::Split => "split",
            Stage::Local => "local map",
            Stage::Done => "done",
        }
    }

    /// Rotors by every line, those that explain most events first: whoever takes one leaves out those that
    /// overlap it.
    #[must_use]
    pub fn candidates(&self) -> &[Found] {
        &self.candidates
    }

    /// Frequency in Hz of the strongest line that was in step all over: a lamp.
    #[must_use]
    pub const fn in_step_hz(&self) -> Option<f32> {
        self.in_step_hz
    }

    fn start_tile(&mut self, view: &View<'_>, polar: &mut PolarTrack, scanner: &mut Scanner) {
        scanner.restart();
        polar.clear();
        let tile = without_outliers(self.cells(view), self.kmeans.clusters(), self.tile);
        self.tile_disc = tile.unwrap_or_default();
        if let Some(Disc { x_px, y_px, radius_px }) = tile {
            // Seen from beside its centre: about the centre of n blades all harmonics but n and its multiples are
            // silent, and n may be higher than what is looked at.
            let beside = Disc { x_px: x_px + BESIDE * radius_px, y_px, radius_px };
            track(&view.window, beside, polar);
        }
    }

    /// The cells of the heat map that this pass tiles.
    fn cells<'a>(&self, view: &View<'a>) -> Cells<'a> {
        let top = view.weights.iter().copied().max().unwrap_or(0);
        let floor = if self.pass == 0 { (f32::from(top) * HOT_SHARE) as u8 } else { 0 };
        Cells { grid: view.grid, weights: view.weights, floor }
    }

    fn spectrum(&mut self, view: &View<'_>, track: &mut PolarTrack, scanner: &mut Scanner) {
        if self.tile >= self.kmeans.clusters().len() {
            self.pass += 1;
            self.stage = if self.pass < PASSES { Stage::Seed } else { Stage::Map };
            self.lines.sort_unstable_by(|a, b| b.power.total_cmp(&a.power));
            return;
        }
        let window_us = view.window.duration_us;
        if scanner.step(track, window_us) {
            for peak in scanner.peaks() {
                self.add_line(*peak, SAME_LINE * 1e6 / window_us as f32);
            }
            self.tile += 1;
            self.start_tile(view, track, scanner);
        }
    }

    fn add_line(&mut self, peak: Peak, width_hz: f32) {
        if peak.power < LEAST_LINE_POWER {
            return;
        }
        let new = Line { line_hz: peak.line_hz.abs(), power: peak.power, tile: self.tile_disc };
        let known = |line: &&mut Line| {
            let reach_px = SAME_PLACE * (line.tile.radius_px + new.tile.radius_px);
            (line.line_hz - new.line_hz).abs() < width_hz
                && line.tile.distance2(&new.tile) < reach_px * reach_px
        };
        if let Some(line) = self.lines.iter_mut().find(known) {
            if new.power > line.power {
                *line = new;
            }
        } else if let Err(new) = self.lines.push(new)
            && let Some(least) = self.lines.iter_mut().min_by(|a, b| a.power.total_cmp(&b.power))
            && new.power > least.power
        {
            *least = new;
        }
    }

    /// Whether a rotor that was found well explains the line of this tile as one of its multiples.
    fn explained(&self, line: &Line, width_hz: f32) -> bool {
        self.candidates.iter().filter(|found| found.share >= SHARE_OF_ONE).any(|found| {
            let turns_hz = found.omega_rad_s.abs() / TAU;
            let ratio = line.line_hz / turns_hz.max(1e-3);
            // The rotor's own speed is known to a line over its windings.
            let slack_hz = width_hz * (1.0 + ratio / found.windings.max(1) as f32);
            let off_hz = (ratio - libm::roundf(ratio)).abs() * turns_hz;
            let away2 = found.disc.distance2(&line.tile);
            off_hz < slack_hz.min(0.25 * turns_hz)
                && away2 < found.disc.radius_px * found.disc.radius_px
        })
    }

    /// The next line, unless it has been looked into over the whole image: then its tile alone is left.
    fn next_line(&mut self, view: &View<'_>) -> Option<Line> {
        let width_hz = SAME_LINE * 1e6 / view.window.duration_us as f32;
        let mut line = *self.lines.get(self.line)?;
        while self.explained(&line, width_hz) {
            self.line += 1;
            line = *self.lines.get(self.line)?;
        }
        let seen =
            self.lines[..self.line].iter().any(|l| (l.line_hz - line.line_hz).abs() < width_hz);
        if seen {
            self.stage = Stage::Local;
        }
        Some(line)
    }

    /// Fills the map of the next line and asks whether one rotation explains it all.
    fn map(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let Some(line) = self.next_line(view) else {
            // A piece of a rotor, or a rotor by the line of its neighbour, explains fewer events than the rotor by
            // its own line.
            self.candidates.sort_unstable_by(|a, b| b.explained.total_cmp(&a.explained));
            self.stage = Stage::Done;
            return;
        };
        if self.stage == Stage::Local {
            return;
        }
        self.local = false;
        self.fill(view, line.line_hz, view.map_grid, scratch);
    }

    /// Fills a map and starts to look for one rotation that explains all of it.
    fn fill(&mut self, view: &View<'_>, line_hz: f32, grid: CellGrid, scratch: &mut Scratch) {
        self.grid = grid;
        scratch.coherence.fill(&view.window, grid, line_hz);
        let size = grid.len().min(COHERENCE_CELLS);
        scratch.coherence.heat(grid, &mut scratch.map[..size]);
        weigh(&scratch.map[..size], MAP_FLOOR, &mut scratch.map_weights[..size]);
        let cells = self.map_cells(scratch);
        let mut one = KMeans::seed(cells, 1, Seeding::FarthestMean);
        one.sweep(cells);
        let all = without_outliers(cells, one.clusters(), 0).unwrap_or_default();
        scratch.explainer.start(scratch.coherence.phasors(grid), |p| inside(p, &all), all);
        self.stage = Stage::Whole;
    }

    fn map_cells<'a>(&self, scratch: &'a Scratch) -> Cells<'a> {
        let size = self.grid.len().min(COHERENCE_CELLS);
        Cells { grid: self.grid, weights: &scratch.map_weights[..size], floor: 0 }
    }

    fn line_hz(&self) -> f32 {
        self.lines.get(self.line).map_or(0.0, |line| line.line_hz)
    }

    /// One step of the look for one rotation; k = 1 when it explains the whole map.
    fn whole(&mut self, scratch: &mut Scratch) {
        if !scratch.explainer.step() {
            return;
        }
        let line_hz = self.line_hz();
        let (region, _, _, winding) = scratch.explainer.result();
        let empty = region.len() < LEAST_PHASORS;
        if winding.windings == 0 && winding.share > SHARE_OF_ONE && !empty {
            self.in_step_hz = self.in_step_hz.or(Some(line_hz));
        }
        let whole = believe(&scratch.explainer, line_hz, self.grid);
        if let Some(whole) = whole {
            self.enter(whole);
        }
        if self.local {
            self.end_line();
        } else if empty || whole.is_some_and(|whole| whole.share >= SHARE_OF_ONE) {
            self.stage = Stage::Local;
        } else {
            self.k = 2;
            self.best.clear();
            self.best_index = f32::MAX;
            self.stage = Stage::Split;
        }
    }

    /// Splits the map into k clusters and keeps the clustering of the best index.
    fn split(&mut self, scratch: &mut Scratch) {
        let cells = self.map_cells(scratch);
        for seeding in [Seeding::FarthestMean, Seeding::FarthestNearest] {
            let mut kmeans = KMeans::seed(cells, self.k, seeding);
            while !kmeans.sweep(cells) {}
            let index = davies_bouldin(cells, kmeans.clusters());
            if let Some(index) = index.filter(|index| *index < self.best_index) {
                self.best_index = index;
                self.best.clear();
                self.best.extend_from_slice(kmeans.clusters()).ok();
            }
        }
        self.k += 1;
        if self.k > MAX_CLUSTERS {
            self.part = 0;
            self.start_part(scratch);
        }
    }

    /// Starts to look for the rotation that explains the next cluster.
    fn start_part(&mut self, scratch: &mut Scratch) {
        self.stage = Stage::Local;
        while self.part < self.best.len() {
            let cells = self.map_cells(scratch);
            if let Some(part) = without_outliers(cells, &self.best, self.part) {
                let mine = |p: &Phasor| {
                    inside(p, &part) && nearest(&self.best, p.x_px, p.y_px).0 == self.part
                };
                scratch.explainer.start(scratch.coherence.phasors(self.grid), mine, part);
                self.stage = Stage::Part;
                return;
            }
            self.part += 1;
        }
    }

    /// One step of the look for the rotation of one cluster.
    fn part(&mut self, scratch: &mut Scratch) {
        if scratch.explainer.step() {
            if let Some(one) = believe(&scratch.explainer, self.line_hz(), self.grid) {
                self.enter(one);
            }
            self.part += 1;
            self.start_part(scratch);
        }
    }

    /// Looks at the line's tile alone in finer cells, unless a rotor is known there: a small rotor of many blades
    /// turns its phase over less than a cell of the whole image.
    fn local(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let line = self.lines.get(self.line).copied().unwrap_or_default();
        let Disc { x_px, y_px, radius_px } = line.tile;
        let half_px = (LOCAL_SHARE * radius_px).max(LEAST_LOCAL_PX);
        let grid = CellGrid::around(x_px, y_px, half_px, COHERENCE_CELLS);
        let known = self.candidates.iter().any(|found| found.disc.overlaps(&line.tile));
        if known || grid.cell_log2 >= view.map_grid.cell_log2 {
            self.end_line();
        } else {
            self.local = true;
            self.fill(view, line.line_hz, grid, scratch);
        }
    }

    fn end_line(&mut self) {
        self.line += 1;
        self.stage = Stage::Map;
    }

    /// Enters a candidate; when the list is full, in place of the one that explains least.
    fn enter(&mut self, candidate: Found) {
        if let Err(candidate) = self.candidates.push(candidate)
            && let Some(least) =
                self.candidates.iter_mut().min_by(|a, b| a.explained.total_cmp(&b.explained))
            && candidate.explained > least.explained
        {
            *least = candidate;
        }
    }
}

fn inside(phasor: &Phasor, part: &Disc) -> bool {
    let (dx, dy) = (phasor.x_px - part.x_px, phasor.y_px - part.y_px);
    let reach = 1.2 * part.radius_px;
    dx * dx + dy * dy < reach * reach
}

/// A rotor, when the winding is one to be believed.
fn believe(explainer: &Explainer, line_hz: f32, grid: CellGrid) -> Option<Found> {
    let (region, total, part, winding) = explainer.result();
    let Winding { share, share_in_step, windings, .. } = winding;
    let thinned = total as f32 / region.len().max(1) as f32;
    let axis = Disc { x_px: winding.x_px, y_px: winding.y_px, radius_px: 0.0 };
    let off_centre = MOST_OFF_CENTRE * part.radius_px;
    let believed = windings != 0
        && region.len() >= LEAST_PHASORS
        && share >= LEAST_SHARE
        && share - share_in_step >= LEAST_LEAD
        && part.distance2(&axis) <= off_centre * off_centre;
    let radius_px = rim(region, &axis);
    let cell_px = grid.cell_px();
    // Both polarities of a cell are phasors of their own.
    let covered_px2 = 0.5 * total as f32 * cell_px * cell_px;
    let disc_px2 = core::f32::consts::PI * radius_px * radius_px;
    (believed && covered_px2 > LEAST_COVER * disc_px2).then(|| Found {
        disc: Disc { radius_px, ..axis },
        omega_rad_s: line_hz * TAU / windings as f32,
        windings: windings.unsigned_abs(),
        line_hz,
        share,
        explained: share * region.iter().map(|p| p.amplitude).sum::<f32>() * thinned,
    })
}

/// Distance from the axis within which 95 % of the events in step lie.
fn rim(region: &[Phasor], axis: &Disc) -> f32 {
    let distance = |phasor: &Phasor| {
        let (dx, dy) = (phasor.x_px - axis.x_px, phasor.y_px - axis.y_px);
        sqrt(dx * dx + dy * dy)
    };
    let total: f32 = region.iter().map(|p| p.amplitude).sum();
    let (mut low, mut high) = (0.0_f32, 2048.0_f32);
    // Bisection instead of a sort: the region is not ours to reorder.
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        let within: f32 =
            region.iter().filter(|p| distance(p) <= middle).map(|p| p.amplitude).sum();
        if within < 0.95 * total { low = middle } else { high = middle }
    }
    high
}

/// A cell that holds fewer events than this is noise.
const LEAST_COUNT: u16 = 4;
/// The reference heat is this quantile of the cells in use.
const REFERENCE_QUANTILE: f32 = 0.9;

/// Turns counts into weights: zero below `floor` of the reference heat, else the square root of the heat, so that a
/// rotor ten times slower than its neighbour still weighs a third.
pub fn weigh(counts: &[u16], floor: f32, weights: &mut [u8]) {
    let reference = reference_heat(counts);
    let least = ((floor * reference) as u16).max(LEAST_COUNT);
    for (weight, count) in weights.iter_mut().zip(counts) {
        let level = sqrt(f32::from(*count) / reference.max(1.0));
        *weight = if *count < least { 0 } else { (level * 100.0).clamp(1.0, 255.0) as u8 };
    }
}

/// The 90 % quantile of the cells in use, to within an eighth.
fn reference_heat(counts: &[u16]) -> f32 {
    // Classes of an eighth of an octave: 16 octaves x 8.
    let mut classes = [0_u16; 128];
    let mut used = 0_u32;
    for count in counts.iter().filter(|count| **count >= LEAST_COUNT) {
        let octave = 15 - count.leading_zeros() as usize;
        let eighth = ((usize::from(*count) << 3) >> octave) & 7;
        let class = &mut classes[octave * 8 + eighth];
        *class = class.saturating_add(1);
        used += 1;
    }
    let mut below = 0_u32;
    for (class, cells) in classes.iter().enumerate() {
        below += u32::from(*cells);
        if below as f32 >= REFERENCE_QUANTILE * used as f32 && below > 0 {
            return (1_u32 << (class / 8)) as f32 * (1.0 + (class % 8) as f32 / 8.0);
        }
    }
    0.0
}

/// Weights of the heat map for [`View::weights`].
pub fn weigh_heat(counts: &[u16], weights: &mut [u8]) {
    weigh(counts, TILE_FLOOR, weights);
}

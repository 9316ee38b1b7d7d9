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
use super::disc::{Candidate, Disc, candidate};
use super::heat::CellGrid;
use super::kmeans::{Cluster, KMeans, Seeding, davies_bouldin, nearest};
use super::winding::{Winding, collect, explain};
use crate::limits::{COHERENCE_CELLS, MAX_CANDIDATES, MAX_CLUSTERS, MAX_LINES};
use crate::math::{TAU, sqrt};
use crate::speed::polar::{PolarTrack, track};
use crate::speed::scan::{Peak, Scanner};
use crate::store::Window;

/// Angular harmonics in the spectrum of a tile.
const TILE_HARMONICS: u32 = 3;
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
    /// Share of the coherence map it explains.
    pub share: f32,
    /// Events in step that it explains.
    pub explained: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    Weigh,
    Tiles,
    Spectrum,
    Map,
    Split,
    Done,
}

/// An extraction in progress.
#[derive(Debug, Default)]
pub struct Extraction {
    stage: Stage,
    kmeans: KMeans,
    tile: usize,
    lines: Vec<Peak, MAX_LINES>,
    line: usize,
    k: usize,
    /// Clustering with the lowest index so far.
    best_index: f32,
    best: Vec<Cluster, MAX_CLUSTERS>,
    /// What one rotation explains of the whole map.
    whole: Option<Found>,
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
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            coherence: Coherence::default(),
            map: [0; COHERENCE_CELLS],
            map_weights: [0; COHERENCE_CELLS],
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
            Stage::Weigh => {
                self.kmeans =
                    KMeans::seed(view.grid, view.weights, MAX_CLUSTERS, Seeding::FarthestNearest);
                self.stage = Stage::Tiles;
            }
            Stage::Tiles => {
                if self.kmeans.sweep(view.grid, view.weights) {
                    self.stage = Stage::Spectrum;
                    self.start_tile(view, track, scanner);
                }
            }
            Stage::Spectrum => self.spectrum(view, track, scanner),
            Stage::Map => self.map(view, scratch),
            Stage::Split => self.split(view, scratch),
            Stage::Done => {}
        }
        self.stage == Stage::Done
    }

    /// Name of the stage that the next step belongs to.
    #[must_use]
    pub const fn stage(&self) -> &'static str {
        match self.stage {
            Stage::Weigh | Stage::Tiles => "tiles",
            Stage::Spectrum => "spectrum",
            Stage::Map => "map",
            Stage::Split => "split",
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
        let clusters = self.kmeans.clusters();
        if let Some(tile) = candidate(view.grid, view.weights, clusters, self.tile) {
            track(&view.window, tile.disc, polar);
        }
    }

    fn spectrum(&mut self, view: &View<'_>, track: &mut PolarTrack, scanner: &mut Scanner) {
        if self.tile >= self.kmeans.clusters().len() {
            self.lines.sort_unstable_by(|a, b| b.power.total_cmp(&a.power));
            self.stage = Stage::Map;
            return;
        }
        let window_us = view.window.duration_us;
        scanner.step(track, window_us);
        if scanner.harmonic() >= TILE_HARMONICS {
            for peak in scanner.peaks() {
                self.add_line(*peak, 1.5e6 / window_us as f32);
            }
            self.tile += 1;
            self.start_tile(view, track, scanner);
        }
    }

    fn add_line(&mut self, peak: Peak, width_hz: f32) {
        if peak.power < LEAST_LINE_POWER {
            return;
        }
        let peak = Peak { line_hz: peak.line_hz.abs(), ..peak };
        let known = |line: &&mut Peak| (line.line_hz - peak.line_hz).abs() < width_hz;
        if let Some(line) = self.lines.iter_mut().find(known) {
            if peak.power > line.power {
                *line = peak;
            }
        } else if let Err(peak) = self.lines.push(peak)
            && let Some(least) = self.lines.iter_mut().min_by(|a, b| a.power.total_cmp(&b.power))
            && peak.power > least.power
        {
            *least = peak;
        }
    }

    /// Fills the map of the next line and asks whether one rotation explains it all.
    fn map(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let Some(line) = self.lines.get(self.line) else {
            // A piece of a rotor, or a rotor by the line of its neighbour, explains fewer events than the rotor by
            // its own line.
            self.candidates.sort_unstable_by(|a, b| b.explained.total_cmp(&a.explained));
            self.stage = Stage::Done;
            return;
        };
        let line_hz = line.line_hz;
        let grid = view.map_grid;
        scratch.coherence.fill(&view.window, grid, line_hz);
        let map = &mut scratch.map[..grid.len().min(COHERENCE_CELLS)];
        scratch.coherence.heat(grid, map);
        let weights = &mut scratch.map_weights[..map.len()];
        weigh(map, MAP_FLOOR, weights);
        let mut one = KMeans::seed(grid, weights, 1, Seeding::FarthestMean);
        one.sweep(grid, weights);
        self.whole = None;
        self.best.clear();
        self.best_index = f32::MAX;
        let phasors = || scratch.coherence.phasors(grid);
        if let Some(all) = candidate(grid, weights, one.clusters(), 0)
            && phasors().count() >= LEAST_PHASORS
        {
            let (region, total) = collect(phasors(), |p| inside(p, &all));
            let winding = explain(&region, all.disc);
            if winding.windings == 0 && winding.share > SHARE_OF_ONE {
                self.in_step_hz = self.in_step_hz.or(Some(line_hz));
            }
            self.whole = believe(&winding, (&region, total), &all, line_hz);
        } else {
            self.line += 1;
            return;
        }
        if let Some(whole) = self.whole.filter(|whole| whole.share >= SHARE_OF_ONE) {
            self.enter(whole);
            self.line += 1;
        } else {
            self.k = 2;
            self.stage = Stage::Split;
        }
    }

    /// Splits the map into k clusters; after the last k, takes those of the best index that turn.
    fn split(&mut self, view: &View<'_>, scratch: &Scratch) {
        let grid = view.map_grid;
        let weights = &scratch.map_weights[..grid.len().min(COHERENCE_CELLS)];
        for seeding in [Seeding::FarthestMean, Seeding::FarthestNearest] {
            let mut kmeans = KMeans::seed(grid, weights, self.k, seeding);
            while !kmeans.sweep(grid, weights) {}
            let index = davies_bouldin(grid, weights, kmeans.clusters());
            if let Some(index) = index.filter(|index| *index < self.best_index) {
                self.best_index = index;
                self.best.clear();
                self.best.extend_from_slice(kmeans.clusters()).ok();
            }
        }
        self.k += 1;
        if self.k <= MAX_CLUSTERS {
            return;
        }
        let line_hz = self.lines.get(self.line).map_or(0.0, |line| line.line_hz);
        let mut turning = Vec::<Found, MAX_CLUSTERS>::new();
        for index in 0..self.best.len() {
            let Some(part) = candidate(grid, weights, &self.best, index) else { continue };
            let phasors = scratch.coherence.phasors(grid);
            let best = &self.best;
            let (region, total) =
                collect(phasors, |p| inside(p, &part) && nearest(best, p.x_px, p.y_px).0 == index);
            let winding = explain(&region, part.disc);
            if let Some(one) = believe(&winding, (&region, total), &part, line_hz) {
                turning.push(one).ok();
            }
        }
        if turning.is_empty()
            && let Some(whole) = self.whole
        {
            turning.push(whole).ok();
        }
        for one in turning {
            self.enter(one);
        }
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

fn inside(phasor: &Phasor, part: &Candidate) -> bool {
    let (dx, dy) = (phasor.x_px - part.disc.x_px, phasor.y_px - part.disc.y_px);
    let reach = 1.2 * part.disc.radius_px;
    dx * dx + dy * dy < reach * reach
}

/// A rotor, when the winding is one to be believed.
fn believe(
    winding: &Winding,
    (region, total): (&[Phasor], usize),
    part: &Candidate,
    line_hz: f32,
) -> Option<Found> {
    let thinned = total as f32 / region.len().max(1) as f32;
    let axis = Disc { x_px: winding.x_px, y_px: winding.y_px, radius_px: 0.0 };
    let off_centre = MOST_OFF_CENTRE * part.disc.radius_px;
    let believed = winding.windings != 0
        && region.len() >= LEAST_PHASORS
        && winding.share >= LEAST_SHARE
        && winding.share - winding.share_in_step >= LEAST_LEAD
        && part.disc.distance2(&axis) <= off_centre * off_centre;
    believed.then(|| Found {
        disc: Disc { radius_px: rim(region, &axis), ..axis },
        omega_rad_s: line_hz * TAU / winding.windings as f32,
        windings: winding.windings.unsigned_abs(),
        share: winding.share,
        explained: winding.share * region.iter().map(|p| p.amplitude).sum::<f32>() * thinned,
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

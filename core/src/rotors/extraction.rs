//! Rotating objects extraction: from the window to a list of discs that turn.
//!
//! 1. *Visits*: the times at which each cell of the image is visited, see [`super::visits`].
//! 2. *Lines*: the frequencies at which blades pass, the highest first, see [`super::lines`].
//! 3. For each line the map of the cells that keep step with it, which K-means with the Davies-Bouldin index splits
//!    into rotors. The index does not exist for k = 1, the most common case; there the rule is: *if one
//!    rotation explains the whole map, it is one rotor*. Otherwise the k of the lowest index is taken, and each of its
//!    clusters must be explained by a rotation of its own (see [`super::winding`]).
//! 4. What a rotor covers is left out, and the search begins again with what remains: a slow rotor among fast
//!    ones then has all of the memory to itself.
//! 5. The same in overlapping quarters of the picture: what a small rotor adds to a spectrum drowns in the scatter of all the
//!    cells that it does not cover, and in a quarter the cells may be smaller and the events more.
//!
//! The paper clusters the heat map directly; ARCHITECTURE.md says where that fails and what this changes.

use heapless::Vec;

use super::belief::{LEAST_PHASORS, believe, inside};
use super::coherence::{Coherence, Phasor};
use super::disc::{Disc, Sifted, Sifting};
use super::heat::{CellGrid, Cells};
use super::kmeans::{Cluster, KMeans, Seeding, davies_bouldin, nearest};
use super::lines::{Line, Lines, Spectrum};
use super::sweep::Sweep;
use super::visits::{Filling, Visits};
use super::winding::Explainer;
use crate::event::Geometry;
use crate::limits::{
    COHERENCE_CELLS, MAX_CANDIDATES, MAX_CLUSTERS, MAX_LINES, MAX_ROTORS, VISIT_CELLS, VISITS,
};
use crate::math::{TAU, sqrt};
use crate::order::sort_few;
use crate::speed::polar::{PolarTrack, track};
use crate::store::{Even, StoredEvent, Window};

/// Half the side of a local map in radii of its disc.
const LOCAL_SHARE: f32 = 1.25;
/// How far beside its centre a disc is swept from, in radii.
const BESIDE: f32 = 0.5;
/// Lines nearer to each other than this share of one line are the same.
const SAME_LINE: f32 = 0.5;
/// A rotation that explains this share of the whole map makes k = 1.
const SHARE_OF_ONE: f32 = 0.75;
/// Share of a rotor's radius that it is thought to cover: beyond it blades may have been cut off by the cells.
const COVERED: f32 = 1.1;
/// Events of a cell and polarity that a phase is taken from.
const EVENTS_A_PHASE: f32 = 8.0;
/// Largest side of a cell in radii: the phase of eight blades turns once in 0.8 radii at the rim.
const MOST_CELL_SHARE: f32 = 0.3;
/// Events of its own polarity that an event shares its cell with on average, at least, and the largest cells for that.
const LEAST_COMPANY: f32 = 3.0;
const COARSEST_LOG2: u8 = 4;
/// Fewest events that are searched.
const LEAST_EVENTS: usize = 100;
/// Quarters of the picture that are searched after the whole of it: half of its width and height, in steps of half of that.
const QUARTERS_A_SIDE: usize = 3;
const QUARTERS: usize = QUARTERS_A_SIDE * QUARTERS_A_SIDE;
/// Lines that are looked into in the quarters, all together, and in how many quarters each: a shaken background shows its
/// own in all of them.
const QUARTER_LOOKS: usize = 8;
const QUARTERS_A_LINE: usize = 2;

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

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    Visits,
    Lags,
    Spectrum,
    Line,
    Map,
    Judge,
    Seed,
    Around,
    Size,
    Fill,
    Collect,
    Whole,
    Split,
    Apart,
    Part,
    Moving,
    Heat,
    Track,
    Sweep,
    Slow,
    Done,
}

/// Whose rotation is looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum For {
    #[default]
    Whole,
    Part,
    Slow,
}

/// How far a clustering has got.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Clustering {
    #[default]
    First,
    Seeds,
    Sweeps,
    Index,
}

/// An extraction in progress.
#[derive(Debug, Default)]
pub struct Extraction {
    stage: Stage,
    /// Discs of the rotors found so far: the search goes on outside them.
    taken: Vec<Disc, MAX_ROTORS>,
    /// Peaks of the spectrum that are left, the highest last.
    lines: Lines,
    /// The line at hand.
    line: Line,
    /// Frequencies in Hz that were looked into since the last rotor was found.
    tried: Vec<f32, MAX_LINES>,
    /// Clusters of the clustering at hand, how they are seeded, and how far it has got.
    k: usize,
    seeding: Seeding,
    kmeans: KMeans,
    clustering: Clustering,
    /// Cluster at hand.
    part: usize,
    sifting: Sifting,
    /// The collection of visits, once it has begun.
    filling: Option<Filling>,
    /// Neighbours to each side that a cell of the map is judged with.
    reach: usize,
    /// The disc that is looked at and why, its events, and how far it has got.
    disc: Disc,
    looked_for: For,
    events: usize,
    even: Even,
    sweeping: Sweep,
    /// Clustering with the lowest index so far.
    best_index: f32,
    best: Vec<Cluster, MAX_CLUSTERS>,
    /// Quarter of the picture that is searched, from 1 on; 0 = all of it.
    quarter: usize,
    /// Smallest cells worth trying in a quarter, as a power of two: those that did for the whole, or half as wide where there
    /// were more events than memory.
    least_log2: u8,
    /// Cells of the visits: as fine as the events allow.
    grid: CellGrid,
    /// Grid of the local map at hand.
    local: CellGrid,
    /// What one rotation explains of the whole map.
    whole: Option<Found>,
    /// What rotations of their own explain of its parts.
    parts: Vec<Found, MAX_CLUSTERS>,
    /// Lines looked into.
    looks: usize,
    /// Where all that moves lies, once what turns slowly is looked for.
    swept: Option<Disc>,
    /// Rotors by every line: the same one may stand here twice.
    candidates: Vec<Found, MAX_CANDIDATES>,
    in_step_hz: Option<f32>,
}

/// Memory that an extraction works in.
#[derive(Debug, Default)]
pub struct Scratch {
    /// When each cell is visited.
    pub visits: Visits,
    /// Phases around one disc.
    pub coherence: Coherence,
    /// The search for a rotation that explains them.
    pub explainer: Explainer,
}

/// What an extraction looks at.
#[derive(Debug)]
pub struct View<'a> {
    /// The stored events.
    pub window: Window<'a>,
    /// Cells of the search.
    pub grid: CellGrid,
    /// Weights of these cells.
    pub weights: &'a mut [u8],
}

impl Extraction {
    /// A search of what is outside these rotors.
    pub fn beside(known: impl Iterator<Item = Disc>) -> Self {
        Self { taken: known.take(MAX_ROTORS).map(covered).collect(), ..Self::default() }
    }

    /// One bounded piece of work; `true` once [`Self::candidates`] stand.
    pub fn step(
        &mut self,
        view: &mut View<'_>,
        track: &mut PolarTrack,
        spectrum: &mut Spectrum,
        scratch: &mut Scratch,
    ) -> bool {
        match self.stage {
            Stage::Visits => self.visits(view, spectrum, scratch),
            Stage::Lags => self.lags(spectrum, scratch),
            Stage::Spectrum => self.spectrum(view, spectrum, scratch),
            Stage::Line => self.line(view, scratch),
            Stage::Map => self.map(view, scratch),
            Stage::Judge => self.judge(view, scratch),
            Stage::Seed => self.seed(view),
            Stage::Around => self.around(view),
            Stage::Size => self.size(view, scratch),
            Stage::Fill => self.fill(view, scratch),
            Stage::Collect => self.collect(scratch),
            Stage::Whole => self.whole(scratch),
            Stage::Split => self.split(view),
            Stage::Apart => self.apart(view),
            Stage::Part => self.part(scratch),
            Stage::Moving => self.moving(view, scratch),
            Stage::Heat => self.heat(view, scratch),
            Stage::Track => self.track(view, track),
            Stage::Sweep => self.sweep(view, track),
            Stage::Slow => self.slow(scratch),
            Stage::Done => {}
        }
        self.stage == Stage::Done
    }

    /// Name of the stage that the next step belongs to.
    #[must_use]
    pub const fn stage(&self) -> &'static str {
        match self.stage {
            Stage::Visits => "visits",
            Stage::Lags | Stage::Spectrum => "spectrum",
            Stage::Line | Stage::Map | Stage::Judge | Stage::Seed | Stage::Around => "map",
            Stage::Size | Stage::Fill | Stage::Collect => "coherence",
            Stage::Whole | Stage::Part | Stage::Slow => "winding",
            Stage::Moving | Stage::Heat | Stage::Track | Stage::Sweep => "sweep",
            Stage::Split | Stage::Apart => "split",
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

    /// Collects what is outside the rotors found so far.
    fn visits(&mut self, view: &View<'_>, spectrum: &mut Spectrum, scratch: &mut Scratch) {
        let Some(filling) = &mut self.filling else {
            if self.taken.is_full() {
                return self.end();
            }
            if self.grid.is_empty() {
                self.grid = self.finest(view);
            }
            return self.start_filling(scratch);
        };
        let filled = scratch.visits.fill(&view.window, &self.taken, filling);
        let most_events = filling.most_events();
        if filled.map(|(events, _)| events).or(most_events).is_some_and(|most| most < LEAST_EVENTS)
        {
            self.filling = None;
            return if self.quarter == 0 { self.end() } else { self.next_quarter() };
        }
        let Some((events, company)) = filled else { return };
        self.filling = None;
        if company < LEAST_COMPANY && self.grid.cell_log2 < COARSEST_LOG2 {
            self.grid = self.grid.coarser();
            return;
        }
        if self.quarter == 0 {
            let capped = events > VISITS / 4 * 3;
            self.least_log2 = self.grid.cell_log2.saturating_sub(u8::from(capped)).max(2);
        }
        spectrum.clear();
        self.stage = Stage::Lags;
    }

    fn start_filling(&mut self, scratch: &mut Scratch) {
        scratch.visits.clear(self.grid);
        self.filling = Some(Filling::default());
    }

    fn lags(&mut self, spectrum: &mut Spectrum, scratch: &mut Scratch) {
        if scratch.visits.step(spectrum.lags()) {
            self.stage = Stage::Spectrum;
        }
    }

    fn spectrum(&mut self, view: &View<'_>, spectrum: &mut Spectrum, scratch: &Scratch) {
        self.lines = spectrum.lines(scratch.visits.banks(), view.window.duration_us);
        self.lines.reverse();
        self.stage = Stage::Line;
    }

    /// The finest cells for what is searched.
    fn finest(&self, view: &View<'_>) -> CellGrid {
        let Some(number) = self.quarter.checked_sub(1) else { return view.grid };
        let CellGrid { columns, rows, cell_log2, .. } = view.grid;
        let half = |cells: usize| ((cells << cell_log2) / 2) as u16;
        let (width_px, height_px) = (half(columns), half(rows));
        let (column, row) = (number % QUARTERS_A_SIDE, number / QUARTERS_A_SIDE);
        let geometry = Geometry { width_px, height_px };
        CellGrid {
            x0: width_px / 2 * column as u16,
            y0: height_px / 2 * row as u16,
            ..CellGrid::fit(geometry, self.least_log2, view.weights.len().min(VISIT_CELLS))
        }
    }

    /// Goes on with the next quarter of the picture, or ends.
    fn next_quarter(&mut self) {
        if self.quarter == QUARTERS || self.taken.is_full() {
            return self.end();
        }
        if self.quarter == 0 {
            self.looks = 0;
            self.tried.clear();
        }
        self.quarter += 1;
        self.grid = CellGrid::default();
        self.stage = Stage::Visits;
    }

    fn end(&mut self) {
        let nothing = self.candidates.is_empty() && self.taken.is_empty();
        if nothing && self.swept.is_none() {
            self.grid = CellGrid::default();
            self.stage = Stage::Moving;
            return;
        }
        // A piece of a rotor, or a rotor by the line of its neighbour, explains fewer events than the rotor by
        // its own line.
        sort_few(&mut self.candidates, |a, b| a.explained.total_cmp(&b.explained).is_gt());
        self.stage = Stage::Done;
    }

    /// Where nothing passes anywhere twice, what turns slowly is looked for in the middle of all that moves.
    fn moving(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let Some(filling) = &mut self.filling else {
            if self.grid.is_empty() {
                self.grid = view.grid;
            }
            return self.start_filling(scratch);
        };
        let filled = scratch.visits.fill(&view.window, &[], filling);
        let Some((_, company)) = filled else { return };
        self.filling = None;
        if company < LEAST_COMPANY && self.grid.cell_log2 < COARSEST_LOG2 {
            self.grid = self.grid.coarser();
            return;
        }
        self.stage = Stage::Heat;
    }

    fn heat(&mut self, view: &mut View<'_>, scratch: &Scratch) {
        scratch.visits.heat(view.weights.get_mut(..self.grid.len()).unwrap_or_default());
        self.looked_for = For::Slow;
        self.stage = Stage::Seed;
    }

    fn start_track(&mut self, all: Disc) {
        self.swept = Some(all);
        // Seen from beside its centre: about the centre of n blades all harmonics but n and its multiples are silent.
        self.disc = Disc { x_px: all.x_px + BESIDE * all.radius_px, ..all };
        self.even = Even::default();
        self.stage = Stage::Track;
    }

    fn track(&mut self, view: &View<'_>, polar: &mut PolarTrack) {
        if track(&view.window, self.disc, polar, &mut self.even) {
            self.sweeping = Sweep::default();
            self.stage = Stage::Sweep;
        }
    }

    fn sweep(&mut self, view: &View<'_>, polar: &PolarTrack) {
        if self.sweeping.step(polar, view.window.duration_us) {
            self.lines.clear();
            for hz in core::mem::take(&mut self.sweeping).hz().into_iter().rev() {
                self.lines.push(Line { hz, sigmas: 0.0 }).ok();
            }
            self.next_slow();
        }
    }

    fn next_slow(&mut self) {
        let (Some(line), Some(disc)) = (self.lines.pop(), self.swept) else { return self.end() };
        self.line = line;
        self.look(For::Slow, disc);
    }

    /// One step of the look for the rotation of all that moves.
    fn slow(&mut self, scratch: &mut Scratch) {
        if scratch.explainer.step() {
            if let Some(found) = believe(&scratch.explainer, self.line.hz, self.local)
                && within(self.grid, found.disc)
            {
                self.enter(found);
            }
            self.next_slow();
        }
    }

    /// Takes the next line up.
    fn line(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let width_hz = SAME_LINE * 1e6 / view.window.duration_us.max(1) as f32;
        let Some(line) = self.lines.pop() else { return self.next_quarter() };
        let known = self.tried.iter().filter(|hz| (**hz - line.hz).abs() < width_hz).count();
        let (most, looks) =
            if self.quarter == 0 { (1, MAX_LINES) } else { (QUARTERS_A_LINE, QUARTER_LOOKS) };
        if known >= most {
            return;
        }
        if self.looks == looks {
            return self.end();
        }
        self.looks += 1;
        self.tried.push(line.hz).ok();
        self.line = line;
        self.reach = 1;
        scratch.visits.start_map();
        self.stage = Stage::Map;
    }

    /// Fills the map of the line at hand.
    fn map(&mut self, view: &mut View<'_>, scratch: &mut Scratch) {
        let Some(weights) = view.weights.get_mut(..self.grid.len()) else { return self.end() };
        if scratch.visits.map(self.line.hz, weights) {
            self.stage = Stage::Judge;
        }
    }

    fn judge(&mut self, view: &mut View<'_>, scratch: &mut Scratch) {
        let weights = view.weights.get_mut(..self.grid.len()).unwrap_or_default();
        if !scratch.visits.judge(weights, self.reach) {
            self.reach += 1;
            scratch.visits.start_map();
            self.stage = Stage::Map;
            return;
        }
        self.looked_for = For::Whole;
        self.stage = Stage::Seed;
    }

    /// Takes the map for one cluster.
    fn seed(&mut self, view: &View<'_>) {
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
    fn around(&mut self, view: &View<'_>) {
        match self.sifting.step(self.cells(view), self.kmeans.clusters()) {
            Sifted::Running => {}
            Sifted::Nothing => self.gathered(None),
            Sifted::Disc(all) => self.gathered(Some(all)),
        }
    }

    /// Goes on with the disc that holds all of the map.
    fn gathered(&mut self, all: Option<Disc>) {
        match (self.looked_for, all) {
            (For::Slow, all) => self.start_track(all.unwrap_or_default()),
            // Does one rotation explain it?
            (_, Some(all)) => self.look(For::Whole, all),
            (_, None) => self.stage = Stage::Line,
        }
    }

    /// The map of the line at hand.
    fn cells<'a>(&self, view: &'a View<'_>) -> Cells<'a> {
        let weights = view.weights.get(..self.grid.len()).unwrap_or(&[]);
        Cells { grid: self.grid, weights, floor: 0 }
    }

    /// Starts to look for the rotation that explains a disc.
    fn look(&mut self, looked_for: For, disc: Disc) {
        self.looked_for = looked_for;
        self.disc = disc;
        self.events = 0;
        self.even = Even::default();
        self.stage = Stage::Size;
    }

    /// Side of the cells in which the disc is looked at: as small as the events let a cell and polarity have a phase, and no
    /// larger than what blades can be told apart with.
    fn size(&mut self, view: &View<'_>, scratch: &mut Scratch) {
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
        self.local = CellGrid::around(disc.x_px, disc.y_px, half_px, cell_px, COHERENCE_CELLS);
        scratch.coherence.clear();
        self.even = Even::default();
        self.stage = Stage::Fill;
    }

    fn fill(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        if scratch.coherence.fill(&view.window, self.local, self.line.hz, &mut self.even) {
            self.stage = Stage::Collect;
        }
    }

    fn collect(&mut self, scratch: &mut Scratch) {
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
            For::Slow => Stage::Slow,
        };
    }

    /// One step of the look for one rotation; k = 1 when it explains the whole map.
    fn whole(&mut self, scratch: &mut Scratch) {
        if !scratch.explainer.step() {
            return;
        }
        let (region, _, _, winding) = scratch.explainer.result();
        let empty = region.len() < LEAST_PHASORS;
        if self.quarter == 0 && winding.windings == 0 && winding.share > SHARE_OF_ONE && !empty {
            self.in_step_hz = self.in_step_hz.or(Some(self.line.hz));
        }
        self.whole = believe(&scratch.explainer, self.line.hz, self.local);
        if let Some(whole) = self.whole
            && (whole.share >= SHARE_OF_ONE || self.quarter > 0)
        {
            self.take(whole);
            self.stage = Stage::Visits;
            return;
        }
        if self.quarter > 0 {
            // Two in a quarter were told apart in the whole, or are in quarters of their own.
            self.stage = Stage::Line;
            return;
        }
        self.k = 2;
        self.best.clear();
        self.best_index = f32::MAX;
        self.stage = Stage::Split;
    }

    /// Splits the map into k clusters and keeps the clustering of the best index.
    fn split(&mut self, view: &View<'_>) {
        let cells = self.cells(view);
        match self.clustering {
            Clustering::First => {
                self.kmeans = KMeans::seed(cells);
                self.clustering = Clustering::Seeds;
            }
            Clustering::Seeds => {
                if !self.kmeans.grow(cells, self.k, self.seeding) {
                    self.clustering = Clustering::Sweeps;
                }
            }
            Clustering::Sweeps => {
                if self.kmeans.sweep(cells) {
                    self.clustering = Clustering::Index;
                }
            }
            Clustering::Index => {
                let index = davies_bouldin(cells, self.kmeans.clusters());
                if let Some(index) = index.filter(|index| *index < self.best_index) {
                    self.best_index = index;
                    self.best.clear();
                    self.best.extend_from_slice(self.kmeans.clusters()).ok();
                }
                self.next_split();
            }
        }
    }

    /// Goes on with the next seeding, or one cluster more, or the best of all clusterings.
    fn next_split(&mut self) {
        self.clustering = Clustering::First;
        if self.seeding == Seeding::FarthestMean {
            self.seeding = Seeding::FarthestNearest;
            return;
        }
        self.seeding = Seeding::FarthestMean;
        self.k += 1;
        if self.k > MAX_CLUSTERS {
            self.part = 0;
            self.parts.clear();
            self.start_part();
        }
    }

    /// Starts to look for the rotation that explains the next cluster.
    fn start_part(&mut self) {
        match Sifting::new(&self.best, self.part) {
            Some(sifting) => {
                self.sifting = sifting;
                self.stage = Stage::Apart;
            }
            None => self.choose(),
        }
    }

    fn apart(&mut self, view: &View<'_>) {
        match self.sifting.step(self.cells(view), &self.best) {
            Sifted::Running => {}
            Sifted::Nothing => self.next_part(),
            Sifted::Disc(part) => self.look(For::Part, part),
        }
    }

    fn next_part(&mut self) {
        self.part += 1;
        self.start_part();
    }

    /// Takes the whole map for one rotor or its parts for several, whichever explains more events.
    fn choose(&mut self) {
        let parts = core::mem::take(&mut self.parts);
        let apart: f32 = parts.iter().map(|part| part.explained).sum();
        match self.whole {
            Some(whole) if whole.explained > apart => self.take(whole),
            None if parts.is_empty() => {
                self.stage = Stage::Line;
                return;
            }
            _ => parts.into_iter().for_each(|part| self.take(part)),
        }
        self.stage = Stage::Visits;
    }

    /// One step of the look for the rotation of one cluster.
    fn part(&mut self, scratch: &mut Scratch) {
        if scratch.explainer.step() {
            if let Some(one) = believe(&scratch.explainer, self.line.hz, self.local) {
                self.parts.push(one).ok();
            }
            self.next_part();
        }
    }

    /// Enters a rotor; the search goes on without what it covers.
    fn take(&mut self, found: Found) {
        self.taken.push(covered(found.disc)).ok();
        if self.quarter == 0 {
            self.tried.clear();
        }
        self.enter(found);
        self.grid = CellGrid::default();
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

/// What a rotor is thought to cover.
fn covered(disc: Disc) -> Disc {
    Disc { radius_px: COVERED * disc.radius_px, ..disc }
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

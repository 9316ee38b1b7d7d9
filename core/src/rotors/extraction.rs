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
//!    cells that it does not cover, and in a quarter the cells may be smaller and the events more. Where these are too few for
//!    a phase in each cell, they are looked at one by one.
//!
//! The paper clusters the heat map directly; ARCHITECTURE.md says where that fails and what this changes.

mod look;
mod quarters;
mod round;
mod slow;
mod split;

pub use round::Round;

use heapless::Vec;

use super::coherence::{Coherence, LocalGrid};
use super::disc::{Disc, Sifting};
use super::heat::{CellGrid, Cells};
use super::kmeans::{Cluster, KMeans, Seeding};
use super::lines::{Line, Lines, Spectrum};
use super::sweep::Sweep;
use super::visits::{Filling, Visits};
use super::winding::Explainer;
use crate::limits::{MAX_CANDIDATES, MAX_CLUSTERS, MAX_LINES, MAX_ROTORS};
use crate::order::sort_few;
use crate::speed::polar::PolarTrack;
use crate::speed::pose::Tilt;
use crate::store::{Even, Window};

/// Share of a rotor's radius that it is thought to cover: beyond it blades may have been cut off by the cells.
const COVERED: f32 = 1.1;

/// A rotor as extraction sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Axis and radius.
    pub disc: Disc,
    /// Speed in rad/s, positive = clockwise on the screen; good to the resolution of the spectrum.
    pub omega_rad_s: f32,
    /// Angular harmonic of the line it was found by.
    pub windings: u32,
    /// Frequency of that line in Hz.
    pub line_hz: f32,
    /// Share of the coherence map it explains.
    pub share: f32,
    /// Share of its disc that the map covers, counted in cells: above 1 where these are coarse.
    pub cover: f32,
    /// Events in step that it explains.
    pub explained: f32,
}

/// A rotor as it was found, or as it was last measured: where measuring begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Axis and radius.
    pub disc: Disc,
    /// Speed in rad/s, positive = clockwise on the screen; good to the resolution of the spectrum.
    pub omega_rad_s: f32,
    /// Angular harmonic that its measurement begins with: of the line it was found by, a multiple of the blade count or less with an
    /// odd blade; or the one that it was last followed in.
    pub windings: u32,
    /// Whether it was found, and is measured, without regard to polarity.
    pub ignores_polarity: bool,
    /// Whether it is the rival of what was refused: another harmonic of the same line about its own centre.
    pub rival: bool,
    /// Whether polarities were the other way round in parts of it, once it was measured.
    pub sided: bool,
    /// How it is tilted, once that was asked.
    pub tilt: Option<Tilt>,
    /// Root mean square speed of its axis in px/s, once it was followed: 0 on a tripod, tens in the hand.
    pub drift_px_s: f32,
}

impl Found {
    /// As extraction found it, in view of polarity or without regard to it.
    #[must_use]
    pub fn new(candidate: &Candidate, ignores_polarity: bool) -> Self {
        let Candidate { disc, omega_rad_s, windings, .. } = *candidate;
        Self { disc, omega_rad_s, windings, ignores_polarity, ..Self::default() }
    }
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
    Events,
    Whole,
    Split,
    Apart,
    Part,
    Moving,
    Fast,
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
    Fast,
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
    /// Lines that were looked into since the last rotor was found.
    tried: Vec<Line, MAX_LINES>,
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
    /// The last one, with which the same can be placed in larger cells.
    filled: Option<Filling>,
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
    /// Whether larger cells would show what these do not.
    lonely: bool,
    /// Whether the cells of this quarter have been made finer.
    finer: bool,
    /// Grid of the local map at hand.
    local: LocalGrid,
    /// What one rotation explains of the whole map.
    whole: Option<Candidate>,
    /// What rotations of their own explain of its parts.
    parts: Vec<Candidate, MAX_CLUSTERS>,
    /// Frequencies in Hz that were in step all over.
    all_over: Vec<f32, MAX_LINES>,
    /// Lines looked into, and those in this quarter.
    looks: usize,
    quarter_looks: usize,
    /// How much is searched before this ends: all, or one part; whether that part has had its spectrum and its look; and the
    /// cells that the part before left to this one, as a power of two.
    in_parts: bool,
    looked: bool,
    cell_log2: u8,
    /// Where all that moves lies, once what turns slowly is looked for.
    swept: Option<Disc>,
    /// Rotors by every line: the same one may stand here twice.
    candidates: Vec<Candidate, MAX_CANDIDATES>,
    /// Whether what keeps step passes more often than blades are followed.
    too_fast: bool,
    /// Frequency in Hz of the strongest line that all that is seen keeps step with at once, as under a lamp; 0 for none.
    lamp_hz: f32,
}

/// What flickers more slowly than this in Hz, all of it, is no lamp, but before a camera that moves.
const LEAST_LAMP_HZ: f32 = 90.0;

/// Memory that an extraction works in.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Where the times lie at which each cell is visited.
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
    /// Room for the times of the events that are searched.
    pub times: &'a mut [u16],
}

impl Extraction {
    /// Searches outside this rotor only.
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn leave_out(&mut self, known: Disc) {
        self.taken.push(covered(known)).ok();
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
            Stage::Lags => self.lags(view, spectrum, scratch),
            Stage::Spectrum => self.spectrum(view, spectrum, scratch),
            Stage::Line => self.line(view, scratch),
            Stage::Map => self.map(view, scratch),
            Stage::Judge => self.judge(view, scratch),
            Stage::Seed => self.seed(view),
            Stage::Around => self.around(view),
            Stage::Size => self.size(view, scratch),
            Stage::Fill => self.fill(view, scratch),
            Stage::Collect => self.collect(scratch),
            Stage::Events => self.events(view, scratch),
            Stage::Whole => self.whole(scratch),
            Stage::Split => self.split(view),
            Stage::Apart => self.apart(view),
            Stage::Part => self.part(scratch),
            Stage::Moving => self.moving(view, spectrum, scratch),
            Stage::Fast => self.fast(scratch),
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
            Stage::Lags | Stage::Spectrum | Stage::Fast => "spectrum",
            Stage::Line | Stage::Map | Stage::Judge | Stage::Seed | Stage::Around => "map",
            Stage::Size | Stage::Fill | Stage::Collect => "coherence",
            Stage::Events | Stage::Whole | Stage::Part | Stage::Slow => "winding",
            Stage::Moving | Stage::Heat | Stage::Track | Stage::Sweep => "sweep",
            Stage::Split | Stage::Apart => "split",
            Stage::Done => "done",
        }
    }

    /// Rotors by every line, those that explain most events first: whoever takes one leaves out those that
    /// overlap it.
    #[must_use]
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// Whether blades pass more often than they are followed.
    #[must_use]
    pub const fn too_fast(&self) -> bool {
        self.too_fast
    }

    /// Frequency in Hz at which all that is seen flickers, as a lamp makes it; 0 for none.
    #[must_use]
    pub const fn lamp_hz(&self) -> f32 {
        self.lamp_hz
    }

    // Not inlined: flash is short.
    #[inline(never)]
    fn end(&mut self) {
        let nothing = self.candidates.is_empty() && self.taken.is_empty();
        if nothing && self.swept.is_none() {
            self.grid = CellGrid::default();
            self.stage = Stage::Moving;
            return;
        }
        self.begin_round();
        self.done();
    }

    /// Ends with the candidates that there are.
    // Nor this.
    #[inline(never)]
    fn done(&mut self) {
        // A piece of a rotor, or a rotor by the line of its neighbour, explains fewer events than the rotor by
        // its own line.
        sort_few(&mut self.candidates, |a, b| a.explained.total_cmp(&b.explained).is_gt());
        self.stage = Stage::Done;
    }

    /// The map of the line at hand.
    fn cells<'a>(&self, view: &'a View<'_>) -> Cells<'a> {
        let weights = view.weights.get(..self.grid.len()).unwrap_or(&[]);
        Cells { grid: self.grid, weights, floor: 0 }
    }

    /// Enters a rotor; the search goes on without what it covers.
    fn take(&mut self, found: Candidate) {
        self.leave_out(found.disc);
        if self.quarter == 0 {
            self.tried.clear();
        }
        self.enter(found);
        self.grid = CellGrid::default();
    }

    /// Enters a candidate; when the list is full, in place of the one that explains least.
    // Nor this.
    #[inline(never)]
    fn enter(&mut self, candidate: Candidate) {
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

//! When each cell of the image is visited: the search's view of the window.
//!
//! A cell under a rotor sees a blade pass once in a period, whatever the phases of its neighbours are. The powers of the
//! cells' spectra therefore add up where a sum over a region would cancel: over swept blades, many blades on a small
//! radius, or two rotors. The sum of the power spectra is the Fourier transform of the sum of the cells'
//! autocorrelations, and these are histograms of time differences, which cost a few instructions a pair of events.
//!
//! Every cell and polarity is weighed by one over its events: unrelated events give it the power 1, however many there are,
//! so that a fast rotor or a hot pixel does not drown a slow one.

use super::disc::Disc;
use super::heat::CellGrid;
use super::lines::LAGS;
use crate::event::Geometry;
use crate::limits::{VISIT_CELLS, VISITS};
use crate::math::{Turn, sqrt};
use crate::store::Window;

/// Time is counted in this many parts of the window; the bit below them holds the polarity.
const TICKS_LOG2: u32 = 15;
/// Most events of one cell of which pairs are made.
const MOST_IN_CELL: usize = 128;
/// Pairs in one step: a million instructions.
const PAIRS_A_STEP: usize = 100_000;
/// Power over chance of a cell and its neighbours, in standard deviations, from which on they are in step.
const LEAST_SIGMAS: f32 = 3.5;
/// The same as a share of the highest.
const LEAST_SHARE: f32 = 0.15;
/// A cell with fewer events shows noise.
const LEAST_HEAT: usize = 3;
/// Fewest cells that a rotor shows in.
const LEAST_CELLS: usize = 16;
/// Most neighbours to each side.
const MOST_REACH: usize = 2;
/// Longest row of cells: [`Geometry::MAX_PX`] in cells of 4 px.
const MOST_COLUMNS: usize = Geometry::MAX_PX as usize / 4;

/// Times of the events in each cell.
#[derive(Debug)]
pub struct Visits {
    grid: CellGrid,
    window_us: u32,
    /// Where the times of each cell end; they start where those of the cell before end.
    ends: [u16; VISIT_CELLS],
    /// Time in parts of the window, and polarity in the lowest bit, cell by cell, oldest first.
    times: [u16; VISITS],
    /// Next cell to make pairs of.
    cell: usize,
    /// What unrelated events would add up to.
    chance: Chance,
}

/// What the power of unrelated events adds up to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Chance {
    /// Its mean.
    pub mean: f32,
    /// Its variance.
    pub variance: f32,
}

impl Default for Visits {
    fn default() -> Self {
        Self {
            grid: CellGrid::default(),
            window_us: 1,
            ends: [0; VISIT_CELLS],
            times: [0; VISITS],
            cell: 0,
            chance: Chance::default(),
        }
    }
}

/// One cell and polarity at a frequency.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    re: f32,
    im: f32,
    count: f32,
}

impl Sum {
    /// Power over chance by what unrelated events give, for the two events or more that it takes.
    fn excess(self) -> Option<f32> {
        let power = self.re * self.re + self.im * self.im;
        (self.count > 1.0).then(|| power / self.count - 1.0)
    }
}

impl Visits {
    /// The grid used for a sensor, of at most `most` cells.
    #[must_use]
    pub const fn grid(geometry: Geometry, most: usize) -> CellGrid {
        CellGrid::fit(geometry, 2, if most < VISIT_CELLS { most } else { VISIT_CELLS })
    }

    /// Takes in the events outside the discs in `taken`, evenly thinned to the capacity; returns their number, and with how
    /// many of its own polarity an event shares its cell on average.
    /// Cost: about 150 instructions an event.
    pub fn fill(&mut self, window: &Window<'_>, grid: CellGrid, taken: &[Disc]) -> (usize, f32) {
        self.grid = grid;
        self.window_us = window.duration_us.max(1);
        self.cell = 0;
        self.chance = Chance::default();
        let free = |x: u16, y: u16| {
            let at = Disc { x_px: f32::from(x), y_px: f32::from(y), radius_px: 0.0 };
            taken.iter().all(|disc| disc.distance2(&at) > disc.radius_px * disc.radius_px)
        };
        let events = || {
            let inside = |event: crate::store::StoredEvent| {
                let cell = grid.index(event.x(), event.y());
                (cell < VISIT_CELLS && free(event.x(), event.y())).then_some(cell)
            };
            window.even(VISITS, inside).1.take(VISITS)
        };
        self.ends.fill(0);
        for (_, cell) in events() {
            self.ends[cell] += 1;
        }
        // From counts to starts; placing the events turns starts into ends.
        let mut start = 0;
        for end in &mut self.ends {
            let count = *end;
            *end = start;
            start += count;
        }
        for (event, cell) in events() {
            let since_us = event.since(window.start_us).max(0) as u64;
            // A last window may end before its last event.
            let tick = (since_us << TICKS_LOG2) / u64::from(self.window_us);
            let tick = tick.min((1 << TICKS_LOG2) - 1) as u16;
            let place = &mut self.ends[cell];
            if let Some(time) = self.times.get_mut(usize::from(*place)) {
                *time = (tick << 1) | u16::from(event.is_on());
                *place += 1;
            }
        }
        let company: f32 = (0..VISIT_CELLS)
            .map(|cell| {
                let times = self.of(cell);
                let on = times.iter().filter(|time| **time & 1 == 1).count() as f32;
                let off = times.len() as f32 - on;
                on * (on - 1.0) + off * (off - 1.0)
            })
            .sum();
        (usize::from(start), company / f32::from(start.max(1)))
    }

    fn of(&self, cell: usize) -> &[u16] {
        let start = cell.checked_sub(1).map_or(0, |before| usize::from(self.ends[before]));
        self.times.get(start..usize::from(self.ends[cell])).unwrap_or(&[])
    }

    /// Adds the time differences of some cells to the histogram; `true` once all are in it. A cell and polarity counts as much as
    /// it has events, up to `most_weight`: 1 for all alike.
    pub fn step(&mut self, lags: &mut [f32; LAGS], most_weight: usize) -> bool {
        let mut pairs = 0;
        while self.cell < VISIT_CELLS && pairs < PAIRS_A_STEP {
            pairs += 8 + self.pair(self.cell, lags, most_weight);
            self.cell += 1;
        }
        self.cell >= VISIT_CELLS
    }

    /// Adds the time differences of one cell; returns how many.
    fn pair(&mut self, cell: usize, lags: &mut [f32; LAGS], most_weight: usize) -> usize {
        let times = self.of(cell);
        let stride = times.len().div_ceil(MOST_IN_CELL).max(1);
        let kept = || times.iter().copied().step_by(stride);
        let on = kept().filter(|time| time & 1 == 1).count();
        let counts = [kept().count() - on, on];
        let weight = |count: usize| count.min(most_weight) as f32;
        let weights = counts.map(|count| weight(count) / count.max(1) as f32);
        for (index, late) in kept().enumerate() {
            let weight = weights[usize::from(late & 1)];
            for early in kept().take(index) {
                if (late ^ early) & 1 == 0 {
                    let lag =
                        usize::from(late.saturating_sub(early)) >> (TICKS_LOG2 + 1 - LAGS.ilog2());
                    if let Some(sum) = lags.get_mut(lag) {
                        *sum += weight;
                    }
                }
            }
        }
        for weight in counts.into_iter().filter(|count| *count > 1).map(weight) {
            self.chance.mean += weight;
            self.chance.variance += weight * weight;
        }
        counts[0] * counts[0] / 2 + counts[1] * counts[1] / 2
    }

    /// What the summed power would be if the events had nothing to do with each other.
    #[must_use]
    pub const fn chance(&self) -> Chance {
        self.chance
    }

    /// Writes how often each cell is visited as weights, row by row: the root, so that what passes slowly still counts.
    pub fn heat(&self, weights: &mut [u8]) {
        for (cell, weight) in weights.iter_mut().enumerate().take(VISIT_CELLS) {
            let events = self.of(cell).len();
            let seen = events >= LEAST_HEAT;
            *weight = if seen { (16.0 * sqrt(events as f32)).min(255.0) as u8 } else { 0 };
        }
    }

    /// Writes which cells keep step with a frequency as weights, row by row. A cell is judged
    /// together with its neighbours, one to each side, or two where that shows too few.
    /// Cost: about 60 instructions an event and 100 a cell.
    pub fn map(&self, line_hz: f32, weights: &mut [u8]) {
        for reach in 1..=MOST_REACH {
            self.map_within(line_hz, weights, reach);
            if weights.iter().filter(|weight| **weight > 0).count() >= LEAST_CELLS {
                return;
            }
        }
    }

    fn map_within(&self, line_hz: f32, weights: &mut [u8], reach: usize) {
        let periods = line_hz * self.window_us as f32 * 1e-6;
        let per_tick = (periods * (1_u64 << (32 - TICKS_LOG2)) as f32) as u32;
        for (cell, weight) in weights.iter_mut().enumerate().take(VISIT_CELLS) {
            let mut sums = [Sum::default(); 2];
            for time in self.of(cell) {
                let (sin, cos) = Turn(per_tick.wrapping_mul(u32::from(time >> 1))).sin_cos();
                let sum = &mut sums[usize::from(time & 1)];
                sum.re += cos;
                sum.im += sin;
                sum.count += 1.0;
            }
            *weight = Excess::of(sums).pack();
        }
        smooth(self.grid, weights, reach);
        let top = weights.iter().copied().max().unwrap_or(0);
        // Weights are roots.
        let floor = (f32::from(top) * sqrt(LEAST_SHARE)) as u8;
        weights.iter_mut().filter(|weight| **weight < floor).for_each(|weight| *weight = 0);
    }
}

/// Power over chance of a cell, in a byte.
#[derive(Clone, Copy, Debug, Default)]
struct Excess {
    /// In units of what unrelated events give.
    power: f32,
    /// Polarities that it is the sum of: its variance at chance.
    banks: u8,
}

impl Excess {
    fn of(sums: [Sum; 2]) -> Self {
        let powers = sums.iter().filter_map(|sum| sum.excess());
        powers.fold(Self::default(), |all, power| Self {
            power: all.power + power,
            banks: all.banks + 1,
        })
    }

    /// Halves in the upper six bits, from the least possible -2 up to 29.5.
    fn pack(self) -> u8 {
        let halves = ((self.power + 2.0) * 2.0).clamp(0.0, 63.0) as u8;
        (halves << 2) | self.banks
    }

    fn unpack(packed: u8) -> Self {
        Self { power: f32::from(packed >> 2) * 0.5 - 1.75, banks: packed & 3 }
    }
}

/// Sums up each cell and its neighbours and writes the root of their significance, zero below [`LEAST_SIGMAS`].
fn smooth(grid: CellGrid, cells: &mut [u8], reach: usize) {
    let columns = grid.columns.min(MOST_COLUMNS);
    // The rows above and the row at hand, as they were.
    let mut before = [[0_u8; MOST_COLUMNS]; MOST_REACH + 1];
    for row in 0..grid.rows {
        let start = row * grid.columns;
        let Some(line) = cells.get(start..start + columns) else { return };
        before[row % (MOST_REACH + 1)][..columns].copy_from_slice(line);
        for column in 0..columns {
            let around = column.saturating_sub(reach)..(column + reach + 1).min(columns);
            let (mut power, mut banks) = (0.0, 0_u8);
            let mut add = |packed: &u8| {
                let excess = Excess::unpack(*packed);
                if excess.banks > 0 {
                    power += excess.power;
                    banks += excess.banks;
                }
            };
            for above in row.saturating_sub(reach)..=row {
                before[above % (MOST_REACH + 1)][around.clone()].iter().for_each(&mut add);
            }
            for below in row + 1..=row + reach {
                let from = below * grid.columns;
                let line = cells.get(from + around.start..from + around.end);
                line.unwrap_or(&[]).iter().for_each(&mut add);
            }
            let sigmas = power / sqrt(f32::from(banks.max(1)));
            let weight = if sigmas < LEAST_SIGMAS { 0.0 } else { 16.0 * sqrt(sigmas) };
            cells[start + column] = weight.min(255.0) as u8;
        }
    }
}

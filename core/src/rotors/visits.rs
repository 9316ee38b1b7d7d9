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
use crate::store::{Even, StoredEvent, Window};

/// Time is counted in this many parts of the window; the bit below them holds the polarity.
const TICKS_LOG2: u32 = 15;
/// Pairs are made of at most this part of all events that there is room for in one cell: 128 on the device.
const MOST_IN_CELL_SHARE: usize = 48;
/// Pairs in one step: half a million instructions.
const PAIRS_A_STEP: usize = 30_000;
/// Events and cells of the map in one step, the same.
const MAPPED_A_STEP: usize = 2_048;
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
/// Largest cells, as a power of two of pixels.
pub const COARSEST_LOG2: u8 = 4;
/// Longest row of cells: [`Geometry::MAX_PX`] in cells of 4 px.
const MOST_COLUMNS: usize = Geometry::MAX_PX as usize / 4;

/// Where the times of the events in each cell lie in the memory that is lent for them: time in parts of the window, and polarity in
/// the lowest bit, cell by cell, oldest first.
#[derive(Debug)]
pub struct Visits {
    grid: CellGrid,
    window_us: u32,
    /// Where the times of each cell end; they start where those of the cell before end.
    ends: [u16; VISIT_CELLS],
    /// Next cell to make pairs of, or to map.
    cell: usize,
    /// Only one of so many events of a cell is mapped.
    stride: usize,
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
            cell: 0,
            stride: 1,
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

    /// Starts over on another grid, or outside other discs.
    pub fn clear(&mut self, grid: CellGrid, times: &mut [u16]) {
        self.grid = grid;
        self.cell = 0;
        self.chance = Chance::default();
        self.ends.fill(0);
        times.fill(0);
    }

    /// The cells that the visits are filled into: coarser ones than they were cleared for, where the events wanted these.
    #[must_use]
    pub const fn cells(&self) -> CellGrid {
        self.grid
    }

    /// Takes in the events of a segment outside the discs in `taken`, evenly thinned to the capacity; once all are in,
    /// their number, and with how many of its own polarity an event shares its cell on average. Cells grow until it shares
    /// it with `least_company`, as far as counts tell.
    pub fn fill(
        &mut self,
        window: &Window<'_>,
        taken: &[Disc],
        filling: &mut Filling,
        least_company: f32,
        times: &mut [u16],
    ) -> Option<(usize, f32)> {
        let (grid, start_us) = (self.grid, window.start_us);
        let room = most(times);
        self.window_us = window.duration_us.max(1);
        let free = |x: u16, y: u16| {
            let at = Disc { x_px: f32::from(x), y_px: f32::from(y), radius_px: 0.0 };
            taken.iter().all(|disc| disc.distance2(&at) > disc.radius_px * disc.radius_px)
        };
        let inside = |event: StoredEvent| {
            let (x, y) = (event.x(), event.y());
            (grid.holds(x, y) && free(x, y)).then(|| grid.index(x, y))
        };
        let Filling { even, counted, placed } = filling;
        let take = |event: StoredEvent, cell: usize| {
            if *placed == room {
                return;
            }
            *placed += 1;
            let Some(place) = self.ends.get_mut(cell) else { return };
            if *counted {
                let tick = tick(event.since(start_us), self.window_us);
                if let Some(time) = times.get_mut(usize::from(*place)) {
                    *time = (tick << 1) | u16::from(window.is_on(event));
                }
            } else if window.is_on(event)
                && let Some(on) = times.get_mut(cell)
            {
                *on += 1;
            }
            *place += 1;
        };
        if !even.step(window, room, inside, take) {
            return None;
        }
        if *counted {
            return Some(self.filled(times));
        }
        while self.grid.cell_log2 < COARSEST_LOG2 && self.counted_company(times) < least_company {
            self.merge(times);
        }
        self.place_in(filling);
        None
    }

    /// Makes ready to place the events in larger cells: they were counted before.
    pub fn place_in_coarser(&mut self, filling: &mut Filling, times: &mut [u16]) {
        // From ends to counts.
        let mut start = 0;
        for end in &mut self.ends {
            *end -= start;
            start += *end;
        }
        // Where the brighter events of each cell were counted there are times now, which add up to nothing.
        times.fill(0);
        self.merge(times);
        self.cell = 0;
        self.chance = Chance::default();
        self.place_in(filling);
    }

    /// From counts to starts; placing the events turns starts into ends.
    fn place_in(&mut self, filling: &mut Filling) {
        let mut start = 0;
        for end in &mut self.ends {
            let count = *end;
            *end = start;
            start += count;
        }
        filling.even.again();
        (filling.counted, filling.placed) = (true, 0);
    }

    /// The company of the events that were counted, of either polarity.
    fn counted_company(&self, times: &[u16]) -> f32 {
        let (mut company, mut events) = (0_u32, 0_u32);
        for (cell, count) in self.ends.iter().enumerate().take(self.grid.len()) {
            let count = u32::from(*count);
            let on = times.get(cell).map_or(count / 2, |on| u32::from(*on));
            let off = count.saturating_sub(on);
            company += on * on.saturating_sub(1) + off * off.saturating_sub(1);
            events += count;
        }
        company as f32 / events.max(1) as f32
    }

    /// Adds up the counts of four cells each.
    fn merge(&mut self, times: &mut [u16]) {
        let coarser = self.grid.coarser();
        for cell in 0..self.grid.len() {
            let (column, row) = (cell % self.grid.columns, cell / self.grid.columns);
            // Never behind the cell at hand, so that nothing is added to what has not been moved yet.
            let into = row / 2 * coarser.columns + column / 2;
            let count = core::mem::take(&mut self.ends[cell]);
            self.ends[into] += count;
            let on = times.get_mut(cell).map_or(0, core::mem::take);
            if let Some(sum) = times.get_mut(into) {
                *sum += on;
            }
        }
        self.grid = coarser;
    }

    /// The number of events, and with how many of its own polarity an event shares its cell on average.
    fn filled(&self, times: &[u16]) -> (usize, f32) {
        let company: f32 = (0..self.grid.len())
            .map(|cell| {
                let times = self.of(cell, times);
                let on = times.iter().filter(|time| **time & 1 == 1).count() as f32;
                let off = times.len() as f32 - on;
                on * (on - 1.0) + off * (off - 1.0)
            })
            .sum();
        let events = self.ends[VISIT_CELLS - 1];
        (usize::from(events), company / f32::from(events.max(1)))
    }

    fn of<'t>(&self, cell: usize, times: &'t [u16]) -> &'t [u16] {
        let start = cell.checked_sub(1).map_or(0, |before| usize::from(self.ends[before]));
        times.get(start..usize::from(self.ends[cell])).unwrap_or(&[])
    }

    /// Adds the time differences of some cells to the histogram; `true` once all are in it. A cell and polarity counts as much as
    /// it has events, up to `most_weight`: 1 for all alike. The histogram ends at the window's length over 2^`finer_log2`.
    pub fn step(
        &mut self,
        lags: &mut [f32; LAGS],
        most_weight: usize,
        finer_log2: u32,
        times: &[u16],
    ) -> bool {
        let mut pairs = 0;
        while self.cell < self.grid.len() && pairs < PAIRS_A_STEP {
            pairs += 8 + self.pair(self.cell, lags, most_weight, finer_log2, times);
            self.cell += 1;
        }
        self.cell >= self.grid.len()
    }

    /// Adds the time differences of one cell; returns how many.
    fn pair(
        &mut self,
        cell: usize,
        lags: &mut [f32; LAGS],
        most_weight: usize,
        finer_log2: u32,
        times: &[u16],
    ) -> usize {
        let most_in_cell = (most(times) / MOST_IN_CELL_SHARE).max(1);
        let times = self.of(cell, times);
        let stride = times.len().div_ceil(most_in_cell).max(1);
        let shift = TICKS_LOG2 + 1 - LAGS.ilog2() - finer_log2;
        let kept = || times.iter().copied().step_by(stride);
        let on = kept().filter(|time| time & 1 == 1).count();
        let counts = [kept().count() - on, on];
        let weight = |count: usize| count.min(most_weight) as f32;
        let weights = counts.map(|count| weight(count) / count.max(1) as f32);
        for (index, late) in kept().enumerate() {
            let weight = weights[usize::from(late & 1)];
            for early in kept().take(index) {
                if (late ^ early) & 1 == 0 {
                    let lag = usize::from(late.saturating_sub(early)) >> shift;
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
    pub fn heat(&self, weights: &mut [u8], times: &[u16]) {
        let roots: [u8; 256] = core::array::from_fn(|n| (16.0 * sqrt(n as f32)).min(255.0) as u8);
        for (cell, weight) in weights.iter_mut().enumerate().take(VISIT_CELLS) {
            let events = self.of(cell, times).len();
            *weight = if events >= LEAST_HEAT { roots[events.min(roots.len() - 1)] } else { 0 };
        }
    }

    /// Starts to map which cells keep step with a frequency.
    pub const fn start_map(&mut self) {
        self.cell = 0;
        self.stride = 1;
    }

    /// Writes the power over chance of some cells at a frequency as weights, row by row; `true` once all are written.
    pub fn map(&mut self, line_hz: f32, weights: &mut [u8], times: &[u16]) -> bool {
        let periods = line_hz * self.window_us as f32 * 1e-6;
        let per_tick = (periods * (1_u64 << (32 - TICKS_LOG2)) as f32) as u32;
        let cells = weights.len().min(VISIT_CELLS);
        let mut mapped = 0;
        while self.cell < cells && mapped < MAPPED_A_STEP {
            let mut sums = [Sum::default(); 2];
            let times = self.of(self.cell, times);
            for time in times.iter().step_by(self.stride) {
                let (sin, cos) = Turn(per_tick.wrapping_mul(u32::from(time >> 1))).sin_cos();
                let sum = &mut sums[usize::from(time & 1)];
                sum.re += cos;
                sum.im += sin;
                sum.count += 1.0;
            }
            mapped += 1 + times.len();
            weights[self.cell] = Excess::of(sums).pack();
            self.cell += 1;
        }
        if self.cell < cells {
            return false;
        }
        // More than a byte can tell: the strongest cells would count for less than they are beside the weaker ones.
        let thinned = usize::from(self.ends[VISIT_CELLS - 1]) / (2 * self.stride);
        if thinned >= VISITS && weights.iter().take(cells).any(|weight| Excess::is_full(*weight)) {
            self.stride *= 2;
            self.cell = 0;
            return false;
        }
        true
    }

    /// Turns these powers into weights of the cells that keep step, zero for the others. A cell is judged together with its
    /// neighbours, so many to each side; `true` unless more neighbours may show more.
    pub fn judge(&self, weights: &mut [u8], reach: usize) -> bool {
        smooth(self.grid, weights, reach);
        let top = weights.iter().copied().max().unwrap_or(0);
        // Weights are roots.
        let floor = (f32::from(top) * sqrt(LEAST_SHARE)) as u8;
        weights.iter_mut().filter(|weight| **weight < floor).for_each(|weight| *weight = 0);
        reach >= MOST_REACH || weights.iter().filter(|weight| **weight > 0).count() >= LEAST_CELLS
    }
}

/// How far a filling has got.
#[derive(Clone, Copy, Debug, Default)]
pub struct Filling {
    even: Even,
    /// Whether each cell's events were counted, and are placed now.
    counted: bool,
    /// Events counted or placed so far.
    placed: usize,
}

impl Filling {
    /// The number of events that there are at most, once it is known.
    #[must_use]
    pub fn most_events(&self) -> Option<usize> {
        self.even.is_weighed().then(|| self.even.count())
    }
}

/// Events that there is room for: no more than the ends of cells can tell.
fn most(times: &[u16]) -> usize {
    times.len().min(usize::from(u16::MAX))
}

/// When an event came, in parts of the window.
fn tick(since_us: i32, window_us: u32) -> u16 {
    const MOST: u32 = (1 << TICKS_LOG2) - 1;
    const HIGH_LOG2: u32 = 10;
    let since_us = since_us.max(0) as u32;
    // A last window may end before its last event.
    if since_us >= window_us {
        return MOST as u16;
    }
    // In two divisions of 32 bits, as the processor divides no 64: exact for windows of up to four seconds.
    let coarser = HIGH_LOG2.saturating_sub(window_us.leading_zeros());
    let (since_us, window_us) = (since_us >> coarser, (window_us >> coarser).max(1));
    let (high, rest) = ((since_us << HIGH_LOG2) / window_us, (since_us << HIGH_LOG2) % window_us);
    let low = (rest << (TICKS_LOG2 - HIGH_LOG2)) / window_us;
    ((high << (TICKS_LOG2 - HIGH_LOG2)) + low).min(MOST) as u16
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

    const MOST_HALVES: u8 = 63;

    /// Halves in the upper six bits, from the least possible -2 up to 29.5.
    fn pack(self) -> u8 {
        let halves = ((self.power + 2.0) * 2.0).clamp(0.0, f32::from(Self::MOST_HALVES)) as u8;
        (halves << 2) | self.banks
    }

    /// Whether the power may be larger than it says.
    const fn is_full(packed: u8) -> bool {
        packed >> 2 == Self::MOST_HALVES
    }

    /// Four times the power, above eight bits that hold the banks, so that one sum adds up both; 0 without banks.
    const fn unpack(packed: u8) -> i32 {
        let (halves, banks) = ((packed >> 2) as i32, (packed & 3) as i32);
        if banks == 0 { 0 } else { ((2 * halves - 7) << 8) + banks }
    }
}

/// Most banks around a cell.
const MOST_BANKS: usize = 2 * (2 * MOST_REACH + 1) * (2 * MOST_REACH + 1);

/// Sums up each cell and its neighbours and writes the root of their significance, zero below [`LEAST_SIGMAS`].
fn smooth(grid: CellGrid, cells: &mut [u8], reach: usize) {
    const ROWS: usize = MOST_REACH + 1;
    let columns = grid.columns.min(MOST_COLUMNS);
    let roots: [f32; MOST_BANKS + 1] = core::array::from_fn(|banks| sqrt(banks.max(1) as f32));
    let weight = |around: i32| {
        let power = 0.25 * (around >> 8) as f32;
        let sigmas = power / roots.get((around & 0xFF) as usize).copied().unwrap_or(f32::MAX);
        if sigmas < LEAST_SIGMAS { 0 } else { (16.0 * sqrt(sigmas)).min(255.0) as u8 }
    };
    // The rows above and the row at hand, as they were.
    let mut before = [[0_u8; MOST_COLUMNS]; ROWS];
    for row in 0..grid.rows {
        let start = row * grid.columns;
        let Some(line) = cells.get(start..start + columns) else { return };
        before[row % ROWS][..columns].copy_from_slice(line);
        let rows_above = reach.min(row) + 1;
        // Sums of the columns around the cell at hand, and of all of them.
        let (mut sums, mut oldest, mut around) = ([0; 2 * MOST_REACH + 1], 0, 0);
        #[expect(clippy::needless_range_loop, reason = "the columns run on past the last cell")]
        for column in 0..columns + reach {
            let mut sum = 0;
            if column < columns {
                let mut above = row % ROWS;
                for _ in 0..rows_above {
                    sum += Excess::unpack(before[above][column]);
                    above = if above == 0 { ROWS - 1 } else { above - 1 };
                }
                for below in 1..=reach {
                    let cell = cells.get(start + below * grid.columns + column);
                    sum += cell.map_or(0, |packed| Excess::unpack(*packed));
                }
            }
            around += sum - core::mem::replace(&mut sums[oldest], sum);
            oldest = if oldest == 2 * reach { 0 } else { oldest + 1 };
            if let Some(column) = column.checked_sub(reach) {
                cells[start + column] = weight(around);
            }
        }
    }
}

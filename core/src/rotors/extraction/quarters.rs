//! What is searched, the whole picture and then its quarters, and the lines that show there.

use super::{Extraction, For, Scratch, Stage, View};
use crate::event::Geometry;
use crate::limits::{MAX_LINES, VISIT_CELLS};
use crate::rotors::heat::CellGrid;
use crate::rotors::lines::{Line, Spectrum};
use crate::rotors::visits::{COARSEST_LOG2, Filling};

/// Events of its own polarity that an event shares its cell with on average, at least.
pub(super) const LEAST_COMPANY: f32 = 3.0;
/// In a quarter, the same beyond which finer cells are tried first, and the finest.
const MUCH_COMPANY: f32 = 6.0;
const FINEST_LOG2: u8 = 2;
/// In a quarter that is mostly noise a rotor's cells have more company than the average, but not below this.
const HOPELESS_COMPANY: f32 = 0.5;
/// Fewest events that are searched.
const LEAST_EVENTS: usize = 100;
/// Lines nearer to each other than this share of one line are the same.
const SAME_LINE: f32 = 0.5;
/// Quarters of the picture that are searched after the whole of it: half of its width and height, in steps of half of that.
const QUARTERS_A_SIDE: usize = 3;
const QUARTERS: usize = QUARTERS_A_SIDE * QUARTERS_A_SIDE;
/// Lines that are looked into in the quarters, all together, in one of them, and in how many quarters each: a shaken background
/// shows its own in all of them.
const QUARTER_LOOKS: usize = 12;
const LOOKS_A_QUARTER: usize = 2;
const QUARTERS_A_LINE: usize = 2;
/// Factor by which a line is higher where something turns at nearly the frequency that a hand trembles at.
const HIGHER: f32 = 1.25;
/// In a quarter a cell counts as much as it has events, up to so many: a rotor has more of them than noise, and what is as bright
/// as it was found in the whole.
const MOST_WEIGHT: usize = 8;

/// Where nothing was found, lines are looked for above the highest, in a histogram that is as much finer, as a power of two: up to
/// 6.8 kHz in 150 ms, where a jitter of 40 us hides most blades.
const FAST_LOG2: u32 = 1;

impl Extraction {
    /// Collects what is outside the rotors found so far.
    pub(super) fn visits(
        &mut self,
        view: &mut View<'_>,
        spectrum: &mut Spectrum,
        scratch: &mut Scratch,
    ) {
        let Some(filling) = &mut self.filling else {
            if self.taken.is_full() {
                return self.end();
            }
            if self.looked {
                return self.done();
            }
            if self.grid.is_empty() {
                let left_log2 = core::mem::take(&mut self.cell_log2);
                self.finer &= left_log2 > 0;
                let cell_log2 = if left_log2 > 0 { left_log2 } else { self.least_log2 };
                self.grid = self.cells_of(view, cell_log2);
                while self.grid.cell_log2 < left_log2 {
                    self.grid = self.grid.coarser();
                }
            }
            return self.start_filling(view, scratch);
        };
        let least_company = if self.quarter == 0 { LEAST_COMPANY } else { HOPELESS_COMPANY };
        let View { window, times, .. } = view;
        let filled = scratch.visits.fill(window, &self.taken, filling, least_company, times);
        let most_events = filling.most_events();
        if filled.map(|(events, _)| events).or(most_events).is_some_and(|most| most < LEAST_EVENTS)
        {
            self.filling = None;
            return if self.quarter == 0 { self.end() } else { self.next_quarter() };
        }
        let Some((events, company)) = filled else { return };
        self.filled = self.filling.take();
        self.grid = scratch.visits.cells();
        self.lonely = company < LEAST_COMPANY && self.grid.cell_log2 < COARSEST_LOG2;
        let finer = self.quarter > 0 && !self.finer && company > MUCH_COMPANY;
        if finer && self.grid.cell_log2 > FINEST_LOG2 {
            // Many small blades pass side by side.
            self.finer = true;
            self.grid = self.cells_of(view, self.grid.cell_log2 - 1);
            return self.other_cells();
        }
        if self.quarter == 0 {
            let crowded = events > view.times.len() / 4 * 3 || self.grid.cell_log2 == COARSEST_LOG2;
            let least_log2 = self.grid.cell_log2.saturating_sub(u8::from(crowded)).max(2);
            let first = self.least_log2 == 0;
            self.least_log2 = if first { least_log2 } else { least_log2.min(self.least_log2) };
        }
        spectrum.clear();
        self.stage = Stage::Lags;
    }

    /// Collects once more, in other cells; a search in parts does so next time.
    // Not inlined: flash is short.
    #[inline(never)]
    fn other_cells(&mut self) {
        self.stage = Stage::Visits;
        if self.in_parts {
            self.done();
        }
    }

    pub(super) fn start_filling(&mut self, view: &mut View<'_>, scratch: &mut Scratch) {
        scratch.visits.clear(self.grid, view.times);
        self.filling = Some(Filling::default());
    }

    pub(super) fn lags(&mut self, view: &View<'_>, spectrum: &mut Spectrum, scratch: &mut Scratch) {
        let most_weight = if self.quarter == 0 { 1 } else { MOST_WEIGHT };
        let finer_log2 = if self.looked_for == For::Fast { FAST_LOG2 } else { 0 };
        if scratch.visits.step(spectrum.lags(), most_weight, finer_log2, view.times) {
            self.stage = Stage::Spectrum;
        }
    }

    pub(super) fn spectrum(
        &mut self,
        view: &mut View<'_>,
        spectrum: &mut Spectrum,
        scratch: &mut Scratch,
    ) {
        let fast = self.looked_for == For::Fast;
        let longest_us = view.window.duration_us >> if fast { FAST_LOG2 } else { 0 };
        self.lines = spectrum.lines(scratch.visits.chance(), longest_us);
        if fast {
            self.lines.reverse();
            self.stage = Stage::Fast;
            return;
        }
        let too_fine = self.lonely || self.finer && self.grid.cell_log2 < self.least_log2;
        if self.lines.is_empty()
            && too_fine
            && let Some(mut filling) = self.filled.take()
        {
            scratch.visits.place_in_coarser(&mut filling, view.times);
            self.filling = Some(filling);
            // Finer ones were tried.
            self.finer = true;
            self.stage = Stage::Visits;
            return;
        }
        self.lines.reverse();
        self.leave_out_lines();
        self.stage = Stage::Line;
    }

    /// Cells of at least this size for what is searched.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn cells_of(&self, view: &View<'_>, cell_log2: u8) -> CellGrid {
        let Some(number) = self.quarter.checked_sub(1) else { return view.grid };
        let CellGrid { columns, rows, .. } = view.grid;
        let half = |cells: usize| ((cells << view.grid.cell_log2) / 2) as u16;
        let (width_px, height_px) = (half(columns), half(rows));
        let (column, row) = (number % QUARTERS_A_SIDE, number / QUARTERS_A_SIDE);
        // Whatever their size, cells cover the same.
        let whole_cells = |px: u16| px.next_multiple_of(1 << COARSEST_LOG2);
        let geometry =
            Geometry { width_px: whole_cells(width_px), height_px: whole_cells(height_px) };
        CellGrid {
            x0: width_px / 2 * column as u16,
            y0: height_px / 2 * row as u16,
            ..CellGrid::fit(geometry, cell_log2, view.weights.len().min(VISIT_CELLS))
        }
    }

    /// Goes on with the next quarter of the picture, or ends.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn next_quarter(&mut self) {
        if self.quarter == QUARTERS || self.taken.is_full() {
            return self.end();
        }
        if self.quarter == 0 {
            self.looks = 0;
            self.tried.clear();
        }
        self.quarter += 1;
        self.quarter_looks = 0;
        self.grid = CellGrid::default();
        self.stage = Stage::Visits;
        if self.in_parts {
            self.done();
        }
    }

    /// Takes the next line up.
    pub(super) fn line(&mut self, view: &View<'_>, scratch: &mut Scratch) {
        let width_hz = SAME_LINE * 1e6 / view.window.duration_us.max(1) as f32;
        let Some(line) = self.lines.pop() else { return self.next_quarter() };
        let near = |tried: &&Line| (tried.hz - line.hz).abs() < width_hz;
        let as_high = |tried: &&Line| self.quarter == 0 || line.sigmas < HIGHER * tried.sigmas;
        let known = self.tried.iter().filter(near).filter(as_high).count();
        let (most, looks) =
            if self.quarter == 0 { (1, MAX_LINES) } else { (QUARTERS_A_LINE, QUARTER_LOOKS) };
        // What shakes or lights the whole picture does so in its quarters.
        let all_over = |hz: &f32| self.quarter > 0 && (hz - line.hz).abs() < width_hz;
        if known >= most || self.all_over.iter().any(all_over) {
            return;
        }
        if self.looks == looks {
            return self.end();
        }
        if self.quarter > 0 && self.quarter_looks == LOOKS_A_QUARTER {
            return self.next_quarter();
        }
        if self.looked {
            return self.done();
        }
        self.looked = self.in_parts;
        self.looks += 1;
        self.quarter_looks += 1;
        self.tried.push(line).ok();
        self.line = line;
        self.reach = 1;
        scratch.visits.start_map();
        self.stage = Stage::Map;
    }
}

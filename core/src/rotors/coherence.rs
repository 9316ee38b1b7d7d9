//! Where in the image events come in step with a frequency, and with which phase.
//!
//! Under a rotor every cell sees blades pass at one frequency; a background moved by the hand, noise and other
//! rotors do not. Weighing cells by how much of their events keeps step separates a rotor from all of these,
//! which counts alone cannot do.

use super::disc::Disc;
use crate::event::Geometry;
use crate::limits::{COHERENCE_CELLS, COHERENCE_COLUMNS};
use crate::math::{TAU, TurnRate, sqrt};
use crate::store::{Even, StoredEvent, Window};

/// Power over chance (1 for unrelated events) below which a cell counts as out of step.
const LEAST_POWER: f32 = 2.5;
/// Smallest side of a cell in pixels.
const FINEST_PX: f32 = 2.0;

/// The events of one cell and polarity as a phasor at the map's frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phasor {
    /// Centre of the cell in pixels.
    pub x_px: f32,
    /// Centre of the cell in pixels.
    pub y_px: f32,
    /// Sum of exp(-i 2 pi f t) over the events.
    pub re: f32,
    /// Imaginary part of the sum.
    pub im: f32,
    /// Number of events in step.
    pub amplitude: f32,
    /// Whether the events are ON events.
    pub on: bool,
}

impl Phasor {
    /// Squared distance from a disc's centre in pixels.
    #[must_use]
    pub fn distance2(&self, disc: &Disc) -> f32 {
        let (dx, dy) = (self.x_px - disc.x_px, self.y_px - disc.y_px);
        dx * dx + dy * dy
    }

    /// The same, as long as its amplitude: chance does not count.
    #[must_use]
    pub fn without_chance(self) -> Self {
        let norm = self.amplitude / sqrt(self.re * self.re + self.im * self.im);
        Self { re: self.re * norm, im: self.im * norm, ..self }
    }
}

/// A square of cells of any size, so that they are as fine as the map's memory allows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalGrid {
    /// Left and top edge in pixels.
    x0: u16,
    y0: u16,
    /// Cells in a row, and rows: at most [`COHERENCE_COLUMNS`].
    columns: u32,
    /// Side of a cell in pixels.
    cell_px: f32,
    /// Cells in a pixel, in parts of 2^-16.
    per_px: u32,
}

impl LocalGrid {
    /// The square of `half_px` about a point in cells of `cell_px`, or in as fine ones as there may be.
    #[must_use]
    pub fn around(x_px: f32, y_px: f32, half_px: f32, cell_px: f32) -> Self {
        let side_px = (2.0 * half_px).clamp(1.0, f32::from(Geometry::MAX_PX));
        let cell_px = cell_px.max(FINEST_PX).max(side_px / COHERENCE_COLUMNS as f32);
        Self {
            x0: (x_px - half_px).max(0.0) as u16,
            y0: (y_px - half_px).max(0.0) as u16,
            columns: (crate::math::ceil(side_px / cell_px) as u32).min(COHERENCE_COLUMNS as u32),
            cell_px,
            per_px: (65_536.0 / cell_px) as u32,
        }
    }

    /// Side of a cell in pixels.
    #[must_use]
    pub const fn cell_px(self) -> f32 {
        self.cell_px
    }

    /// The cell of a pixel, where it lies on the grid.
    #[inline]
    fn index(self, x: u16, y: u16) -> Option<usize> {
        // Left of the edge or above it wraps to a large number.
        let column = (u32::from(x.wrapping_sub(self.x0)) * self.per_px) >> 16;
        let row = (u32::from(y.wrapping_sub(self.y0)) * self.per_px) >> 16;
        let on_it = column < self.columns && row < self.columns;
        on_it.then(|| (row * self.columns + column) as usize)
    }

    /// Centre of a cell in pixels.
    fn centre(self, index: usize) -> (f32, f32) {
        let columns = (self.columns as usize).max(1);
        let along = |cells: usize| (cells as f32 + 0.5) * self.cell_px - 0.5;
        (f32::from(self.x0) + along(index % columns), f32::from(self.y0) + along(index / columns))
    }
}

/// Events in step with a frequency, cell by cell around one disc.
#[derive(Debug)]
pub struct Coherence {
    /// By polarity and cell.
    sums: [[(f32, f32); COHERENCE_CELLS]; 2],
    counts: [[u16; COHERENCE_CELLS]; 2],
}

impl Default for Coherence {
    fn default() -> Self {
        Self { sums: [[(0.0, 0.0); COHERENCE_CELLS]; 2], counts: [[0; COHERENCE_CELLS]; 2] }
    }
}

impl Coherence {
    /// Starts over.
    pub fn clear(&mut self) {
        self.sums = [[(0.0, 0.0); COHERENCE_CELLS]; 2];
        self.counts = [[0; COHERENCE_CELLS]; 2];
    }

    /// Fills the map for one frequency with the events on the grid, a segment a call; `true` once all are in it.
    pub fn fill(
        &mut self,
        window: &Window<'_>,
        grid: LocalGrid,
        line_hz: f32,
        even: &mut Even,
    ) -> bool {
        let mid_us = (window.duration_us / 2) as i32;
        let rate = TurnRate::from_rad_s(line_hz * TAU);
        let inside = |event: StoredEvent| grid.index(event.x(), event.y());
        even.step(window, usize::MAX, inside, |event, index| {
            let (sin, cos) = rate.after(event.since(window.start_us) - mid_us).sin_cos();
            let bank = usize::from(window.is_on(event));
            if let Some(sum) = self.sums[bank].get_mut(index) {
                sum.0 += cos;
                sum.1 -= sin;
                self.counts[bank][index] = self.counts[bank][index].saturating_add(1);
            }
        })
    }

    /// Phasors of all cells in step, row by row, OFF before ON.
    pub fn phasors(&self, grid: LocalGrid) -> impl Iterator<Item = Phasor> + Clone + '_ {
        (0..(grid.columns * grid.columns) as usize).flat_map(move |index| {
            [0, 1].into_iter().filter_map(move |bank| {
                let (re, im) = *self.sums[bank].get(index)?;
                let chance = f32::from(*self.counts[bank].get(index)?);
                let power = re * re + im * im;
                let (x_px, y_px) = grid.centre(index);
                (power > LEAST_POWER * chance).then(|| Phasor {
                    x_px,
                    y_px,
                    re,
                    im,
                    amplitude: sqrt(power - chance),
                    on: bank == 1,
                })
            })
        })
    }
}

//! Where in the image events come in step with a frequency, and with which phase.
//!
//! Under a rotor every cell sees blades pass at one frequency; a background moved by the hand, noise and other
//! rotors do not. Weighing cells by how much of their events keeps step separates a rotor from all of these,
//! which counts alone cannot do.

use super::heat::CellGrid;
use crate::limits::COHERENCE_CELLS;
use crate::math::{TAU, TurnRate, sqrt};
use crate::store::{Even, StoredEvent, Window};

/// Power over chance (1 for unrelated events) below which a cell counts as out of step.
const LEAST_POWER: f32 = 2.5;

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
        grid: CellGrid,
        line_hz: f32,
        even: &mut Even,
    ) -> bool {
        let mid_us = (window.duration_us / 2) as i32;
        let rate = TurnRate::from_rad_s(line_hz * TAU);
        let inside = |event: StoredEvent| {
            let (x, y) = (event.x(), event.y());
            grid.holds(x, y).then(|| grid.index(x, y))
        };
        even.step(window, usize::MAX, inside, |event, index| {
            let (sin, cos) = rate.after(event.since(window.start_us) - mid_us).sin_cos();
            let bank = usize::from(event.is_on());
            if let Some(sum) = self.sums[bank].get_mut(index) {
                sum.0 += cos;
                sum.1 -= sin;
                self.counts[bank][index] = self.counts[bank][index].saturating_add(1);
            }
        })
    }

    /// Phasors of all cells in step, row by row, OFF before ON.
    pub fn phasors(&self, grid: CellGrid) -> impl Iterator<Item = Phasor> + Clone + '_ {
        (0..grid.len().min(COHERENCE_CELLS)).flat_map(move |index| {
            [0, 1].into_iter().filter_map(move |bank| {
                let (re, im) = self.sums[bank][index];
                let chance = f32::from(self.counts[bank][index]);
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

//! Uniform grid for nearest neighbours: constant cost a query, no heap.

use super::slice::SlicePoint;
use crate::limits::{GRID_CELLS_SIDE, SLICE_POINTS};

const END: u16 = u16::MAX;
/// Smallest cell in pixels: finer cells would be empty.
const LEAST_CELL_PX: f32 = 3.5;

/// Points of one slice by cell, as linked lists.
#[derive(Debug)]
pub struct Grid {
    heads: [u16; GRID_CELLS_SIDE * GRID_CELLS_SIDE],
    next: [u16; SLICE_POINTS],
    cell_px: f32,
    half_px: f32,
}

impl Grid {
    /// No points. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self = Self {
        heads: [END; GRID_CELLS_SIDE * GRID_CELLS_SIDE],
        next: [END; SLICE_POINTS],
        cell_px: LEAST_CELL_PX,
        half_px: 0.0,
    };
}

/// How far apart two events are: time weighs `lambda_px_per_s` pixels a second.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Pixels that a second counts for. 0 = positions only.
    pub lambda_px_per_s: f32,
    /// Neighbours farther than this in pixels are no neighbours.
    pub reach_px: f32,
    /// Whether ON may match only ON.
    pub same_polarity: bool,
}

impl Grid {
    /// Sorts the points into cells; `reach_px` is the largest distance of a point from the centre.
    pub fn build(&mut self, points: &[SlicePoint], reach_px: f32) {
        self.half_px = reach_px + LEAST_CELL_PX;
        self.cell_px = (2.0 * self.half_px / GRID_CELLS_SIDE as f32).max(LEAST_CELL_PX);
        self.heads.fill(END);
        for (index, point) in points.iter().enumerate().take(SLICE_POINTS) {
            let cell = self.cell(point.y_px) * GRID_CELLS_SIDE + self.cell(point.x_px);
            self.next[index] = self.heads[cell];
            self.heads[cell] = index as u16;
        }
    }

    fn cell(&self, at_px: f32) -> usize {
        // Casting a negative float gives 0: points off the grid land in its border cells.
        (((at_px + self.half_px) / self.cell_px) as usize).min(GRID_CELLS_SIDE - 1)
    }

    /// The nearest point to `query` and its squared distance. Ties go to the point first visited, which
    /// depends on the points alone. Cost: about 10 cells and 15 distances of 10 instructions.
    #[must_use]
    pub fn nearest(
        &self,
        points: &[SlicePoint],
        query: SlicePoint,
        metric: &Metric,
    ) -> Option<(usize, f32)> {
        let (column, row) = (self.cell(query.x_px) as i32, self.cell(query.y_px) as i32);
        let mut best = (usize::MAX, metric.reach_px * metric.reach_px);
        let rings = (metric.reach_px / self.cell_px) as i32 + 1;
        for ring in 0..=rings {
            // Every cell of this ring is at least ring - 1 cells away.
            let closest = (ring - 1).max(0) as f32 * self.cell_px;
            if closest * closest > best.1 {
                break;
            }
            for y in row - ring..=row + ring {
                let edge = y == row - ring || y == row + ring;
                let step = if edge { 1 } else { (2 * ring).max(1) };
                let mut x = column - ring;
                while x <= column + ring {
                    self.visit(points, query, metric, (x, y), &mut best);
                    x += step;
                }
            }
        }
        (best.0 != usize::MAX).then_some(best)
    }

    fn visit(
        &self,
        points: &[SlicePoint],
        query: SlicePoint,
        metric: &Metric,
        (x, y): (i32, i32),
        best: &mut (usize, f32),
    ) {
        let side = 0..GRID_CELLS_SIDE as i32;
        if !side.contains(&x) || !side.contains(&y) {
            return;
        }
        let mut index = self.heads[y as usize * GRID_CELLS_SIDE + x as usize];
        while let Some(point) = points.get(usize::from(index)) {
            let (dx, dy) = (point.x_px - query.x_px, point.y_px - query.y_px);
            let dt = (point.tau_s - query.tau_s) * metric.lambda_px_per_s;
            let distance2 = dx * dx + dy * dy + dt * dt;
            if distance2 < best.1 && (point.on == query.on || !metric.same_polarity) {
                *best = (usize::from(index), distance2);
            }
            index = self.next[usize::from(index)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_brute_force() {
        let mut seed = 1_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 16_777_216.0
        };
        let mut point = || SlicePoint {
            x_px: random() * 120.0 - 60.0,
            y_px: random() * 120.0 - 60.0,
            tau_s: random() * 1e-3,
            on: random() > 0.5,
        };
        let points: Vec<_> = (0..SLICE_POINTS).map(|_| point()).collect();
        let mut grid = Grid::EMPTY;
        grid.build(&points, 85.0);
        let metric = Metric { lambda_px_per_s: 5e3, reach_px: 12.0, same_polarity: true };
        for _ in 0..2_000 {
            let query = point();
            let brute = points
                .iter()
                .filter(|p| p.on == query.on)
                .map(|p| {
                    let dt = (p.tau_s - query.tau_s) * 5e3;
                    (p.x_px - query.x_px).powi(2) + (p.y_px - query.y_px).powi(2) + dt * dt
                })
                .fold(f32::MAX, f32::min);
            match grid.nearest(&points, query, &metric) {
                Some((_, distance2)) => assert!((distance2 - brute).abs() < 1e-2),
                None => assert!(brute >= 143.9),
            }
        }
    }
}

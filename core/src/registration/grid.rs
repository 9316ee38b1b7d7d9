//! Uniform grid for nearest neighbours: constant cost a query, no heap.

use super::slice::SlicePoint;
use crate::limits::{GRID_CELLS_SIDE, SLICE_POINTS};
use crate::math::larger;

/// Smallest cell in pixels: finer cells would be empty.
const LEAST_CELL_PX: f32 = 2.0;
/// More than what rounding makes of the way to the edge of a cell, in pixels.
const ROUNDING_PX: f32 = 0.01;
const SIDE: usize = GRID_CELLS_SIDE;
/// A grid for each polarity.
const CELLS: usize = 2 * SIDE * SIDE;

/// Points of one slice, sorted by polarity and cell, row by row.
#[derive(Debug)]
pub struct Grid {
    /// Where each cell's points start in `order`; they end where the next cell's start.
    starts: [u16; CELLS + 1],
    order: [u16; SLICE_POINTS],
    /// The points in this order: place, and time in pixels.
    places: [[f32; 3]; SLICE_POINTS],
    metric: Metric,
    cell_px: f32,
    per_px: f32,
    half_px: f32,
}

impl Grid {
    /// No points. All zeros, so that neither flash nor stack holds a copy; sizes of cells come with the points.
    pub const EMPTY: Self = Self {
        starts: [0; CELLS + 1],
        order: [0; SLICE_POINTS],
        places: [[0.0; 3]; SLICE_POINTS],
        metric: Metric { lambda_px_per_s: 0.0, reach_px: 0.0 },
        cell_px: 0.0,
        per_px: 0.0,
        half_px: 0.0,
    };
}

/// How far apart two events of one polarity are: time weighs `lambda_px_per_s` pixels a second.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Pixels that a second counts for. 0 = positions only.
    pub lambda_px_per_s: f32,
    /// Neighbours farther than this in pixels are no neighbours.
    pub reach_px: f32,
}

impl Metric {
    fn place(&self, point: &SlicePoint) -> [f32; 3] {
        [point.x_px, point.y_px, point.tau_s * self.lambda_px_per_s]
    }
}

/// Whether points that are so far away at least may be nearer than the best.
fn may_be_nearer(apart_px: f32, best: (usize, f32)) -> bool {
    let least_px = larger(apart_px - ROUNDING_PX, 0.0);
    least_px * least_px <= best.1
}

impl Grid {
    /// Sorts the points into cells; `reach_px` is the largest distance of a point from the centre.
    pub fn build(&mut self, points: &[SlicePoint], reach_px: f32, metric: Metric) {
        self.metric = metric;
        self.half_px = reach_px + LEAST_CELL_PX;
        self.cell_px = (2.0 * self.half_px / SIDE as f32).max(LEAST_CELL_PX);
        self.per_px = 1.0 / self.cell_px;
        self.starts.fill(0);
        let points = &points[..points.len().min(SLICE_POINTS)];
        let place =
            |grid: &Self, point: &SlicePoint| grid.row(point) * SIDE + grid.cell(point.x_px);
        for point in points {
            self.starts[place(self, point)] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // Filled from its end, each cell's end becomes its start.
        for (index, point) in points.iter().enumerate().rev() {
            let start = &mut self.starts[place(self, point)];
            *start -= 1;
            let at = usize::from(*start);
            self.order[at] = index as u16;
            self.places[at] = metric.place(point);
        }
    }

    /// Row of the cells of the point's polarity.
    fn row(&self, point: &SlicePoint) -> usize {
        self.cell(point.y_px) + if point.on { SIDE } else { 0 }
    }

    fn cell(&self, at_px: f32) -> usize {
        // Casting a negative float gives 0: points off the grid land in its border cells.
        (((at_px + self.half_px) * self.per_px) as usize).min(SIDE - 1)
    }

    /// Index of the nearest point to `query`, and its squared distance. Ties go to the upper one, then to the one on the
    /// left, so that they depend neither on the cells nor on the sense of rotation.
    /// Cost: about 3 rows of cells and 10 distances of 12 instructions.
    #[must_use]
    pub fn nearest(&self, query: SlicePoint) -> Option<(usize, f32)> {
        let (column, row) = (self.cell(query.x_px), self.cell(query.y_px));
        let left_px = query.x_px + self.half_px - column as f32 * self.cell_px;
        let above_px = query.y_px + self.half_px - row as f32 * self.cell_px;
        let bank = if query.on { SIDE } else { 0 };
        let query = self.metric.place(&query);
        let reach_px = self.metric.reach_px;
        let mut best = (usize::MAX, reach_px * reach_px);
        // The cell and those around it, as far as they may hold something nearer; then ring after ring.
        let (left, right) = (column.saturating_sub(1), (column + 1).min(SIDE - 1));
        self.visit(query, bank + row, (left, right), &mut best);
        if row > 0 && may_be_nearer(above_px, best) {
            self.visit(query, bank + row - 1, (left, right), &mut best);
        }
        if row + 1 < SIDE && may_be_nearer(self.cell_px - above_px, best) {
            self.visit(query, bank + row + 1, (left, right), &mut best);
        }
        let rings = (reach_px * self.per_px) as usize + 1;
        for ring in 2..rings + 1 {
            // Every cell of this ring is at least ring - 1 cells away.
            let closest = (ring - 1) as f32 * self.cell_px;
            if closest * closest > best.1 {
                break;
            }
            let beyond = (closest + left_px, closest + above_px);
            self.visit_ring(query, (column, row, bank), ring, beyond, &mut best);
        }
        let index = self.order.get(best.0)?;
        Some((usize::from(*index), best.1))
    }

    /// Looks at the cells so many cells away, where those to the left, and above, are so far away.
    fn visit_ring(
        &self,
        query: [f32; 3],
        (column, row, bank): (usize, usize, usize),
        ring: usize,
        (left_px, above_px): (f32, f32),
        best: &mut (usize, f32),
    ) {
        // To the right, and below, they are as much nearer or farther as the query lies off its cell's middle.
        let across_px = (2 * ring - 1) as f32 * self.cell_px;
        let (right_px, below_px) = (across_px - left_px, across_px - above_px);
        let (left, right) = (column.checked_sub(ring), column + ring);
        let (above, below) = (row.checked_sub(ring), row + ring);
        let (first, last) = (left.unwrap_or(0), right.min(SIDE - 1));
        let between = above.map_or(0, |above| above + 1)..below.min(SIDE);
        let sides = [
            (above_px, above.map(|above| (above..above + 1, first, last))),
            (left_px, left.map(|left| (between.clone(), left, left))),
            (right_px, (right < SIDE).then_some((between, right, right))),
            (below_px, (below < SIDE).then_some((below..below + 1, first, last))),
        ];
        for (apart_px, side) in sides {
            if let Some((rows, from, to)) = side
                && may_be_nearer(apart_px, *best)
            {
                rows.for_each(|row| self.visit(query, bank + row, (from, to), best));
            }
        }
    }

    /// Looks at the cells of a row from the first to the second column.
    fn visit(
        &self,
        query: [f32; 3],
        row: usize,
        (from, to): (usize, usize),
        best: &mut (usize, f32),
    ) {
        let (from, to) = (row * SIDE + from, row * SIDE + to + 1);
        let (Some(start), Some(end)) = (self.starts.get(from), self.starts.get(to)) else { return };
        let (start, end) = (usize::from(*start), usize::from(*end));
        let Some(places) = self.places.get(start..end) else { return };
        for (at, [x, y, t]) in (start..).zip(places) {
            let (dx, dy, dt) = (x - query[0], y - query[1], t - query[2]);
            let distance2 = dx * dx + dy * dy + dt * dt;
            // One comparison tells of nearly all that they are farther.
            if distance2 <= best.1 && (distance2 < best.1 || self.precedes(at, best.0)) {
                *best = (at, distance2);
            }
        }
    }

    /// Whether a point comes before another one where both are as near.
    #[cold]
    fn precedes(&self, at: usize, other: usize) -> bool {
        let key = |at: usize| Some((self.places.get(at)?, self.order.get(at)?));
        let (Some(([x, y, _], order)), Some(([x2, y2, _], order2))) = (key(at), key(other)) else {
            return false;
        };
        y < y2 || y == y2 && (x < x2 || x == x2 && order < order2)
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
        let metric = Metric { lambda_px_per_s: 5e3, reach_px: 12.0 };
        // Many and few, whose neighbours are cells away; all on the grid, and most beside it.
        for (count, reach_px) in
            [(SLICE_POINTS, 85.0), (24, 85.0), (24, 30.0), (SLICE_POINTS, 30.0)]
        {
            let points: Vec<_> = (0..count).map(|_| point()).collect();
            let mut grid = Grid::EMPTY;
            grid.build(&points, reach_px, metric);
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
                match grid.nearest(query) {
                    Some((_, distance2)) => assert!((distance2 - brute).abs() < 1e-2),
                    None => assert!(brute >= 143.9),
                }
            }
        }
    }
}

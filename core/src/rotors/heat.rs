//! Heat map: events counted in cells of 4x4 pixels (paper, "Heatmap-based Stream-centroids Initialization").

use crate::event::{Geometry, PackedEvent};

/// Side of a cell as a power of two: 4 pixels, as in the paper.
const CELL_LOG2: u8 = 2;

/// Counts of all events by cell; they fade as time goes on.
#[derive(Debug)]
pub struct HeatMap<'m> {
    counts: &'m mut [u16],
    grid: CellGrid,
}

/// How pixels map to cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellGrid {
    /// Cells in a row.
    pub columns: usize,
    /// Rows of cells.
    pub rows: usize,
    /// Side of a cell in pixels, as a power of two.
    pub cell_log2: u8,
    /// Left edge of the grid in pixels.
    pub x0: u16,
    /// Top edge of the grid in pixels.
    pub y0: u16,
}

impl CellGrid {
    /// The finest grid, from cells of 2^`least_log2` pixels up, that fits `capacity` cells.
    #[must_use]
    pub const fn fit(geometry: Geometry, least_log2: u8, capacity: usize) -> Self {
        let mut cell_log2 = least_log2;
        loop {
            let side = 1 << cell_log2;
            let columns = (geometry.width_px as usize).div_ceil(side);
            let rows = (geometry.height_px as usize).div_ceil(side);
            if columns * rows <= capacity || cell_log2 >= 11 {
                return Self { columns, rows, cell_log2, x0: 0, y0: 0 };
            }
            cell_log2 += 1;
        }
    }

    /// The same area in cells of twice the side.
    #[must_use]
    pub const fn coarser(self) -> Self {
        Self {
            columns: self.columns.div_ceil(2),
            rows: self.rows.div_ceil(2),
            cell_log2: self.cell_log2 + 1,
            ..self
        }
    }

    /// Number of cells.
    #[must_use]
    pub const fn len(self) -> usize {
        self.columns * self.rows
    }

    /// Whether there is no cell.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Side of a cell in pixels.
    #[must_use]
    pub const fn cell_px(self) -> f32 {
        (1_u16 << self.cell_log2) as f32
    }

    /// Whether a pixel lies on the grid: quicker than its cell.
    #[must_use]
    #[inline]
    pub const fn holds(self, x: u16, y: u16) -> bool {
        // Left of the edge or above it wraps to a large number.
        (x.wrapping_sub(self.x0) as usize) < self.columns << self.cell_log2
            && (y.wrapping_sub(self.y0) as usize) < self.rows << self.cell_log2
    }

    /// The cell of a pixel; [`usize::MAX`] outside the grid.
    #[must_use]
    pub const fn index(self, x: u16, y: u16) -> usize {
        // Left of the edge or above it wraps to a large number.
        let column = (x.wrapping_sub(self.x0) >> self.cell_log2) as usize;
        let row = (y.wrapping_sub(self.y0) >> self.cell_log2) as usize;
        if column < self.columns && row < self.rows {
            row * self.columns + column
        } else {
            usize::MAX
        }
    }

    /// Centre of a cell in pixels.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn centre(self, index: usize) -> (f32, f32) {
        let half = 0.5 * (self.cell_px() - 1.0);
        let column = (index % self.columns) as f32;
        let row = (index / self.columns) as f32;
        (
            f32::from(self.x0) + column * self.cell_px() + half,
            f32::from(self.y0) + row * self.cell_px() + half,
        )
    }
}

/// Cells with a weight above a floor: what is clustered.
#[derive(Clone, Copy, Debug)]
pub struct Cells<'a> {
    /// Where the cells lie.
    pub grid: CellGrid,
    /// Their weights, row by row; 0 = not in use.
    pub weights: &'a [u8],
    /// Weights below this are not in use either.
    pub floor: u8,
}

impl<'a> Cells<'a> {
    /// Cells in use as (x px, y px, weight).
    pub fn iter(self) -> impl Iterator<Item = (f32, f32, f32)> + use<'a> {
        let Self { grid, weights, floor } = self;
        let used = weights.iter().enumerate().filter(move |(_, w)| **w >= floor.max(1));
        used.map(move |(index, weight)| {
            let (x, y) = grid.centre(index);
            (x, y, f32::from(*weight))
        })
    }
}

impl<'m> HeatMap<'m> {
    /// An empty map over the lent cells.
    pub fn new(counts: &'m mut [u16], geometry: Geometry) -> Self {
        let grid = CellGrid::fit(geometry, CELL_LOG2, counts.len());
        counts.fill(0);
        Self { counts, grid }
    }

    /// How pixels map to cells.
    #[must_use]
    pub const fn grid(&self) -> CellGrid {
        self.grid
    }

    /// Counts by cell, row by row.
    #[must_use]
    pub fn counts(&self) -> &[u16] {
        &self.counts[..self.grid.len().min(self.counts.len())]
    }

    /// Counts an event of a pixel on the sensor that stands for 2^`weight_log2`; a cell saturates at 65 535.
    #[inline]
    pub fn count(&mut self, event: PackedEvent, weight_log2: u8) {
        let CellGrid { columns, cell_log2, .. } = self.grid;
        let (x, y) = event.pixel();
        let cell = u32::from(y >> cell_log2) * columns as u32 + u32::from(x >> cell_log2);
        if let Some(count) = self.counts.get_mut(cell as usize) {
            *count = count.saturating_add(1 << weight_log2);
        }
    }

    /// Lets the map fade by one part in `window_segments`, for each of so many segments by which a window slid.
    #[inline(never)]
    pub fn fade(&mut self, segments: usize, window_segments: u16) {
        let parts = u32::from(window_segments.max(1));
        // Rounded up so, as `div_ceil` takes twice as long.
        let round_up = parts - 1;
        for count in self.counts.iter_mut().filter(|count| **count > 0) {
            let mut left = u32::from(*count);
            for _ in 0..segments {
                left -= (left + round_up) / parts;
            }
            *count = left as u16;
        }
    }

    /// Forgets everything, and covers a sensor of this size from now on.
    pub fn resize(&mut self, geometry: Geometry) {
        self.grid = CellGrid::fit(geometry, CELL_LOG2, self.counts.len());
        self.clear();
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.counts.fill(0);
    }
}

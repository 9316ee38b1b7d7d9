//! Heat map: events counted in cells of 4x4 pixels (paper, "Heatmap-based Stream-centroids Initialization").

use crate::event::Geometry;

/// Side of a cell as a power of two: 4 pixels, as in the paper.
const CELL_LOG2: u8 = 2;

/// Counts of all events, kept or thinned, by cell; cells of a sliding window fade with it.
#[derive(Debug)]
pub struct HeatMap<'m> {
    counts: &'m mut [u16],
    grid: CellGrid,
}

/// How pixels map to cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellGrid {
    /// Cells in a row.
    pub columns: usize,
    /// Rows of cells.
    pub rows: usize,
    /// Side of a cell in pixels, as a power of two: 2 unless the sensor has more cells than the memory.
    pub cell_log2: u8,
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
                return Self { columns, rows, cell_log2 };
            }
            cell_log2 += 1;
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

    /// The cell of a pixel.
    #[must_use]
    pub const fn index(self, x: u16, y: u16) -> usize {
        (y >> self.cell_log2) as usize * self.columns + (x >> self.cell_log2) as usize
    }

    /// Centre of a cell in pixels.
    #[must_use]
    pub fn centre(self, index: usize) -> (f32, f32) {
        let half = 0.5 * (self.cell_px() - 1.0);
        let column = (index % self.columns) as f32;
        let row = (index / self.columns) as f32;
        (column * self.cell_px() + half, row * self.cell_px() + half)
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

    /// Counts one event; a cell saturates at 65 535.
    pub fn add(&mut self, x: u16, y: u16) {
        if let Some(count) = self.counts.get_mut(self.grid.index(x, y)) {
            *count = count.saturating_add(1);
        }
    }

    /// Lets the map fade by one part in `window_segments`: called as each segment of a sliding window closes.
    pub fn fade(&mut self, window_segments: u16) {
        for count in self.counts.iter_mut() {
            *count -= count.div_ceil(window_segments);
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.counts.fill(0);
    }
}

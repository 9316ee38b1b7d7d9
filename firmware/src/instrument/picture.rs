//! What the camera sees, as brightness of the heat map's cells.

use evtach_core::limits::DEVICE_HEAT_CELLS;
use evtach_core::rotors::HeatMap;

/// Brightest level of a cell.
pub const BRIGHTEST: u8 = 15;

/// A picture in the heat map's cells, four bits each: 3.2 KB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    columns: u16,
    rows: u16,
    cell_log2: u8,
    pairs: [u8; DEVICE_HEAT_CELLS / 2],
}

impl Picture {
    /// No picture.
    pub const EMPTY: Self =
        Self { columns: 0, rows: 0, cell_log2: 0, pairs: [0; DEVICE_HEAT_CELLS / 2] };

    /// Takes the picture of a heat map; one with more cells than the device has gives none.
    ///
    /// Levels go with the square root of the count, so that a dim rotor shows beside a hot one; cells hotter than all
    /// but one in 64 share the top level, so that hot pixels do not darken the rest.
    pub fn take(&mut self, heat: &HeatMap<'_>) {
        let (grid, counts) = (heat.grid(), heat.counts());
        if grid.len() > DEVICE_HEAT_CELLS {
            *self = Self::EMPTY;
            return;
        }
        (self.columns, self.rows) = (grid.columns as u16, grid.rows as u16);
        self.cell_log2 = grid.cell_log2;
        let top = u32::from(hot(counts)).max(u32::from(BRIGHTEST));
        let level = |count: Option<&u16>| {
            let share = count.map_or(0, |count| u32::from(*count).min(top) * 225 / top);
            share.isqrt() as u8
        };
        for (pair, index) in self.pairs.iter_mut().zip((0..).step_by(2)) {
            *pair = level(counts.get(index)) | level(counts.get(index + 1)) << 4;
        }
    }

    /// Cells in a row.
    #[must_use]
    pub const fn columns(&self) -> usize {
        self.columns as usize
    }

    /// Rows of cells.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.rows as usize
    }

    /// Side of a cell in pixels of the sensor.
    #[must_use]
    pub const fn cell_px(&self) -> u16 {
        1 << self.cell_log2
    }

    /// Level of a cell, 0 to [`BRIGHTEST`]; 0 outside.
    #[must_use]
    pub fn level(&self, column: usize, row: usize) -> u8 {
        let index = row * self.columns() + column;
        let pair = self.pairs.get(index / 2).copied().unwrap_or(0);
        if index.is_multiple_of(2) { pair & 0x0F } else { pair >> 4 }
    }
}

/// The count, to a power of two, that one cell in 64 of those in use is above.
fn hot(counts: &[u16]) -> u16 {
    let mut by_size = [0_u32; 17];
    for count in counts.iter().filter(|count| **count > 0) {
        by_size[(u16::BITS - count.leading_zeros()) as usize] += 1;
    }
    let used: u32 = by_size.iter().sum();
    let mut above = 0;
    for (size, cells) in by_size.iter().enumerate().rev() {
        above += cells;
        if above * 64 > used {
            return (1_u32 << size).min(u32::from(u16::MAX)) as u16;
        }
    }
    0
}

#[cfg(test)]
mod tests {
    use evtach_core::{Geometry, PackedEvent, Polarity};

    use super::*;

    #[test]
    fn brighter_cells_have_higher_levels_and_a_hot_pixel_does_not_darken_the_rest() {
        let mut counts = [0; 200];
        let mut heat = HeatMap::new(&mut counts, Geometry { width_px: 40, height_px: 80 });
        for (x, events) in [(0, 10), (4, 100), (8, 200), (12, 60_000)] {
            for _ in 0..events {
                heat.count(PackedEvent::new(0, x, 8, Polarity::On), 0);
            }
        }
        // A rotor, beside which the hot pixel is one cell in a hundred.
        for cell in 0..100_u16 {
            for _ in 0..200 {
                let (x, y) = (cell % 10 * 4, 40 + cell / 10 * 4);
                heat.count(PackedEvent::new(0, x, y, Polarity::On), 0);
            }
        }
        let mut picture = Picture::EMPTY;
        picture.take(&heat);
        assert_eq!((picture.columns(), picture.rows(), picture.cell_px()), (10, 20, 4));
        let levels = [0, 1, 2, 3].map(|column| picture.level(column, 2));
        assert!(levels.is_sorted() && levels[0] > 0 && levels[2] > 10, "{levels:?}");
        assert_eq!(levels[3], BRIGHTEST);
        assert_eq!((picture.level(4, 2), picture.level(3, 0), picture.level(99, 99)), (0, 0, 0));
    }

    #[test]
    fn a_heat_map_larger_than_the_devices_gives_none() {
        let mut counts = [1; 4 * DEVICE_HEAT_CELLS];
        let heat = HeatMap::new(&mut counts, Geometry { width_px: 1280, height_px: 320 });
        let mut picture = Picture::EMPTY;
        picture.take(&heat);
        assert_eq!(picture, Picture::EMPTY);
    }
}

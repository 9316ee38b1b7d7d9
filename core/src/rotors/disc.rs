//! Discs: places where a rotor may turn.

use super::heat::Cells;
use super::kmeans::{Cluster, nearest};
use crate::math::sqrt;

/// Distance of outliers in median distances (paper, "Outliers Removal").
const OUTLIER_MEDIANS: f32 = 3.0;
/// Passes of outlier removal: each moves the centroid, which moves the median.
const OUTLIER_PASSES: u8 = 3;
/// Distance classes of one cell side each for medians and quantiles.
const CLASSES: usize = 128;
/// Share of the weight inside the radius.
const RADIUS_QUANTILE: f32 = 0.97;

/// A place where a rotor may turn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Disc {
    /// Centre in pixels.
    pub x_px: f32,
    /// Centre in pixels.
    pub y_px: f32,
    /// Radius in pixels.
    pub radius_px: f32,
}

impl Disc {
    /// Where a rotor's events lie on average, in radii.
    pub const MEAN_RADIUS: f32 = 0.7;

    /// Squared distance between the centres in px^2.
    #[must_use]
    pub fn distance2(&self, other: &Self) -> f32 {
        let (dx, dy) = (self.x_px - other.x_px, self.y_px - other.y_px);
        dx * dx + dy * dy
    }

    /// Whether the two overlap so much that they cannot be rotors side by side.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        let reach = 0.75 * (self.radius_px + other.radius_px);
        self.distance2(other) < reach * reach
    }
}

/// Turns a cluster into a disc, a pass a step: removes outliers beyond three median distances, then takes centroid and
/// radius of what remains.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sifting {
    index: usize,
    passes: u8,
    x_px: f32,
    y_px: f32,
}

impl Sifting {
    /// Starts with cluster `index`; `None` where there is none.
    #[must_use]
    pub fn new(clusters: &[Cluster], index: usize) -> Option<Self> {
        let Cluster { x_px, y_px, .. } = *clusters.get(index)?;
        Some(Self { index, passes: 0, x_px, y_px })
    }

    /// One pass over the cells; the disc at the last, or none where nothing remains.
    pub fn step(&mut self, cells: Cells<'_>, clusters: &[Cluster]) -> Sifted {
        let (grid, index, (at_x, at_y)) = (cells.grid, self.index, (self.x_px, self.y_px));
        let members = || cells.iter().filter(move |(x, y, _)| nearest(clusters, *x, *y).0 == index);
        let distance = |x: f32, y: f32| {
            let (dx, dy) = (x - at_x, y - at_y);
            dx * dx + dy * dy
        };
        let mut classes = [0.0_f32; CLASSES];
        for (x, y, weight) in members() {
            let class = (sqrt(distance(x, y)) / grid.cell_px()) as usize;
            classes[class.min(CLASSES - 1)] += weight;
        }
        let limit = OUTLIER_MEDIANS * quantile(&classes, 0.5) * grid.cell_px();
        let limit2 = limit * limit;
        let (mut sum_x, mut sum_y, mut mass) = (0.0, 0.0, 0.0);
        for (x, y, weight) in members().filter(|(x, y, _)| distance(*x, *y) <= limit2) {
            sum_x += x * weight;
            sum_y += y * weight;
            mass += weight;
        }
        if mass <= 0.0 {
            return Sifted::Nothing;
        }
        (self.x_px, self.y_px) = (sum_x / mass, sum_y / mass);
        self.passes += 1;
        if self.passes < OUTLIER_PASSES {
            return Sifted::Running;
        }
        let limit = (sqrt(limit2) / grid.cell_px()) as usize;
        classes[(limit + 1).min(CLASSES)..].fill(0.0);
        let radius_px = quantile(&classes, RADIUS_QUANTILE) * grid.cell_px();
        Sifted::Disc(Disc { x_px: self.x_px, y_px: self.y_px, radius_px })
    }
}

/// What a step of a sifting left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sifted {
    /// More steps to come.
    Running,
    /// Nothing remains.
    Nothing,
    /// What remains.
    Disc(Disc),
}

/// The quantile of a histogram of distance classes, in classes.
// Not inlined: flash is short.
#[inline(never)]
fn quantile(classes: &[f32; CLASSES], share: f32) -> f32 {
    let total: f32 = classes.iter().sum();
    let mut below = 0.0;
    for (class, weight) in classes.iter().enumerate() {
        if below + weight >= share * total && *weight > 0.0 {
            return class as f32 + (share * total - below) / weight;
        }
        below += weight;
    }
    CLASSES as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    use super::super::heat::CellGrid;

    const GRID: CellGrid = CellGrid { columns: 80, rows: 60, cell_log2: 2, x0: 0, y0: 0 };

    fn heat(inside: impl Fn(f32, f32) -> bool) -> [u8; 4800] {
        let mut weights = [0; 4800];
        for (index, weight) in weights.iter_mut().enumerate() {
            let (x, y) = GRID.centre(index);
            if inside(x, y) {
                *weight = 50;
            }
        }
        weights
    }

    fn one(weights: &[u8]) -> Disc {
        let cluster = Cluster { x_px: 150.0, y_px: 120.0, mass: 1.0 };
        let cells = Cells { grid: GRID, weights, floor: 0 };
        let clusters = [cluster];
        let mut sifting = Sifting::new(&clusters, 0).expect("a cluster");
        loop {
            match sifting.step(cells, &clusters) {
                Sifted::Running => {}
                Sifted::Nothing => return Disc::default(),
                Sifted::Disc(disc) => return disc,
            }
        }
    }

    #[test]
    fn the_radius_of_a_disc_is_found() {
        let weights = heat(|x, y| (x - 150.0).powi(2) + (y - 120.0).powi(2) < 3600.0);
        let found = one(&weights);
        assert!((found.radius_px - 60.0).abs() < 5.0, "{found:?}");
    }

    #[test]
    fn outliers_beyond_three_medians_do_not_move_the_centre() {
        let weights = heat(|x, y| {
            (x - 150.0).powi(2) + (y - 120.0).powi(2) < 900.0 || (x > 300.0 && y < 20.0)
        });
        let found = one(&weights);
        assert!((found.x_px - 150.0).abs() < 1.0, "{found:?}");
    }
}

//! Discs: places where a rotor may turn, and how round the heat around them is.

use super::heat::CellGrid;
use super::kmeans::{Cluster, nearest, weighted_cells};
use crate::math::{Turn, sqrt};

/// Distance of outliers in median distances (paper, "Outliers Removal").
const OUTLIER_MEDIANS: f32 = 3.0;
/// Passes of outlier removal: each moves the centroid, which moves the median.
const OUTLIER_PASSES: u8 = 3;
/// Distance classes of one cell side each for medians and quantiles.
const CLASSES: usize = 128;
/// Share of the weight inside the radius.
const RADIUS_QUANTILE: f32 = 0.97;
/// Angular harmonics in the roundness.
const HARMONICS: usize = 6;

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

/// A disc with the grounds to believe in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Candidate {
    /// Where.
    pub disc: Disc,
    /// Power of the angular harmonics 1 to 6 of its heat: 0 for a rotor seen whole, 0.3 and more for a
    /// rotor cut in two or two rotors taken for one.
    pub lopsided: f32,
    /// Weight of its cells.
    pub mass: f32,
}

/// Turns cluster `index` into a disc: removes outliers beyond three median distances, then takes centroid,
/// radius and roundness of what remains. `None` when nothing remains.
#[must_use]
pub fn candidate(
    grid: CellGrid,
    weights: &[u8],
    clusters: &[Cluster],
    index: usize,
) -> Option<Candidate> {
    let members = || {
        weighted_cells(grid, weights).filter(move |(x, y, _)| nearest(clusters, *x, *y).0 == index)
    };
    let cluster = clusters.get(index)?;
    let (mut x_px, mut y_px) = (cluster.x_px, cluster.y_px);
    let mut limit2 = f32::MAX;
    let mut classes = [0.0_f32; CLASSES];
    for _ in 0..OUTLIER_PASSES {
        let distance = |x: f32, y: f32| {
            let (dx, dy) = (x - x_px, y - y_px);
            dx * dx + dy * dy
        };
        classes = [0.0; CLASSES];
        for (x, y, weight) in members() {
            let class = (sqrt(distance(x, y)) / grid.cell_px()) as usize;
            classes[class.min(CLASSES - 1)] += weight;
        }
        let limit = OUTLIER_MEDIANS * quantile(&classes, 0.5) * grid.cell_px();
        limit2 = limit * limit;
        let (mut sum_x, mut sum_y, mut mass) = (0.0, 0.0, 0.0);
        for (x, y, weight) in members().filter(|(x, y, _)| distance(*x, *y) <= limit2) {
            sum_x += x * weight;
            sum_y += y * weight;
            mass += weight;
        }
        if mass <= 0.0 {
            return None;
        }
        (x_px, y_px) = (sum_x / mass, sum_y / mass);
    }
    let limit = (sqrt(limit2) / grid.cell_px()) as usize;
    classes[(limit + 1).min(CLASSES)..].fill(0.0);
    let radius_px = quantile(&classes, RADIUS_QUANTILE) * grid.cell_px();
    let disc = Disc { x_px, y_px, radius_px };
    let (lopsided, mass) = roundness(disc, members());
    Some(Candidate { disc, lopsided, mass })
}

/// Power of the angular harmonics of the heat around a disc's centre, and its weight.
fn roundness(disc: Disc, cells: impl Iterator<Item = (f32, f32, f32)>) -> (f32, f32) {
    let mut sums = [(0.0_f32, 0.0_f32); HARMONICS];
    let (mut mass, mut outer_mass) = (0.0, 0.0);
    let reach2 = disc.radius_px * disc.radius_px * 1.21;
    for (x, y, weight) in cells {
        let (dx, dy) = (x - disc.x_px, y - disc.y_px);
        let r2 = dx * dx + dy * dy;
        if r2 > reach2 {
            continue;
        }
        mass += weight;
        // Near the centre the angle of a cell means little.
        if r2 < reach2 * 0.09 {
            continue;
        }
        outer_mass += weight;
        let angle = Turn::of_vector(dy, dx);
        for (m, sum) in sums.iter_mut().enumerate() {
            let (sin, cos) = angle.times(m as u32 + 1).sin_cos();
            sum.0 += weight * cos;
            sum.1 += weight * sin;
        }
    }
    let power: f32 = sums.iter().map(|(re, im)| re * re + im * im).sum();
    (power / (outer_mass * outer_mass).max(1.0), mass)
}

/// The quantile of a histogram of distance classes, in classes.
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

    const GRID: CellGrid = CellGrid { columns: 80, rows: 60, cell_log2: 2 };

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

    fn one(weights: &[u8]) -> Candidate {
        let cluster = Cluster { x_px: 150.0, y_px: 120.0, mass: 1.0 };
        candidate(GRID, weights, &[cluster], 0).unwrap_or_default()
    }

    #[test]
    fn a_disc_is_round_and_its_radius_is_found() {
        let weights = heat(|x, y| (x - 150.0).powi(2) + (y - 120.0).powi(2) < 3600.0);
        let found = one(&weights);
        assert!(found.lopsided < 0.01, "{found:?}");
        assert!((found.disc.radius_px - 60.0).abs() < 5.0, "{found:?}");
    }

    #[test]
    fn half_a_disc_and_a_pair_are_not_round() {
        let half = heat(|x, y| (x - 150.0).powi(2) + (y - 120.0).powi(2) < 3600.0 && x > 150.0);
        assert!(one(&half).lopsided > 0.1);
        let pair = heat(|x, y| {
            ((x - 110.0).powi(2) + (y - 120.0).powi(2))
                .min((x - 190.0).powi(2) + (y - 120.0).powi(2))
                < 900.0
        });
        assert!(one(&pair).lopsided > 0.3);
    }

    #[test]
    fn outliers_beyond_three_medians_do_not_move_the_centre() {
        let weights = heat(|x, y| {
            (x - 150.0).powi(2) + (y - 120.0).powi(2) < 900.0 || (x > 300.0 && y < 20.0)
        });
        let found = one(&weights);
        assert!((found.disc.x_px - 150.0).abs() < 1.0, "{found:?}");
    }
}

//! K-means on heat map cells (paper, "Spatial Clustering on Event Streams"), seeded from the heat map.
//!
//! Clustering the cells with their weight gives the same centroids as clustering the events, at the cost of
//! a few thousand cells instead of 10^5 events.

use heapless::Vec;

use super::heat::Cells;
use crate::limits::MAX_CLUSTERS;
use crate::math::rough;

/// Share of the highest cell that a cell must exceed to become a seed (paper: epsilon = 0.3).
const SEED_SHARE: f32 = 0.3;
/// Sweeps after which the centroids count as settled.
const MAX_SWEEPS: u8 = 12;
/// Movement below which a centroid counts as settled, in pixels squared.
const SETTLED_PX2: f32 = 0.05;

/// How the seeds after the first are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Seeding {
    /// Largest mean distance to the seeds so far: the paper's rule.
    #[default]
    FarthestMean,
    /// Largest distance to the nearest seed so far: also right where the mean rule returns to the
    /// neighbourhood of a seed (rows of rotors, unequal speeds).
    FarthestNearest,
}

/// One cluster of cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cluster {
    /// Centroid in pixels.
    pub x_px: f32,
    /// Centroid in pixels.
    pub y_px: f32,
    /// Weight of the cells assigned to it.
    pub mass: f32,
}

impl Cluster {
    fn distance2(&self, x_px: f32, y_px: f32) -> f32 {
        let (dx, dy) = (x_px - self.x_px, y_px - self.y_px);
        dx * dx + dy * dy
    }
}

/// A clustering in progress.
#[derive(Debug, Default)]
pub struct KMeans {
    clusters: Vec<Cluster, MAX_CLUSTERS>,
    /// Weight that a cell must exceed to become a seed.
    floor: f32,
    sweeps: u8,
}

/// The cluster nearest to a point, and its squared distance.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn nearest(clusters: &[Cluster], x_px: f32, y_px: f32) -> (usize, f32) {
    let mut best = (0, f32::MAX);
    for (index, cluster) in clusters.iter().enumerate() {
        let distance2 = cluster.distance2(x_px, y_px);
        if distance2 < best.1 {
            best = (index, distance2);
        }
    }
    best
}

impl KMeans {
    /// Starts with the highest cell as the first seed; none where all are zero.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn seed(cells: Cells<'_>) -> Self {
        let mut highest = (0.0, 0.0, 0.0);
        for cell in cells.iter() {
            if cell.2 > highest.2 {
                highest = cell;
            }
        }
        let (x_px, y_px, top) = highest;
        let mut clusters = Vec::new();
        if top > 0.0 {
            clusters.push(Cluster { x_px, y_px, mass: 0.0 }).ok();
        }
        Self { clusters, floor: SEED_SHARE * top, sweeps: 0 }
    }

    /// Adds the farthest cell with more than 0.3 of the highest as a seed; `false` when there are `k` of at most
    /// [`MAX_CLUSTERS`], or no more are to be had.
    pub fn grow(&mut self, cells: Cells<'_>, k: usize, seeding: Seeding) -> bool {
        let clusters = &mut self.clusters;
        if clusters.is_empty() || clusters.len() >= k.min(MAX_CLUSTERS) {
            return false;
        }
        let mut best = (0.0_f32, 0.0, 0.0);
        for (x, y, weight) in cells.iter() {
            if weight <= self.floor {
                continue;
            }
            let far = match seeding {
                Seeding::FarthestMean => {
                    clusters.iter().map(|c| rough::sqrt(c.distance2(x, y))).sum()
                }
                Seeding::FarthestNearest => nearest(clusters, x, y).1,
            };
            if far > best.0 {
                best = (far, x, y);
            }
        }
        let found = best.0 > 0.0;
        if found {
            clusters.push(Cluster { x_px: best.1, y_px: best.2, mass: 0.0 }).ok();
        }
        found
    }

    /// One assignment and update of all centroids; `true` once they have settled.
    /// Cost: about 10 instructions a weighted cell and cluster.
    pub fn sweep(&mut self, cells: Cells<'_>) -> bool {
        let mut sums = [(0.0_f32, 0.0_f32, 0.0_f32); MAX_CLUSTERS];
        for (x, y, weight) in cells.iter() {
            let sum = &mut sums[nearest(&self.clusters, x, y).0];
            sum.0 += x * weight;
            sum.1 += y * weight;
            sum.2 += weight;
        }
        let mut moved2 = 0.0_f32;
        for (cluster, (sum_x, sum_y, mass)) in self.clusters.iter_mut().zip(sums) {
            cluster.mass = mass;
            if mass > 0.0 {
                let (x_px, y_px) = (sum_x / mass, sum_y / mass);
                moved2 = moved2.max(cluster.distance2(x_px, y_px));
                (cluster.x_px, cluster.y_px) = (x_px, y_px);
            }
        }
        self.sweeps += 1;
        moved2 < SETTLED_PX2 || self.sweeps >= MAX_SWEEPS
    }

    /// The clusters as they stand.
    #[must_use]
    pub fn clusters(&self) -> &[Cluster] {
        &self.clusters
    }
}

/// Davies-Bouldin index of a clustering (paper, "Choice of k"): small = compact clusters far apart.
///
/// `None` for fewer than two clusters, where the index does not exist. Distances by [`rough::sqrt`]: the
/// index decides between clusterings that differ by tens of percent.
#[must_use]
pub fn davies_bouldin(cells: Cells<'_>, clusters: &[Cluster]) -> Option<f32> {
    if clusters.len() < 2 {
        return None;
    }
    let mut spread = [(0.0_f32, 0.0_f32); MAX_CLUSTERS];
    for (x, y, weight) in cells.iter() {
        let (index, distance2) = nearest(clusters, x, y);
        spread[index].0 += weight * rough::sqrt(distance2);
        spread[index].1 += weight;
    }
    let dispersion = |i: usize| spread[i].0 / spread[i].1.max(1.0);
    let mut total = 0.0;
    for i in 0..clusters.len() {
        let mut worst = 0.0_f32;
        for (j, other) in clusters.iter().enumerate() {
            if i != j {
                let apart = rough::sqrt(clusters[i].distance2(other.x_px, other.y_px)).max(1e-3);
                worst = worst.max((dispersion(i) + dispersion(j)) / apart);
            }
        }
        total += worst;
    }
    Some(total / clusters.len() as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    use super::super::heat::CellGrid;

    const GRID: CellGrid = CellGrid { columns: 80, rows: 60, cell_log2: 2, x0: 0, y0: 0 };

    fn cells(weights: &[u8]) -> Cells<'_> {
        Cells { grid: GRID, weights, floor: 0 }
    }

    fn discs(list: &[(f32, f32, f32)]) -> [u8; 4800] {
        let mut weights = [0; 4800];
        for (index, weight) in weights.iter_mut().enumerate() {
            let (x, y) = GRID.centre(index);
            for (cx, cy, radius) in list {
                let (dx, dy) = (x - cx, y - cy);
                if dx * dx + dy * dy < radius * radius {
                    *weight = 100;
                }
            }
        }
        weights
    }

    fn cluster(weights: &[u8], k: usize, seeding: Seeding) -> KMeans {
        let mut kmeans = KMeans::seed(cells(weights));
        while kmeans.grow(cells(weights), k, seeding) {}
        while !kmeans.sweep(cells(weights)) {}
        kmeans
    }

    #[test]
    fn finds_the_centres_of_separate_discs_and_the_index_names_their_number() {
        let list = [(60.0, 60.0, 30.0), (200.0, 70.0, 30.0), (130.0, 180.0, 30.0)];
        let weights = discs(&list);
        for seeding in [Seeding::FarthestMean, Seeding::FarthestNearest] {
            let kmeans = cluster(&weights, 3, seeding);
            for (x, y, _) in list {
                assert!(nearest(kmeans.clusters(), x, y).1 < 9.0);
            }
        }
        let best = (2..=6)
            .map(|k| {
                let kmeans = cluster(&weights, k, Seeding::FarthestNearest);
                (k, davies_bouldin(cells(&weights), kmeans.clusters()).unwrap_or(f32::MAX))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        assert_eq!(best.map(|b| b.0), Some(3));
    }

    #[test]
    fn the_index_does_not_exist_for_one_cluster() {
        let weights = discs(&[(100.0, 100.0, 40.0)]);
        let kmeans = cluster(&weights, 1, Seeding::FarthestMean);
        assert_eq!(davies_bouldin(cells(&weights), kmeans.clusters()), None);
    }

    #[test]
    fn an_empty_map_has_no_clusters() {
        let weights = [0; 4800];
        let mut kmeans = KMeans::seed(cells(&weights));
        assert!(!kmeans.grow(cells(&weights), 3, Seeding::FarthestMean));
        assert!(kmeans.clusters().is_empty());
    }
}

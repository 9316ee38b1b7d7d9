//! A map that no single rotation explains, taken apart by K-means.

use super::look::is_one;
use super::{Clustering, Extraction, For, Scratch, Stage, View};
use crate::limits::MAX_CLUSTERS;
use crate::rotors::belief::believe;
use crate::rotors::disc::{Sifted, Sifting};
use crate::rotors::kmeans::{KMeans, Seeding, davies_bouldin};

impl Extraction {
    /// Splits the map into k clusters and keeps the clustering of the best index.
    pub(super) fn split(&mut self, view: &View<'_>) {
        let cells = self.cells(view);
        match self.clustering {
            Clustering::First => {
                self.kmeans = KMeans::seed(cells);
                self.clustering = Clustering::Seeds;
            }
            Clustering::Seeds => {
                if !self.kmeans.grow(cells, self.k, self.seeding) {
                    self.clustering = Clustering::Sweeps;
                }
            }
            Clustering::Sweeps => {
                if self.kmeans.sweep(cells) {
                    self.clustering = Clustering::Index;
                }
            }
            Clustering::Index => {
                let index = davies_bouldin(cells, self.kmeans.clusters());
                if let Some(index) = index.filter(|index| *index < self.best_index) {
                    self.best_index = index;
                    self.best.clear();
                    self.best.extend_from_slice(self.kmeans.clusters()).ok();
                }
                self.next_split();
            }
        }
    }

    /// Goes on with the next seeding, or one cluster more, or the best of all clusterings.
    pub(super) fn next_split(&mut self) {
        self.clustering = Clustering::First;
        if self.seeding == Seeding::FarthestMean {
            self.seeding = Seeding::FarthestNearest;
            return;
        }
        self.seeding = Seeding::FarthestMean;
        self.k += 1;
        if self.k > MAX_CLUSTERS {
            self.part = 0;
            self.parts.clear();
            self.start_part();
        }
    }

    /// Starts to look for the rotation that explains the next cluster.
    pub(super) fn start_part(&mut self) {
        match Sifting::new(&self.best, self.part) {
            Some(sifting) => {
                self.sifting = sifting;
                self.stage = Stage::Apart;
            }
            None => self.choose(),
        }
    }

    pub(super) fn apart(&mut self, view: &View<'_>) {
        match self.sifting.step(self.cells(view), &self.best) {
            Sifted::Running => {}
            Sifted::Nothing => self.next_part(),
            Sifted::Disc(part) => self.look(For::Part, part),
        }
    }

    pub(super) fn next_part(&mut self) {
        self.part += 1;
        self.start_part();
    }

    /// Takes the whole map for one rotor or its parts for several, whichever explains more events.
    pub(super) fn choose(&mut self) {
        let parts = core::mem::take(&mut self.parts);
        let apart: f32 = parts.iter().map(|part| part.explained).sum();
        match self.whole {
            Some(whole) if whole.explained > apart => self.take(whole),
            None if parts.is_empty() => {
                self.stage = Stage::Line;
                return;
            }
            _ => parts.into_iter().for_each(|part| self.take(part)),
        }
        self.stage = Stage::Visits;
    }

    /// One step of the look for the rotation of one cluster.
    pub(super) fn part(&mut self, scratch: &mut Scratch) {
        if scratch.explainer.step() {
            if let Some(one) = believe(&scratch.explainer, self.line.hz).filter(is_one) {
                self.parts.push(one).ok();
            }
            self.next_part();
        }
    }
}

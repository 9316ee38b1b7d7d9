//! Rotating objects extraction (paper, section "Rotating Objects Extraction").

mod belief;
pub mod coherence;
pub mod disc;
pub mod extraction;
pub mod heat;
pub mod kmeans;
pub mod lines;
pub mod sweep;
pub mod visits;
pub mod winding;

pub use coherence::Coherence;
pub use disc::Disc;
pub use extraction::{Extraction, Found};
pub use heat::{CellGrid, HeatMap};
pub use lines::Spectrum;
pub use visits::Visits;

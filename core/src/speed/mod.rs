//! Rotational speed estimation (paper, section "Rotational Speed Estimation").

pub mod angular;
pub mod around;
pub mod baseline;
pub mod filling;
pub mod folding;
pub mod initial;
pub mod measurement;
pub mod path;
pub mod phase;
pub mod polar;
pub mod pose;
pub mod queue;
pub mod statistics;
pub mod symmetry;
pub mod trend;

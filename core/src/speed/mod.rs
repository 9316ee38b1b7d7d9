//! Rotational speed estimation (paper, section "Rotational Speed Estimation").

pub mod baseline;
pub mod initial;
pub mod measurement;
pub mod phase;
pub mod polar;
pub mod scan;
pub mod statistics;
pub mod symmetry;

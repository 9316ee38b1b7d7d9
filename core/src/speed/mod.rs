//! Rotational speed estimation (paper, section "Rotational Speed Estimation").

pub mod phase;
pub mod polar;
pub mod scan;

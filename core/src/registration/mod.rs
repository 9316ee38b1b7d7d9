//! Registration of event slices: iterative closest point (paper, "Initial Estimation").

pub mod grid;
pub mod icp;
pub mod rigid;
pub mod slice;

pub use icp::{Icp, Progress, Registered, Residual};
pub use slice::{Cut, Slice, SlicePoint};

//! Prophesee RAW: a text header, then the sensor's own words (EVT2, EVT2.1, EVT3).

mod read;
mod write;

pub(crate) use read::open;
pub(crate) use write::{Evt2Writer, Evt3Writer};

//! Recordings, synthesiser and reports around `evtach-core`.

pub mod recording;
pub mod synth;

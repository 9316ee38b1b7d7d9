//! Recordings, synthesiser and reports around `evtach-core`.

pub mod device;
pub mod frame;
pub mod measure;
pub mod play;
pub mod recording;
pub mod report;
pub mod synth;
pub mod watch;

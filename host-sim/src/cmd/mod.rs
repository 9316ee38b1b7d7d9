//! One file per subcommand.

pub mod bench;
pub mod convert;
mod how;
pub mod info;
pub mod measure;
pub mod plot;
pub mod screen;
pub mod synth;
mod wait;
pub mod watch;

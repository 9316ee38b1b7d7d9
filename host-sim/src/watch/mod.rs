//! `evtach watch`: readings as they come, from a recording or a device, in the terminal.

mod draw;
mod monitor;
mod source;

pub use draw::draw;
pub use monitor::{Monitor, Told};
pub use source::{Source, SourceError, file, port};

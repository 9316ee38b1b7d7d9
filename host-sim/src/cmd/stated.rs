//! What a person states about a recording.

use evtach_core::Geometry;
use evtach_host::recording::{OpenOptions, TimeUnit, parse_geometry};

/// Options of every subcommand that reads a recording.
#[derive(clap::Args, Clone, Copy)]
pub struct Stated {
    /// Size of the sensor, where the recording does not say it or says it wrong.
    #[arg(long, value_name = "WxH", value_parser = parse_geometry)]
    geometry: Option<Geometry>,
    /// Unit of the times in a text or NumPy recording, where it does not say it or says it wrong.
    #[arg(long, value_name = "UNIT", value_enum)]
    time_unit: Option<TimeUnit>,
}

impl Stated {
    /// Its options, and whether each was stated.
    pub const fn which(self) -> [(&'static str, bool); 2] {
        [("--geometry", self.geometry.is_some()), ("--time-unit", self.time_unit.is_some())]
    }
}

impl From<Stated> for OpenOptions {
    fn from(stated: Stated) -> Self {
        Self { geometry: stated.geometry, time_unit: stated.time_unit }
    }
}

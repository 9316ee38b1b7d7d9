//! Writing CSV: `t,x,y,p` with a header line, microseconds, 0/1.

use std::io::Write;

use evtach_core::Event;

use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

pub(crate) struct CsvWriter {
    target: Target,
}

impl CsvWriter {
    pub(crate) fn new(mut target: Target) -> Result<Self, RecordingError> {
        target.write_all(b"t,x,y,p\n").map_err(RecordingError::Write)?;
        Ok(Self { target })
    }
}

impl Sink for CsvWriter {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        for event in events {
            writeln!(
                self.target,
                "{},{},{},{}",
                event.t_us, event.x, event.y, event.polarity as u8
            )
            .map_err(RecordingError::Write)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        self.target.flush().map_err(RecordingError::Write)
    }
}

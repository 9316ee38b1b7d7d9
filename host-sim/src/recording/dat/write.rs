//! Writing DAT.

use std::io::Write;

use evtach_core::{Event, Geometry};

use super::{RECORD_BYTES, TYPE_CD};
use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

pub(crate) struct DatWriter {
    target: Target,
    bytes: Vec<u8>,
    latest_us: u32,
}

impl DatWriter {
    pub(crate) fn new(mut target: Target, geometry: Geometry) -> Result<Self, RecordingError> {
        let header = format!(
            "% Data file containing CD events.\n% Version 2\n% Height {}\n% Width {}\n",
            geometry.height_px, geometry.width_px
        );
        target
            .write_all(header.as_bytes())
            .and_then(|()| target.write_all(&[TYPE_CD, RECORD_BYTES]))
            .map_err(RecordingError::Write)?;
        Ok(Self { target, bytes: Vec::new(), latest_us: 0 })
    }
}

impl Sink for DatWriter {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.bytes.clear();
        for event in events {
            let Ok(t) = u32::try_from(event.t_us) else {
                return Err(RecordingError::DoesNotFit {
                    format: "DAT",
                    what: format!("the time {} us", event.t_us),
                    advice: "let the recording begin at zero, with --rebase, or write a part of it with --end",
                });
            };
            // It would be read as time that wraps.
            if self.latest_us.saturating_sub(t) > u32::MAX / 2 {
                return Err(RecordingError::DoesNotFit {
                    format: "DAT",
                    what: format!("time that steps back from {} us to {t} us", self.latest_us),
                    advice: "write another format, or a part of it with --end",
                });
            }
            self.latest_us = self.latest_us.max(t);
            let address =
                u32::from(event.x) | u32::from(event.y) << 14 | (event.polarity as u32) << 28;
            self.bytes.extend_from_slice(&t.to_le_bytes());
            self.bytes.extend_from_slice(&address.to_le_bytes());
        }
        self.target.write_all(&self.bytes).map_err(RecordingError::Write)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        self.target.flush().map_err(RecordingError::Write)
    }
}

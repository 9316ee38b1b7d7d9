//! Writing Event Stream 2, type DVS.

use std::io::Write;

use evtach_core::{Event, Geometry};

use super::{MAGIC, TYPE_DVS, VERSION};
use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

/// Longest pause that is spelled out, one byte for each 127 us: about one day in 650 MB would be absurd, an hour in
/// 28 MB is not.
const MAX_PAUSE_US: u64 = 3_600_000_000;

pub(crate) struct EsWriter {
    target: Target,
    height_px: u16,
    last_us: u64,
    bytes: Vec<u8>,
}

impl EsWriter {
    pub(crate) fn new(mut target: Target, geometry: Geometry) -> Result<Self, RecordingError> {
        let [w0, w1] = geometry.width_px.to_le_bytes();
        let [h0, h1] = geometry.height_px.to_le_bytes();
        target
            .write_all(MAGIC)
            .and_then(|()| target.write_all(&VERSION))
            .and_then(|()| target.write_all(&[TYPE_DVS, w0, w1, h0, h1]))
            .map_err(RecordingError::Write)?;
        Ok(Self { target, height_px: geometry.height_px, last_us: 0, bytes: Vec::new() })
    }
}

impl Sink for EsWriter {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.bytes.clear();
        for event in events {
            let does_not_fit = |what: String, advice| {
                Err(RecordingError::DoesNotFit { format: "ES", what, advice })
            };
            let Some(mut step_us) = event.t_us.checked_sub(self.last_us) else {
                return does_not_fit(
                    format!("time that steps back (from {} us to {} us)", self.last_us, event.t_us),
                    "write AEDAT4, CSV or .npy, or sort the events first",
                );
            };
            if step_us > MAX_PAUSE_US {
                return does_not_fit(
                    format!("a pause of {step_us} us"),
                    "let the recording begin at zero, with --rebase, or write a part of it with --end",
                );
            }
            let Some(y) = (self.height_px - 1).checked_sub(event.y) else {
                return does_not_fit(
                    format!("the row {} on a sensor of {} rows", event.y, self.height_px),
                    "give the right --geometry",
                );
            };
            self.last_us = event.t_us;
            // 0xff passes 127 us; 0xfe is a filler, so 127 never goes with an event.
            while step_us >= 127 {
                self.bytes.push(0xff);
                step_us -= 127;
            }
            let [x0, x1] = event.x.to_le_bytes();
            let [y0, y1] = y.to_le_bytes();
            self.bytes.extend_from_slice(&[
                (step_us as u8) << 1 | event.polarity as u8,
                x0,
                x1,
                y0,
                y1,
            ]);
        }
        self.target.write_all(&self.bytes).map_err(RecordingError::Write)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        self.target.flush().map_err(RecordingError::Write)
    }
}

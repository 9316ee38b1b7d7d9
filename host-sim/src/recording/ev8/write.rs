//! Writing the device's recording.

use std::io::Write;

use evtach_core::{Event, Geometry};
use evtach_firmware::record::{self, Header};

use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

/// Longest step of time that 32 bits tell apart from its wrap, both ways.
const MAX_STEP_US: u64 = (1 << 31) - 1;
/// Rows that fit beside the polarity.
const ROWS: u16 = 1 << 15;

pub(crate) struct Ev8Writer {
    target: Target,
    header: Header,
    last_us: Option<u64>,
    bytes: Vec<u8>,
}

impl Ev8Writer {
    pub(crate) fn new(mut target: Target, geometry: Geometry) -> Result<Self, RecordingError> {
        if !target.can_patch() {
            return Err(does_not_fit(
                "a stream of unknown length: its header counts the events".to_owned(),
                "write it to a file, or write AEDAT4 or CSV to the pipe",
            ));
        }
        let header = Header { geometry, first_us: 0, events: 0 };
        target.write_all(&header.encode()).map_err(RecordingError::Write)?;
        Ok(Self { target, header, last_us: None, bytes: Vec::new() })
    }
}

fn does_not_fit(what: String, advice: &'static str) -> RecordingError {
    RecordingError::DoesNotFit { format: "EV8", what, advice }
}

impl Sink for Ev8Writer {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.bytes.clear();
        for event in events {
            let last_us = *self.last_us.get_or_insert_with(|| {
                self.header.first_us = event.t_us;
                event.t_us
            });
            if event.t_us.abs_diff(last_us) > MAX_STEP_US {
                return Err(does_not_fit(
                    format!("a step of time from {last_us} us to {} us", event.t_us),
                    "write AEDAT4, CSV or .npy",
                ));
            }
            if event.y >= ROWS {
                return Err(does_not_fit(
                    format!("the row {}", event.y),
                    "give the right --geometry",
                ));
            }
            self.last_us = Some(event.t_us);
            self.bytes.extend_from_slice(&record::encode(event));
        }
        let count = u32::try_from(events.len()).ok();
        let count =
            count.and_then(|count| self.header.events.checked_add(count)).ok_or_else(|| {
                does_not_fit(
                    "more than 4 294 967 295 events".to_owned(),
                    "cut it with --end, or write AEDAT4, CSV or .npy",
                )
            })?;
        self.header.events = count;
        self.target.write_all(&self.bytes).map_err(RecordingError::Write)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        let header = self.header.encode();
        self.target
            .patch(0, &header)
            .and_then(|()| self.target.flush())
            .map_err(RecordingError::Write)
    }
}

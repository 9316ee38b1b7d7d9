//! Writing a stream of frames, as a bridge sends it: words of EVT 2.

use std::io::Write as _;

use evtach_core::{Event, Geometry};
use evtach_firmware::sensor::spi::{Bridge, Kind};

use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

/// Largest column and row of a word.
const LARGEST: u16 = 0x7ff;

pub(crate) struct SpiWriter {
    target: Target,
    bridge: Bridge,
    bytes: Vec<u8>,
}

impl SpiWriter {
    pub(crate) fn new(target: Target, geometry: Geometry) -> Self {
        Self { target, bridge: Bridge::new(Kind::Evt2, geometry, "evtach"), bytes: Vec::new() }
    }
}

impl Sink for SpiWriter {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.bytes.clear();
        for event in events {
            if event.x > LARGEST || event.y > LARGEST {
                return Err(RecordingError::DoesNotFit {
                    format: "SPI",
                    what: format!("the pixel ({}, {})", event.x, event.y),
                    advice: "give the right --geometry",
                });
            }
            self.bridge.push(event, |frame| self.bytes.extend_from_slice(frame));
        }
        self.target.write_all(&self.bytes).map_err(RecordingError::Write)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        self.bytes.clear();
        self.bridge.end(|frame| self.bytes.extend_from_slice(frame));
        self.target.write_all(&self.bytes).map_err(RecordingError::Write)?;
        self.target.flush().map_err(RecordingError::Write)
    }
}

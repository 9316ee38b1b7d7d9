//! Writing a structured array: t u64 in microseconds, x u16, y u16, polarity as bool under the names p and on.

use std::io::Write;

use evtach_core::Event;

use super::MAGIC;
use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

/// Bytes of header with magic and padding: room for any count.
const HEADER_BYTES: usize = 192;

pub(crate) struct NpyWriter {
    target: Target,
    count: u64,
    bytes: Vec<u8>,
}

fn header(count: u64) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&((HEADER_BYTES - MAGIC.len() - 4) as u16).to_le_bytes());
    bytes.extend_from_slice(
        format!(
            "{{'descr': [('t', '<u8'), ('x', '<u2'), ('y', '<u2'), (('p', 'on'), '?')], 'fortran_order': False, 'shape': ({count},), }}"
        )
        .as_bytes(),
    );
    bytes.resize(HEADER_BYTES - 1, b' ');
    bytes.push(b'\n');
    bytes
}

impl NpyWriter {
    pub(crate) fn new(mut target: Target) -> Result<Self, RecordingError> {
        if !target.can_patch() {
            return Err(RecordingError::DoesNotFit {
                format: "NPY",
                what: "a stream of unknown length: its header counts the events".to_owned(),
                advice: "write it to a file, or write AEDAT4 or CSV to the pipe",
            });
        }
        target.write_all(&header(0)).map_err(RecordingError::Write)?;
        Ok(Self { target, count: 0, bytes: Vec::new() })
    }
}

impl Sink for NpyWriter {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.bytes.clear();
        for event in events {
            self.bytes.extend_from_slice(&event.t_us.to_le_bytes());
            self.bytes.extend_from_slice(&event.x.to_le_bytes());
            self.bytes.extend_from_slice(&event.y.to_le_bytes());
            self.bytes.push(event.polarity as u8);
        }
        self.count += events.len() as u64;
        self.target.write_all(&self.bytes).map_err(RecordingError::Write)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        let header = header(self.count);
        self.target
            .patch(0, &header)
            .and_then(|()| self.target.flush())
            .map_err(RecordingError::Write)
    }
}

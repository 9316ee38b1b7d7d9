//! Writing RAW.

use std::io::Write;

use evtach_core::{Event, Geometry, Polarity};

use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

/// Longest time that is written as a count of wraps from zero (EVT3: 16 384 wraps, about 76 hours).
const MAX_EVT3_US: u64 = 1 << 38;
const MAX_EVT2_US: u64 = 1 << 34;

fn header(evt: &str, name: &str, geometry: Geometry) -> String {
    let (width, height) = (geometry.width_px, geometry.height_px);
    format!(
        "% evt {evt}\n% format {name};height={height};width={width}\n% geometry {width}x{height}\n% end\n"
    )
}

fn check_order(format: &'static str, last_us: u64, event: &Event) -> Result<(), RecordingError> {
    if event.t_us < last_us {
        return Err(RecordingError::DoesNotFit {
            format,
            what: format!("time that steps back (from {last_us} us to {} us)", event.t_us),
            advice: "write AEDAT4, CSV or .npy, or sort the events first",
        });
    }
    Ok(())
}

fn too_late(format: &'static str, t_us: u64) -> RecordingError {
    RecordingError::DoesNotFit {
        format,
        what: format!("the time {t_us} us"),
        advice: "let the recording begin at zero, with --rebase, or write a part of it with --end",
    }
}

/// Writer of EVT 2.0.
pub(crate) struct Evt2Writer {
    target: Target,
    high: Option<u64>,
    last_us: u64,
    words: Vec<u8>,
}

impl Evt2Writer {
    pub(crate) fn new(mut target: Target, geometry: Geometry) -> Result<Self, RecordingError> {
        target
            .write_all(header("2.0", "EVT2", geometry).as_bytes())
            .map_err(RecordingError::Write)?;
        Ok(Self { target, high: None, last_us: 0, words: Vec::new() })
    }
}

impl Sink for Evt2Writer {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.words.clear();
        for event in events {
            check_order("EVT2", self.last_us, event)?;
            if event.t_us >= MAX_EVT2_US {
                return Err(too_late("EVT2", event.t_us));
            }
            self.last_us = event.t_us;
            let high = event.t_us >> 6;
            if self.high != Some(high) {
                self.words.extend_from_slice(&(0x8000_0000 | high as u32).to_le_bytes());
                self.high = Some(high);
            }
            let word = (event.polarity as u32) << 28
                | ((event.t_us & 0x3f) as u32) << 22
                | u32::from(event.x) << 11
                | u32::from(event.y);
            self.words.extend_from_slice(&word.to_le_bytes());
        }
        self.target.write_all(&self.words).map_err(RecordingError::Write)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        self.target.flush().map_err(RecordingError::Write)
    }
}

/// Writer of EVT 3.0: single-pixel words, one for each event, in the order given.
pub(crate) struct Evt3Writer {
    target: Target,
    high: Option<u64>,
    low: Option<u64>,
    y: Option<u16>,
    last_us: u64,
    words: Vec<u8>,
}

impl Evt3Writer {
    pub(crate) fn new(mut target: Target, geometry: Geometry) -> Result<Self, RecordingError> {
        target
            .write_all(header("3.0", "EVT3", geometry).as_bytes())
            .map_err(RecordingError::Write)?;
        Ok(Self { target, high: None, low: None, y: None, last_us: 0, words: Vec::new() })
    }

    fn push(&mut self, kind: u16, payload: u16) {
        self.words.extend_from_slice(&(kind << 12 | payload).to_le_bytes());
    }

    /// Announces the upper half of the clock. A reader counts the wraps of the 12 bits it sees, and some know a wrap
    /// only by 0xfff followed by 0: every wrap since the last event, from zero on, is spelled out that way.
    fn time_high(&mut self, high: u64) {
        let mut reached = self.high.unwrap_or(0);
        while high >> 12 > reached >> 12 {
            self.step_high(reached, reached | 0xfff);
            reached = (reached | 0xfff) + 1;
            self.push(0x8, 0);
        }
        self.step_high(reached, high);
        self.high = Some(high);
        self.low = None;
    }

    /// Goes forward within one turn of the counter, in steps of less than half a turn.
    fn step_high(&mut self, from: u64, to: u64) {
        if to - from > 0x7ff {
            self.push(0x8, (((from + to) / 2) & 0xfff) as u16);
        }
        self.push(0x8, (to & 0xfff) as u16);
    }
}

impl Sink for Evt3Writer {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.words.clear();
        for event in events {
            check_order("EVT3", self.last_us, event)?;
            if event.t_us >= MAX_EVT3_US {
                return Err(too_late("EVT3", event.t_us));
            }
            self.last_us = event.t_us;
            let high = event.t_us >> 12;
            let low = event.t_us & 0xfff;
            if self.high != Some(high) {
                self.time_high(high);
            }
            if self.low != Some(low) {
                self.push(0x6, low as u16);
                self.low = Some(low);
            }
            if self.y != Some(event.y) {
                self.push(0x0, event.y);
                self.y = Some(event.y);
            }
            let on = if event.polarity == Polarity::On { 0x800 } else { 0 };
            self.push(0x2, on | event.x);
        }
        self.target.write_all(&self.words).map_err(RecordingError::Write)
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        self.target.flush().map_err(RecordingError::Write)
    }
}

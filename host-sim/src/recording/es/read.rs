//! Reading Event Stream 2.

use evtach_core::{Event, Geometry, Polarity};

use super::{HEADER_BYTES, MAGIC, TYPE_ATIS, TYPE_DVS};
use crate::recording::error::{Place, RecordingError};
use crate::recording::geometry::KnownSize;
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

/// Bytes decoded in one go.
const CHUNK_BYTES: usize = 64 * 1024;
/// A pixel event: one byte of time and kind, x, y.
const EVENT_BYTES: usize = 5;

/// Opens the file.
pub(crate) fn open(mut input: Input) -> Result<Opened, RecordingError> {
    let damaged = |place: u64, what: &str| RecordingError::Damaged {
        format: "ES",
        place: Place::Byte(place),
        what: what.to_owned(),
    };
    let start = MAGIC.len();
    let head = input.peek(HEADER_BYTES)?;
    let Some(&[major, minor, patch, kind, w0, w1, h0, h1]) =
        head.get(start..).and_then(|rest| rest.first_chunk::<8>())
    else {
        return Err(damaged(start as u64, "the file ends inside its header"));
    };
    if major != 2 {
        return Err(RecordingError::Unsupported {
            what: format!("Event Stream version {major}.{minor}.{patch} is not read, only 2.x"),
            advice: "convert it with the tools of the event_stream project".to_owned(),
        });
    }
    if !matches!(kind, TYPE_DVS | TYPE_ATIS) {
        return Err(RecordingError::Unsupported {
            what: format!("Event Stream of type {kind} holds no brightness changes"),
            advice: "give a file of type DVS (1) or ATIS (2)".to_owned(),
        });
    }
    let (width, height) = (u16::from_le_bytes([w0, w1]), u16::from_le_bytes([h0, h1]));
    let Some(size) = Geometry::new(width, height) else {
        return Err(damaged(16, &format!("a sensor of {width}x{height} pixels")));
    };
    input.consume(HEADER_BYTES);
    Ok(Opened {
        format: "ES",
        geometry: Some(KnownSize::new(size, "from the header")),
        assumed: Vec::new(),
        about: vec![("version".to_owned(), format!("{major}.{minor}.{patch}"))],
        source: Box::new(Stream { input, atis: kind == TYPE_ATIS, height, t_us: 0 }),
    })
}

struct Stream {
    input: Input,
    atis: bool,
    height: u16,
    t_us: u64,
}

/// What a leading byte says.
enum Lead {
    /// So many microseconds pass.
    Pass(u64),
    /// A pixel event after so many microseconds.
    Pixel(u64, Polarity),
    /// An exposure measurement, which is no brightness change.
    Exposure(u64),
}

impl Lead {
    #[inline]
    const fn read(byte: u8, atis: bool) -> Self {
        if atis {
            return if byte >= 0xfc {
                Self::Pass(63 * (byte & 3) as u64)
            } else if byte & 1 == 0 {
                Self::Pixel(
                    (byte >> 2) as u64,
                    if byte & 2 == 0 { Polarity::Off } else { Polarity::On },
                )
            } else {
                Self::Exposure((byte >> 2) as u64)
            };
        }
        match byte {
            0xff => Self::Pass(127),
            0xfe => Self::Pass(0),
            _ => Self::Pixel(
                (byte >> 1) as u64,
                if byte & 1 == 0 { Polarity::Off } else { Polarity::On },
            ),
        }
    }
}

impl Source for Stream {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let bytes = self.input.peek(CHUNK_BYTES)?;
        let bytes = &bytes[..bytes.len().min(CHUNK_BYTES)];
        let last = bytes.len() < CHUNK_BYTES;
        let (atis, height) = (self.atis, self.height);
        let mut at = 0;
        let mut t_us = self.t_us;
        while let Some(&byte) = bytes.get(at) {
            let (step_us, polarity) = match Lead::read(byte, atis) {
                Lead::Pass(step_us) => {
                    t_us += step_us;
                    at += 1;
                    continue;
                }
                Lead::Pixel(step_us, polarity) => (step_us, Some(polarity)),
                Lead::Exposure(step_us) => (step_us, None),
            };
            let Some(&[_, x0, x1, y0, y1]) = bytes[at..].first_chunk::<EVENT_BYTES>() else {
                break;
            };
            t_us += step_us;
            at += EVENT_BYTES;
            if let Some(polarity) = polarity {
                // Rows are counted from the bottom.
                let y = (height - 1).checked_sub(u16::from_le_bytes([y0, y1]));
                events.push(Event {
                    t_us,
                    x: u16::from_le_bytes([x0, x1]),
                    y: y.unwrap_or(u16::MAX),
                    polarity,
                });
            }
        }
        let rest = bytes.len() - at;
        self.t_us = t_us;
        self.input.consume(at);
        if last {
            if rest > 0 {
                let offset = self.input.offset();
                side.notes.push(format!(
                    "the file ends inside an event: {rest} bytes at byte {offset} left out"
                ));
                self.input.consume(rest);
            }
            return Ok(false);
        }
        Ok(true)
    }
}

//! Reading DAT.

use evtach_core::{Event, Polarity};

use super::{RECORD_BYTES, TYPE_CD, TYPE_EVENT_2D};
use crate::recording::clock::Clock32;
use crate::recording::error::RecordingError;
use crate::recording::input::Input;
use crate::recording::prophesee_header::Header;
use crate::recording::{Opened, Side, Source};

/// Records decoded in one go.
const CHUNK_RECORDS: usize = 16 * 1024;

/// Whether the two bytes behind a `%` header are those of a DAT file with change events.
pub(crate) fn is_dat(kind: &[u8]) -> bool {
    matches!(kind, [TYPE_EVENT_2D | TYPE_CD, RECORD_BYTES, ..])
}

/// Opens a DAT file behind its header.
pub(crate) fn open(mut input: Input, header: Header) -> Opened {
    input.consume(header.length + 2);
    let geometry = header.geometry();
    // The first version of the format packs x into 9 bits and y into 8.
    let layout = match header.get("Version").and_then(|version| version.parse::<u32>().ok()) {
        Some(0 | 1) => Layout { x_bits: 9, y_bits: 8 },
        _ => Layout { x_bits: 14, y_bits: 14 },
    };
    let source = Box::new(Dat { input, layout, clock: Clock32::default() });
    Opened { format: "DAT", geometry, assumed: Vec::new(), about: header.fields, source }
}

#[derive(Clone, Copy)]
struct Layout {
    x_bits: u32,
    y_bits: u32,
}

struct Dat {
    input: Input,
    layout: Layout,
    clock: Clock32,
}

impl Source for Dat {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let bytes = self.input.peek(usize::from(RECORD_BYTES))?;
        let (records, rest) = bytes.as_chunks::<8>();
        let records = &records[..records.len().min(CHUNK_RECORDS)];
        if records.is_empty() {
            let rest = rest.len();
            if rest > 0 {
                let offset = self.input.offset();
                side.notes.push(format!(
                    "the file ends inside a record: {rest} bytes at byte {offset} left out"
                ));
                self.input.consume(rest);
            }
            return Ok(false);
        }
        let Layout { x_bits, y_bits } = self.layout;
        let (x_mask, y_mask) = ((1 << x_bits) - 1, (1 << y_bits) - 1);
        events.reserve(records.len());
        for &[t0, t1, t2, t3, a0, a1, a2, a3] in records {
            let t = u32::from_le_bytes([t0, t1, t2, t3]);
            let address = u32::from_le_bytes([a0, a1, a2, a3]);
            let on = (address >> (x_bits + y_bits)) & 1 == 1;
            events.push(Event {
                t_us: self.clock.advance(t, &mut side.wraps),
                x: (address & x_mask) as u16,
                y: ((address >> x_bits) & y_mask) as u16,
                polarity: if on { Polarity::On } else { Polarity::Off },
            });
        }
        let consumed = records.len() * usize::from(RECORD_BYTES);
        self.input.consume(consumed);
        Ok(true)
    }
}

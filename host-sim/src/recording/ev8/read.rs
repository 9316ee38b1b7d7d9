//! Reading the device's recording.

use evtach_core::Event;
use evtach_firmware::record::{Decoder, Header, HeaderError, RECORD_BYTES};

use crate::recording::error::{Place, RecordingError};
use crate::recording::geometry::KnownSize;
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

/// Bytes decoded in one go.
const CHUNK_BYTES: usize = 64 * 1024;

/// Opens the file.
pub(crate) fn open(mut input: Input) -> Result<Opened, RecordingError> {
    let damaged = |place: u64, what: String| RecordingError::Damaged {
        format: "EV8",
        place: Place::Byte(place),
        what,
    };
    let Some(bytes) = input.peek(Header::BYTES)?.first_chunk() else {
        return Err(damaged(8, "the file ends inside its header".to_owned()));
    };
    let header = Header::parse(bytes).map_err(|error| match error {
        HeaderError::Geometry { width_px, height_px } => {
            damaged(16, format!("a sensor of {width_px}x{height_px} pixels"))
        }
        HeaderError::Magic => damaged(0, "this is no recording of the device".to_owned()),
    })?;
    input.consume(Header::BYTES);
    let left = u64::from(header.events);
    Ok(Opened {
        format: "EV8",
        geometry: Some(KnownSize::new(header.geometry, "from the header")),
        assumed: Vec::new(),
        about: vec![("recorded by".to_owned(), "EV-Tach".to_owned())],
        source: Box::new(Stream { input, decoder: Decoder::new(header.first_us), left }),
    })
}

struct Stream {
    input: Input,
    decoder: Decoder,
    /// Events that the header speaks of and that have not been read.
    left: u64,
}

impl Source for Stream {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let bytes = self.input.peek(CHUNK_BYTES)?;
        let ended = bytes.len() < CHUNK_BYTES;
        let bytes = &bytes[..bytes.len().min(CHUNK_BYTES)];
        let wanted = usize::try_from(self.left).unwrap_or(usize::MAX);
        let (records, rest) = bytes.as_chunks::<RECORD_BYTES>();
        let records = &records[..records.len().min(wanted)];
        events.extend(records.iter().map(|&record| self.decoder.decode(record)));
        let (taken, rest) = (records.len(), rest.len());
        self.left -= taken as u64;
        self.input.consume(taken * RECORD_BYTES);
        let offset = self.input.offset();
        if self.left == 0 {
            if !self.input.peek(1)?.is_empty() {
                side.notes.push(format!(
                    "the header counts no more events: what follows at byte {offset} is left out"
                ));
            }
            return Ok(false);
        }
        if ended {
            let missing = self.left;
            side.notes.push(format!(
                "the file ends at byte {}, {missing} events before its header says so",
                offset + rest as u64
            ));
            return Ok(false);
        }
        Ok(true)
    }
}

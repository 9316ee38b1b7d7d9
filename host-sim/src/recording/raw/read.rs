//! Reading RAW.

use evtach_core::Event;
use evtach_core::decode::{Evt2, Evt3, Evt21};

use crate::recording::error::RecordingError;
use crate::recording::input::Input;
use crate::recording::prophesee_header::Header;
use crate::recording::{Opened, Side, Source};

/// Bytes decoded in one go.
const CHUNK_BYTES: usize = 64 * 1024;

/// Opens a RAW file behind its header.
pub(crate) fn open(mut input: Input, header: Header) -> Result<Opened, RecordingError> {
    input.consume(header.length);
    let encoding = header
        .format()
        .map(str::to_ascii_uppercase)
        .or_else(|| header.get("evt").map(|version| format!("EVT{version}")))
        .unwrap_or_default();
    let (format, source): (_, Box<dyn Source>) = match encoding.as_str() {
        "EVT3" | "EVT3.0" => ("EVT3", Box::new(Words::new(input, Evt3::new()))),
        "EVT2" | "EVT2.0" => ("EVT2", Box::new(Words::new(input, Evt2::new()))),
        "EVT21" | "EVT2.1" => {
            let swapped = is_swapped(&mut input, &header)?;
            ("EVT2.1", Box::new(Words::new(input, Evt21Bytes { decoder: Evt21::new(), swapped })))
        }
        _ => {
            return Err(RecordingError::Unsupported {
                what: format!("RAW encoding \"{encoding}\" is not read"),
                advice:
                    "convert it with Prophesee's metavision_file_to_csv, or re-encode it as EVT3"
                        .to_owned(),
            });
        }
    };
    let mut assumed = Vec::new();
    let geometry = header.geometry().map(|(geometry, sentence)| {
        assumed.push(sentence);
        geometry
    });
    Ok(Opened { format, geometry, assumed, about: header.fields, source })
}

/// What the word decoders of the core have in common.
trait Decoder: Send {
    const WORD_BYTES: usize;
    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>);
    fn report(&self, side: &mut Side);
}

impl Decoder for Evt2 {
    const WORD_BYTES: usize = 4;

    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>) {
        for word in words.as_chunks().0 {
            Self::decode(self, u32::from_le_bytes(*word), |event| events.push(event));
        }
    }

    fn report(&self, side: &mut Side) {
        side.wraps = u64::from(self.wraps());
        side.untimed = self.untimed();
    }
}

impl Decoder for Evt3 {
    const WORD_BYTES: usize = 2;

    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>) {
        for word in words.as_chunks().0 {
            Self::decode(self, u16::from_le_bytes(*word), |event| events.push(event));
        }
    }

    fn report(&self, side: &mut Side) {
        side.wraps = u64::from(self.wraps());
        side.untimed = self.untimed();
    }
}

/// EVT 2.1 with its byte order: sensors of the IMX636 generation send the upper half of a word first.
struct Evt21Bytes {
    decoder: Evt21,
    swapped: bool,
}

impl Decoder for Evt21Bytes {
    const WORD_BYTES: usize = 8;

    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>) {
        let half = if self.swapped { 32 } else { 0 };
        for word in words.as_chunks().0 {
            let word = u64::from_le_bytes(*word).rotate_left(half);
            self.decoder.decode(word, |event| events.push(event));
        }
    }

    fn report(&self, side: &mut Side) {
        side.wraps = u64::from(self.decoder.wraps());
        side.untimed = self.decoder.untimed();
    }
}

/// Whether the halves of EVT 2.1 words are swapped: as the header says, else as the first words make more sense.
fn is_swapped(input: &mut Input, header: &Header) -> Result<bool, RecordingError> {
    match header.format_option("endianness") {
        Some("legacy") => return Ok(true),
        Some(_) => return Ok(false),
        None => {}
    }
    let words = input.peek(CHUNK_BYTES)?.as_chunks::<8>().0;
    let time_words = |at: usize| words.iter().filter(|word| word[at] >> 4 == 0x8).count();
    Ok(time_words(3) > time_words(7))
}

struct Words<D> {
    input: Input,
    decoder: D,
}

impl<D: Decoder> Words<D> {
    const fn new(input: Input, decoder: D) -> Self {
        Self { input, decoder }
    }
}

impl<D: Decoder> Source for Words<D> {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let bytes = self.input.peek(D::WORD_BYTES)?;
        let whole = bytes.len().min(CHUNK_BYTES) / D::WORD_BYTES * D::WORD_BYTES;
        if whole == 0 {
            let rest = bytes.len();
            if rest > 0 {
                side.notes.push(format!(
                    "the file ends inside a word: {rest} bytes at byte {} left out",
                    self.input.offset()
                ));
                self.input.consume(rest);
            }
            return Ok(false);
        }
        events.reserve(whole / D::WORD_BYTES);
        self.decoder.decode(&bytes[..whole], events);
        self.input.consume(whole);
        self.decoder.report(side);
        Ok(true)
    }
}

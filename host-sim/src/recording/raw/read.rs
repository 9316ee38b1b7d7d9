//! Reading RAW.

use evtach_core::Event;
use evtach_core::decode::{Counts, Evt2, Evt3, Evt21};

use crate::recording::error::RecordingError;
use crate::recording::input::Input;
use crate::recording::prophesee_header::{Header, find_further};
use crate::recording::{Opened, Side, Source};

/// Bytes decoded in one go.
const CHUNK_BYTES: usize = 32 * 1024;
/// Bytes looked at behind a chunk, so that a header across its border is seen.
const OVERLAP_BYTES: usize = 2048;

/// Opens a RAW file behind its header.
pub(crate) fn open(mut input: Input, header: Header) -> Result<Opened, RecordingError> {
    input.consume(header.length);
    let encoding = encoding(&header);
    let (format, source): (_, Box<dyn Source>) = match encoding.as_str() {
        "EVT3" | "EVT3.0" => ("EVT3", Box::new(Words::new(input, Evt3::new(), encoding))),
        "EVT2" | "EVT2.0" => ("EVT2", Box::new(Words::new(input, Evt2::new(), encoding))),
        "EVT21" | "EVT2.1" => {
            let swapped = is_swapped(&mut input, &header)?;
            (
                "EVT2.1",
                Box::new(Words::new(
                    input,
                    Evt21Bytes { decoder: Evt21::new(), swapped },
                    encoding,
                )),
            )
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
    let geometry = header.geometry();
    Ok(Opened { format, geometry, assumed: Vec::new(), about: header.fields, source })
}

/// The encoding a header names.
fn encoding(header: &Header) -> String {
    header
        .format()
        .map(str::to_ascii_uppercase)
        .or_else(|| header.get("evt").map(|version| format!("EVT{version}")))
        .unwrap_or_default()
}

/// What the word decoders of the core have in common.
trait Decoder: Send {
    const WORD_BYTES: usize;
    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>);
    fn counts(&self) -> Counts;
    fn restart(&mut self);
}

impl Decoder for Evt2 {
    fn restart(&mut self) {
        *self = Self::new();
    }

    const WORD_BYTES: usize = 4;

    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>) {
        for word in words.as_chunks().0 {
            Self::decode(self, u32::from_le_bytes(*word), |event| events.push(event));
        }
    }

    fn counts(&self) -> Counts {
        Self::counts(self)
    }
}

impl Decoder for Evt3 {
    fn restart(&mut self) {
        *self = Self::new();
    }

    const WORD_BYTES: usize = 2;

    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>) {
        for word in words.as_chunks().0 {
            Self::decode(self, u16::from_le_bytes(*word), |event| events.push(event));
        }
    }

    fn counts(&self) -> Counts {
        Self::counts(self)
    }
}

/// EVT 2.1 with its byte order: sensors of the IMX636 generation send the upper half of a word first.
struct Evt21Bytes {
    decoder: Evt21,
    swapped: bool,
}

impl Decoder for Evt21Bytes {
    fn restart(&mut self) {
        self.decoder = Evt21::new();
    }

    const WORD_BYTES: usize = 8;

    fn decode(&mut self, words: &[u8], events: &mut Vec<Event>) {
        let half = if self.swapped { 32 } else { 0 };
        for word in words.as_chunks().0 {
            let word = u64::from_le_bytes(*word).rotate_left(half);
            self.decoder.decode(word, |event| events.push(event));
        }
    }

    fn counts(&self) -> Counts {
        self.decoder.counts()
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
    // Time words, and pixel words whose first column is a multiple of 32 as the format wants.
    let sensible = |half: u32| {
        let words = words.iter().map(|word| u64::from_le_bytes(*word).rotate_left(half));
        words.filter(|word| word >> 60 == 8 || word >> 60 <= 1 && (word >> 43) & 0x1f == 0).count()
    };
    Ok(sensible(32) > sensible(0))
}

struct Words<D> {
    input: Input,
    decoder: D,
    /// What the decoder told of the recordings before the one at hand.
    earlier: Counts,
    /// Name of the encoding, to compare with that of a further header.
    encoding: String,
    /// Data up to here has been searched for further headers.
    searched: u64,
}

impl<D: Decoder> Words<D> {
    fn new(input: Input, decoder: D, encoding: String) -> Self {
        Self { input, decoder, earlier: Counts::default(), encoding, searched: 0 }
    }

    /// What was told since the first recording began.
    fn counts(&self) -> Counts {
        let (earlier, now) = (self.earlier, self.decoder.counts());
        Counts {
            wraps: earlier.wraps.saturating_add(now.wraps),
            untimed: earlier.untimed + now.untimed,
            unknown: earlier.unknown + now.unknown,
        }
    }

    /// Goes past the header of a recording that was put behind the one before; `false` when it is data after all.
    fn further(&mut self, side: &mut Side) -> Result<bool, RecordingError> {
        let offset = self.input.offset();
        let header = Header::peek(&mut self.input)?;
        if encoding(&header) != self.encoding {
            return Ok(false);
        }
        self.input.consume(header.length);
        self.earlier = self.counts();
        self.decoder.restart();
        side.starts_anew = true;
        side.notes.push(format!("another recording begins at byte {offset}: its time starts anew"));
        Ok(true)
    }
}

impl<D: Decoder> Source for Words<D> {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let offset = self.input.offset();
        let bytes = self.input.peek(CHUNK_BYTES + OVERLAP_BYTES)?;
        let mut chunk = bytes.len().min(CHUNK_BYTES);
        let available = bytes.len();
        let last = available <= CHUNK_BYTES;
        if offset >= self.searched {
            let found = find_further(&bytes[..bytes.len().min(CHUNK_BYTES + OVERLAP_BYTES)]);
            match found.filter(|&at| at < chunk) {
                Some(0) => {
                    if self.further(side)? {
                        return Ok(true);
                    }
                    self.searched = offset + chunk as u64;
                    return Ok(true);
                }
                Some(at) => chunk = at,
                None => {}
            }
        }
        let whole = chunk / D::WORD_BYTES * D::WORD_BYTES;
        events.reserve(whole / D::WORD_BYTES);
        self.decoder.decode(&bytes[..whole], events);
        side.note(self.counts());
        let rest = chunk - whole;
        if rest > 0 {
            let at = offset + whole as u64;
            side.notes
                .push(format!("{rest} bytes at byte {at} left out: the data ends inside a word"));
        }
        self.input.consume(chunk);
        Ok(!last || chunk < available)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_earlier_recording_told_is_kept() {
        // A pixel before the time, a time that wraps, and a word of no type.
        let words = [0x1000_0000_u32, 0x8fff_ffff, 0x8000_0000, 0x7000_0000];
        let data: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let one = [b"% evt 2.0\n% geometry 640x480\n% end\n", data.as_slice()].concat();
        for recordings in [1, 3] {
            let mut input = Input::new(Box::new(std::io::Cursor::new(one.repeat(recordings))));
            let header = Header::peek(&mut input).expect("a header");
            let mut opened = open(input, header).expect("a RAW file");
            let (mut events, mut side) = (Vec::new(), Side::default());
            while opened.source.read(&mut events, &mut side).expect("no damage") {}
            let expected = recordings as u64;
            assert_eq!((side.wraps, side.untimed, side.unknown), (expected, expected, expected));
            assert_eq!(side.notes.len(), recordings - 1, "{:?}", side.notes);
        }
    }
}

//! The events in a frame.

use evtach_core::decode::{Evt2, Evt3};
use evtach_core::{Event, PackedEvent};

use super::frame::Kind;
use super::parser::Frame;
use crate::sensor::outlet::{self, Filled};

/// Most events that one word of EVT 3 stands for: a vector.
const VECTOR_EVENTS: usize = 12;

/// Span of the words' own clocks in microseconds.
const EVT2_SPAN_US: u64 = 1 << 34;
const EVT3_SPAN_US: u64 = 1 << 24;

/// The words of a frame, decoded one by one. Every frame begins with its time (EVT 3: and row), so a frame
/// that was lost takes nothing with it but its own events.
#[derive(Clone, Debug)]
pub struct Words<'f> {
    rest: &'f [u8],
    /// What the words' clock leaves out of the time.
    base_us: u64,
    /// Time of the first event.
    first_us: u64,
    decoder: Decoder,
}

#[derive(Clone, Debug)]
enum Decoder {
    Evt2(Evt2),
    Evt3(Evt3),
    /// The frame carries no words.
    None,
}

impl<'f> Words<'f> {
    /// The words of a frame.
    #[must_use]
    pub const fn new(frame: &Frame<'f>) -> Self {
        let (decoder, span_us) = match frame.header.kind {
            Kind::Evt2 => (Decoder::Evt2(Evt2::new()), EVT2_SPAN_US),
            Kind::Evt3 => (Decoder::Evt3(Evt3::new()), EVT3_SPAN_US),
            Kind::Hello | Kind::End => (Decoder::None, 1),
        };
        let first_us = frame.header.t_us;
        Self { rest: frame.payload, base_us: first_us & !(span_us - 1), first_us, decoder }
    }

    /// Most events that one of these words stands for: with fewer places, [`Words::pack`] does nothing.
    #[must_use]
    pub const fn most_events_a_word(&self) -> usize {
        match self.decoder {
            Decoder::Evt3(_) => VECTOR_EVENTS,
            Decoder::Evt2(_) | Decoder::None => 1,
        }
    }

    /// Packs events until the places may not do for another word, and returns how many.
    pub fn pack(&mut self, places: &mut [PackedEvent]) -> usize {
        match &mut self.decoder {
            Decoder::Evt2(decoder) => {
                // The clock of these words fills the low bits: nothing of the base is in them.
                let (words, events) = decoder.pack(self.rest.as_chunks().0, places);
                self.rest = self.rest.get(words * 4..).unwrap_or_default();
                events
            }
            Decoder::Evt3(decoder) => {
                let (words, events) = decoder.pack(self.rest.as_chunks().0, self.base_us, places);
                self.rest = self.rest.get(words * 2..).unwrap_or_default();
                events
            }
            Decoder::None => {
                self.rest = &[];
                0
            }
        }
    }

    /// Whether every word has been decoded.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        self.rest.is_empty()
    }

    /// Decodes at most `words` words and hands out their events.
    #[inline]
    pub fn decode(&mut self, words: usize, mut emit: impl FnMut(Event)) {
        let base_us = self.base_us;
        // Times that no sensor reaches may wrap.
        let mut place =
            |event: Event| emit(Event { t_us: base_us.wrapping_add(event.t_us), ..event });
        match &mut self.decoder {
            Decoder::Evt2(decoder) => {
                for word in take(&mut self.rest, words) {
                    decoder.decode(u32::from_le_bytes(*word), &mut place);
                }
            }
            Decoder::Evt3(decoder) => {
                for word in take(&mut self.rest, words) {
                    decoder.decode(u16::from_le_bytes(*word), &mut place);
                }
            }
            Decoder::None => self.rest = &[],
        }
    }
}

/// A bridge sends no gyro samples.
impl outlet::Words for Words<'_> {
    fn is_done(&self) -> bool {
        self.is_done()
    }

    fn fill(&mut self, space: &mut [PackedEvent]) -> Filled {
        Filled { events: self.pack(space), near_us: self.first_us, sample: None }
    }
}

/// Takes up to `words` words of `N` bytes off the front. A rest shorter than a word does not exist: the
/// header would not have been read.
fn take<'f, const N: usize>(rest: &mut &'f [u8], words: usize) -> &'f [[u8; N]] {
    let taken = rest.len().min(words.saturating_mul(N));
    let (now, later) = rest.split_at(taken);
    *rest = later;
    now.as_chunks().0
}

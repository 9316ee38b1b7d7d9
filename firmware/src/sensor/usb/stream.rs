//! From the bytes of transfers to events on one clock that never steps back.

use evtach_core::decode::{Davis, Dvxplorer, Mounting};
use evtach_core::{Event, GyroSample};

use super::model::Model;
use crate::sensor::outlet::Words;

/// Step of the time when the camera's clock begins anew: longer than any window, so that none spans it.
const GAP_US: u64 = 3_000_000;

/// The word by which the camera tells that its clock was set to zero.
const CLOCK_RESET: [u8; 2] = 1_u16.to_le_bytes();

/// Most events that one word of a DVXplorer stands for: a group of pixels.
const GROUP_EVENTS: usize = 8;

/// The words of a camera, and the time that they tell.
#[derive(Clone, Debug)]
pub(super) struct Stream {
    decoder: Decoder,
    /// What the camera's clock is behind ours.
    offset_us: u64,
    /// Time that has been reached.
    reached_us: u64,
    /// Times the camera's clock was set to zero.
    pub clock_resets: u32,
    /// Transfers that ended with half a word, which is left out.
    pub odd_bytes: u32,
}

#[derive(Clone, Debug)]
enum Decoder {
    Davis(Davis),
    Dvxplorer { words: Dvxplorer, swap_xy: bool },
}

impl Stream {
    /// The stream of a camera whose clock begins at zero, behind one that had come so far; `None`: the first one, whose
    /// times are the camera's own.
    pub const fn new(model: Model, mounting: Mounting, before_us: Option<u64>) -> Self {
        let decoder = match model {
            Model::Davis346 => Decoder::Davis(Davis::new(mounting)),
            Model::Dvxplorer => {
                Decoder::Dvxplorer { words: Dvxplorer::new(), swap_xy: mounting.swap_xy }
            }
        };
        let offset_us = match before_us {
            Some(us) => us.saturating_add(GAP_US),
            None => 0,
        };
        Self { decoder, offset_us, reached_us: offset_us, clock_resets: 0, odd_bytes: 0 }
    }

    /// Time that has been reached, in microseconds.
    pub const fn reached_us(&self) -> u64 {
        self.reached_us
    }

    /// Words that no such camera sends: damage.
    pub const fn unknown(&self) -> u64 {
        match &self.decoder {
            Decoder::Davis(words) => words.unknown(),
            Decoder::Dvxplorer { words, .. } => words.unknown(),
        }
    }

    /// The words of a transfer. The camera sends whole words, so that half a one is damage; the next transfer begins
    /// with a whole one again.
    pub fn words<'w>(&'w mut self, bytes: &'w [u8]) -> TransferWords<'w> {
        let (rest, half) = bytes.as_chunks();
        self.odd_bytes = self.odd_bytes.saturating_add(half.len() as u32);
        TransferWords { stream: self, rest }
    }

    fn reset(&mut self) {
        self.clock_resets = self.clock_resets.saturating_add(1);
        self.offset_us = self.reached_us.saturating_add(GAP_US);
        self.reached_us = self.offset_us;
    }
}

/// The words of one transfer.
pub(super) struct TransferWords<'w> {
    stream: &'w mut Stream,
    rest: &'w [[u8; 2]],
}

impl Words for TransferWords<'_> {
    fn most_events_a_word(&self) -> usize {
        match self.stream.decoder {
            Decoder::Davis(_) => 1,
            Decoder::Dvxplorer { .. } => GROUP_EVENTS,
        }
    }

    fn is_done(&self) -> bool {
        self.rest.is_empty()
    }

    #[inline]
    fn decode(&mut self, words: usize, mut emit: impl FnMut(Event)) -> Option<GyroSample> {
        let (now, later) = self.rest.split_at(words.min(self.rest.len()));
        let stream = &mut *self.stream;
        for (index, word) in now.iter().enumerate() {
            if *word == CLOCK_RESET {
                stream.reset();
            }
            let (offset_us, reached_us) = (stream.offset_us, &mut stream.reached_us);
            let mut place = |event: Event| {
                // A word that was damaged must not turn time back.
                *reached_us = (*reached_us).max(offset_us.saturating_add(event.t_us));
                emit(Event { t_us: *reached_us, ..event });
            };
            let word = u16::from_le_bytes(*word);
            let sample = match &mut stream.decoder {
                Decoder::Davis(decoder) => decoder.decode(word, place),
                Decoder::Dvxplorer { words, swap_xy: false } => {
                    words.decode(word, place);
                    None
                }
                Decoder::Dvxplorer { words, swap_xy: true } => {
                    words.decode(word, |event| place(Event { x: event.y, y: event.x, ..event }));
                    None
                }
            };
            if let Some(sample) = sample {
                let t_us = offset_us.saturating_add(sample.t_us);
                stream.reached_us = stream.reached_us.max(t_us);
                self.rest = &self.rest[index + 1..];
                return Some(GyroSample { t_us, ..sample });
            }
        }
        self.rest = later;
        None
    }
}

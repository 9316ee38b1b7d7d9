//! From the bytes of transfers to events on one clock that never steps back.

use evtach_core::PackedEvent;
use evtach_core::decode::{Davis, Dvxplorer, Mounting, Packed};

use super::model::Model;
use crate::sensor::outlet::{Filled, Words};

/// Step of the time when the camera's clock begins anew: longer than any window, so that none spans it.
const GAP_US: u64 = 3_000_000;

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
    Dvxplorer(Dvxplorer),
}

impl Stream {
    /// The stream of a camera whose clock begins at zero, behind one that had come so far; `None`: the first one, whose
    /// times are the camera's own.
    pub const fn new(model: Model, mounting: Mounting, before_us: Option<u64>) -> Self {
        let decoder = match model {
            Model::Davis346 => Decoder::Davis(Davis::new(mounting)),
            Model::Dvxplorer => Decoder::Dvxplorer(Dvxplorer::new(mounting)),
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
            Decoder::Dvxplorer(words) => words.unknown(),
        }
    }

    /// The words of a transfer. The camera sends whole words, so that half a one is damage; the next transfer begins
    /// with a whole one again.
    pub fn words<'w>(&'w mut self, bytes: &'w [u8]) -> TransferWords<'w> {
        let (rest, half) = bytes.as_chunks();
        self.odd_bytes = self.odd_bytes.saturating_add(half.len() as u32);
        TransferWords { stream: self, rest }
    }

    fn pack(&mut self, words: &[[u8; 2]], events: &mut [PackedEvent]) -> Packed {
        let (offset_us, reached_us) = (self.offset_us, &mut self.reached_us);
        match &mut self.decoder {
            Decoder::Davis(decoder) => decoder.pack(words, offset_us, reached_us, events),
            Decoder::Dvxplorer(decoder) => decoder.pack(words, offset_us, reached_us, events),
        }
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
    fn is_done(&self) -> bool {
        self.rest.is_empty()
    }

    fn fill(&mut self, space: &mut [PackedEvent]) -> Filled {
        let near_us = self.stream.reached_us;
        let packed = self.stream.pack(self.rest, space);
        if packed.reset {
            self.stream.reset();
        }
        self.rest = self.rest.get(packed.words..).unwrap_or_default();
        Filled { events: packed.events, near_us, sample: packed.sample }
    }
}

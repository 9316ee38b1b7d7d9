//! Prophesee EVT 2.0: one event in a 32-bit word.

use super::high::HighClock;
use super::{Counts, polarity};
use crate::event::{Event, PackedEvent};

/// Bits above them tell what a word is.
const PAYLOAD_BITS: u32 = 28;

/// Decoder of EVT 2.0 words (Prophesee, "EVT 2.0 format").
#[derive(Clone, Debug, Default)]
pub struct Evt2 {
    clock: HighClock,
    untimed: u64,
    unknown: u64,
}

impl Evt2 {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self { clock: HighClock::new(), untimed: 0, unknown: 0 }
    }

    /// Takes in one word and hands out the event in it, if any.
    #[inline]
    pub fn decode(&mut self, word: u32, mut emit: impl FnMut(Event)) {
        let kind = word >> PAYLOAD_BITS;
        match kind {
            0x0 | 0x1 => {
                let Some(base_us) = self.clock.base_us() else {
                    self.untimed += 1;
                    return;
                };
                emit(Event {
                    t_us: base_us | u64::from((word >> 22) & 0x3f),
                    x: ((word >> 11) & 0x7ff) as u16,
                    y: (word & 0x7ff) as u16,
                    polarity: polarity(kind == 1),
                });
            }
            0x8 => self.clock.set(word & 0x0fff_ffff),
            // Triggers and the vendor's own words carry no pixel.
            0xa | 0xe | 0xf => {}
            _ => self.unknown += 1,
        }
    }

    /// Takes in as many words as there are places, and packs their events. Returns the number of words and of events.
    // Not inlined: what calls it is built for size.
    #[inline(never)]
    pub fn pack(&mut self, words: &[[u8; 4]], places: &mut [PackedEvent]) -> (usize, usize) {
        let words = &words[..words.len().min(places.len())];
        let (mut taken, mut filled) = (0, 0);
        loop {
            // Nearly all words are events, and all that they need stays the same up to the next time.
            if let Some(base_us) = self.clock.base_us() {
                let run = pack_run(&words[taken..], &mut places[filled..], base_us as u32);
                taken += run;
                filled += run;
            }
            let Some(word) = words.get(taken) else { return (taken, filled) };
            // No event, or one before the first time.
            self.decode(u32::from_le_bytes(*word), drop);
            taken += 1;
        }
    }

    /// What the words told beside events.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        Counts { wraps: self.clock.wraps(), untimed: self.untimed, unknown: self.unknown }
    }
}

/// Packs events up to the first word that is none, and returns how many.
// Not inlined, so that all it needs stays in registers.
#[inline(never)]
fn pack_run(words: &[[u8; 4]], places: &mut [PackedEvent], base_us: u32) -> usize {
    let fours = words.as_chunks::<4>().0.iter().zip(places.as_chunks_mut::<4>().0);
    let mut run = 0;
    for (words, places) in fours {
        let words = words.map(u32::from_le_bytes);
        let [a, b, c, d] = words;
        if !is_event(a | b | c | d) {
            break;
        }
        *places = words.map(|word| pack(word, base_us));
        run += 4;
    }
    for (word, place) in words.iter().zip(places).skip(run) {
        let word = u32::from_le_bytes(*word);
        if !is_event(word) {
            break;
        }
        *place = pack(word, base_us);
        run += 1;
    }
    run
}

/// Whether a word is an event, or all of several whose bits it holds are.
#[inline(always)]
const fn is_event(word: u32) -> bool {
    word < 2 << PAYLOAD_BITS
}

#[inline(always)]
const fn pack(word: u32, base_us: u32) -> PackedEvent {
    PackedEvent::of_word(base_us | word >> 22 & 0x3f, word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Polarity;

    extern crate std;
    use std::vec::Vec;

    fn decode(words: &[u32]) -> (Vec<Event>, Evt2) {
        let mut decoder = Evt2::new();
        let mut events = Vec::new();
        for &word in words {
            decoder.decode(word, |event| events.push(event));
        }
        (events, decoder)
    }

    fn cd(on: u32, low: u32, x: u32, y: u32) -> u32 {
        on << 28 | low << 22 | x << 11 | y
    }

    #[test]
    fn fields_are_where_the_format_puts_them() {
        let (events, decoder) =
            decode(&[cd(1, 5, 7, 9), 8 << 28 | 3, cd(1, 5, 2047, 9), cd(0, 6, 7, 2047)]);
        assert_eq!(
            events,
            [
                Event { t_us: 3 * 64 + 5, x: 2047, y: 9, polarity: Polarity::On },
                Event { t_us: 3 * 64 + 6, x: 7, y: 2047, polarity: Polarity::Off },
            ]
        );
        assert_eq!(decoder.counts().untimed, 1);
    }

    #[test]
    fn clock_wraps_after_2_to_the_34() {
        let last = (1 << 28) - 1;
        let (events, decoder) = decode(&[8 << 28 | last, cd(0, 63, 1, 1), 8 << 28, cd(0, 0, 1, 1)]);
        assert_eq!(events[0].t_us, (1 << 34) - 1);
        assert_eq!(events[1].t_us, 1 << 34);
        assert_eq!(decoder.counts().wraps, 1);
    }

    #[test]
    fn small_step_back_is_no_wrap() {
        let (events, decoder) =
            decode(&[8 << 28 | 100, cd(0, 0, 1, 1), 8 << 28 | 99, cd(0, 0, 1, 1)]);
        assert_eq!(events[1].t_us, 99 * 64);
        assert_eq!(decoder.counts().wraps, 0);
    }
}

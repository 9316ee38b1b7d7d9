extern crate std;

use std::vec;
use std::vec::Vec;

use evtach_core::{Event, Geometry, Polarity};

use super::*;

mod accounting;
mod bus;
mod framing;

const GEOMETRY: Geometry = Geometry { width_px: 320, height_px: 320 };

/// Events a microsecond apart, with pauses that cross the clocks of both kinds of words.
fn events(count: u64) -> Vec<Event> {
    (0..count)
        .map(|index| Event {
            t_us: (1 << 34) - 2_000 + index + index / 1_000 * 9_000_000,
            x: (index * 7 % 320) as u16,
            y: (index / 3 % 320) as u16,
            polarity: if index % 3 == 0 { Polarity::On } else { Polarity::Off },
        })
        .collect()
}

/// The frames of a stream.
fn frames(kind: Kind, events: &[Event]) -> Vec<Vec<u8>> {
    let mut bridge = Bridge::new(kind, GEOMETRY, "test");
    let mut frames = Vec::new();
    for event in events {
        bridge.push(event, |frame| frames.push(frame.to_vec()));
    }
    bridge.end(|frame| frames.push(frame.to_vec()));
    frames
}

/// Reads bytes that come in pieces of `piece` bytes.
fn read(bytes: &[u8], piece: usize) -> (Vec<Event>, Account) {
    let mut parser = Parser::new();
    let (mut events, mut account) = (Vec::new(), Account::default());
    for mut piece in bytes.chunks(piece) {
        while !piece.is_empty() {
            let space = parser.space();
            let filled = space.len().min(piece.len());
            assert!(filled > 0, "no space left");
            space[..filled].copy_from_slice(&piece[..filled]);
            parser.filled(filled);
            piece = &piece[filled..];
            while let Some(frame) = parser.next_frame() {
                account.frame(&frame);
                let before = events.len();
                Words::new(&frame).decode(usize::MAX, |event| events.push(event));
                account.events((events.len() - before) as u32);
            }
        }
    }
    (events, account)
}

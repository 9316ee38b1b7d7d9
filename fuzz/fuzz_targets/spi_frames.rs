//! A stream from an SPI bridge, as the device parses it: a sound stream, damaged as the input says, in pieces as it says.
#![no_main]

use evtach_core::{Event, Geometry, Polarity};
use evtach_firmware::sensor::spi::{Account, Bridge, Kind, Parser, Words};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&first, data)) = data.split_first() else { return };
    let geometry = Geometry { width_px: 320, height_px: 320 };
    let mut bridge =
        Bridge::new(if first & 1 == 0 { Kind::Evt2 } else { Kind::Evt3 }, geometry, "fuzz");
    let (mut stream, mut sent) = (Vec::new(), Vec::new());
    let mut t_us = 0;
    // A byte is an event, and the time to the next.
    for (index, byte) in data.iter().enumerate().take(4096) {
        t_us += u64::from(*byte) * if byte & 1 == 0 { 1 } else { 100_000 };
        let event =
            Event { t_us, x: index as u16 % 320, y: u16::from(*byte), polarity: Polarity::On };
        bridge.push(&event, |frame| stream.extend_from_slice(frame));
        sent.push(event);
    }
    bridge.end(|frame| stream.extend_from_slice(frame));
    let whole = read(&stream, usize::from(first) + 1);
    assert_eq!(whole.0, sent);
    assert_eq!(whole.1.lost.total(), 0);

    // Three bytes are damage: where, and what.
    for damage in data.chunks_exact(3) {
        let at = usize::from(u16::from_le_bytes([damage[0], damage[1]])) % stream.len();
        stream[at] ^= damage[2];
    }
    let (received, account) = read(&stream, 64);
    assert!(received.len() <= sent.len() && account.received == received.len() as u64);
    assert!(account.sent() <= sent.len() as u64, "{account:?}");
    // And the input itself, as a stream.
    let _ = read(data, 64);
});

fn read(stream: &[u8], piece: usize) -> (Vec<Event>, Account) {
    let (mut parser, mut account, mut events) = (Parser::new(), Account::default(), Vec::new());
    for mut piece in stream.chunks(piece) {
        while !piece.is_empty() {
            let space = parser.space();
            let filled = space.len().min(piece.len());
            assert!(filled > 0);
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

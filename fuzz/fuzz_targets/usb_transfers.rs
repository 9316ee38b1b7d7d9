//! Transfers of a USB camera, as the device decodes them: a sound stream cut as the input says, the same with damage, and
//! the input itself.
#![no_main]

use evtach_core::{Event, Polarity};
use evtach_firmware::sensor::usb::Model;
use evtach_firmware::sensor::usb::emulated::{DavisWords, DvxplorerWords, decode};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&first, data)) = data.split_first() else { return };
    let davis = first & 1 == 0;
    let model = if davis { Model::Davis346 } else { Model::Dvxplorer };
    let (mut words, mut sent) = (Vec::new(), Vec::new());
    let (mut davis_words, mut dvxplorer_words) = (DavisWords::default(), DvxplorerWords::default());
    let mut t_us = 0;
    // A byte is an event, and the time to the next: up to many wraps of the words' clock.
    for (index, byte) in data.iter().enumerate().take(4096) {
        t_us += u64::from(*byte) * if byte & 1 == 0 { 1 } else { 10_000 };
        let polarity = if byte & 2 == 0 { Polarity::Off } else { Polarity::On };
        let event = Event { t_us, x: index as u16 % 346, y: u16::from(*byte), polarity };
        if davis {
            davis_words.event(&event, &mut words);
        } else {
            dvxplorer_words.event(&event, &mut words);
        }
        sent.push(event);
    }
    dvxplorer_words.flush(&mut words);
    let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let transfer = usize::from(first / 2 + 1) * 2;
    assert_eq!(decode(model, false, bytes.chunks(transfer)), (sent.clone(), 0));

    // Three bytes are damage: where, and what. Cut at any byte. Nothing is asked of the times: wrap words that are damage
    // may leap beyond the half hour within which a packed event's time is known.
    for damage in data.chunks_exact(3) {
        let at = usize::from(u16::from_le_bytes([damage[0], damage[1]])) % bytes.len();
        bytes[at] ^= damage[2];
    }
    for bytes in [&bytes[..], data] {
        let (events, _) = decode(model, true, bytes.chunks(transfer - 1));
        assert!(events.len() <= bytes.len() / 2 * if davis { 1 } else { 8 });
    }
});

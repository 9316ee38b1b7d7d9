use proptest::prelude::*;

use super::super::stream::Stream;
use super::*;
use crate::sensor::outlet::{Filled, Words as _};
use evtach_core::PackedEvent;
use evtach_core::decode::Mounting;

fn decode(stream: &mut Stream, bytes: &[u8], events: &mut Vec<Event>) {
    let mut words = stream.words(bytes);
    while !words.is_done() {
        let mut space = [PackedEvent::ZERO; 20];
        let Filled { events: count, mut near_us, .. } = words.fill(&mut space);
        for packed in &space[..count] {
            let event = packed.unpack(near_us);
            near_us = event.t_us;
            events.push(event);
        }
    }
}

proptest! {
    /// Whatever comes: time never goes back, every byte is accounted for, and there are not more events than words
    /// can tell.
    #[test]
    fn transfers_of_anything(
        transfers in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..200), 0..20),
        davis: bool,
        swap_xy: bool,
    ) {
        let model = if davis { Model::Davis346 } else { Model::Dvxplorer };
        let mut stream = Stream::new(model, Mounting { swap_xy, flip_gyro_z: false }, Some(7));
        let mut events = Vec::new();
        for bytes in &transfers {
            decode(&mut stream, bytes, &mut events);
        }
        let odd = transfers.iter().filter(|bytes| bytes.len() % 2 == 1).count();
        prop_assert_eq!(stream.odd_bytes as usize, odd);
        prop_assert!(events.windows(2).all(|pair| pair[0].t_us <= pair[1].t_us));
        prop_assert!(events.iter().all(|event| event.t_us <= stream.reached_us()));
        let words: usize = transfers.iter().map(|bytes| bytes.len() / 2).sum();
        let most = if davis { 1 } else { 8 };
        prop_assert!(events.len() <= words * most);
    }

    /// However a stream is cut into transfers, between words, the same events come.
    #[test]
    fn cuts_between_words_change_nothing(cuts in proptest::collection::vec(1..600_usize, 1..40), davis: bool) {
        let model = if davis { Model::Davis346 } else { Model::Dvxplorer };
        let events = events(model, 3_000, 30_000);
        let mut camera = Camera::new(model, events.clone());
        for (module, parameter) in [
            (Module::Mux, 0), (Module::Mux, 1), (Module::Mux, 3), (Module::Dvs, 3), (Module::Usb, 0), (Module::Chip, 0x3000),
        ] {
            let [m, _] = (module as u16).to_le_bytes();
            let [p0, p1] = (parameter as u16).to_le_bytes();
            camera.vendor(&[0x40, 0xbf, m, 0, p0, p1, 4, 0], &[0, 0, 0, 1]).expect("a register");
        }
        camera.run_until(1_000_000);
        let mut bytes = Vec::new();
        while let emulated::Packet::Data(packet) = camera.packet() {
            bytes.extend(packet);
        }
        let mut stream = Stream::new(model, Mounting::default(), None);
        let mut decoded = Vec::new();
        let mut rest = &bytes[..];
        for cut in cuts.iter().cycle() {
            let (now, later) = rest.split_at((cut * 2).min(rest.len()));
            decode(&mut stream, now, &mut decoded);
            rest = later;
            if rest.is_empty() {
                break;
            }
        }
        prop_assert_eq!(decoded, events);
    }
}

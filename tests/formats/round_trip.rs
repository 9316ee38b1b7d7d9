//! What is written is read back: every event, in order, through every format that is written.

#[path = "scratch.rs"]
#[expect(dead_code, reason = "shared with other tests")]
mod scratch;

use evtach_core::{Event, Geometry};
use evtach_host::recording::write::{self, WriteFormat};
use proptest::prelude::*;
use scratch::{Scratch, event, read};

const GEOMETRY: Geometry = Geometry { width_px: 1280, height_px: 720 };

fn through(format: WriteFormat, events: &[Event]) -> (Vec<Event>, Geometry) {
    let scratch = Scratch::new();
    let file = scratch.file(format.as_str());
    let mut writer =
        write::create(&file, format, GEOMETRY).expect("a file in the temporary folder");
    // In unequal pieces, as a stream comes.
    for piece in events.chunks(777) {
        writer.write(piece).expect("events that fit");
    }
    writer.finish().expect("room on the disk");
    let found = read(&file, None).expect("what was written");
    assert!(found.error.is_none(), "{:?}", found.error);
    assert_eq!(found.recording.side().notes, [""; 0]);
    (found.events, found.recording.geometry)
}

/// Events in time order whose gaps reach beyond every clock that wraps.
fn events() -> impl Strategy<Value = Vec<Event>> {
    let gap = prop_oneof![
        6 => 0_u64..40,
        2 => 40_u64..10_000,
        1 => 10_000_u64..80_000_000,
    ];
    prop::collection::vec((gap, 0_u16..1280, 0_u16..720, any::<bool>()), 1..300).prop_map(|rows| {
        let mut t_us = 0;
        rows.into_iter()
            .map(|(gap_us, x, y, on)| {
                t_us += gap_us;
                event(t_us, x, y, on)
            })
            // The 32-bit time of DAT ends here.
            .filter(|event| event.t_us < 1 << 32)
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn nothing_is_lost(events in events()) {
        for format in WriteFormat::ALL {
            let (read, geometry) = through(format, &events);
            prop_assert_eq!(&read, &events, "{}", format.as_str());
            if !matches!(format, WriteFormat::Csv | WriteFormat::Npy) {
                prop_assert_eq!(geometry, GEOMETRY);
            }
        }
    }
}

#[test]
fn long_recordings_cross_every_packet_and_chunk_border() {
    let events: Vec<Event> = (0..100_000_u32)
        .map(|index| {
            event(
                u64::from(index) * 3,
                (index % 1280) as u16,
                (index / 7 % 720) as u16,
                index % 3 == 0,
            )
        })
        .collect();
    for format in WriteFormat::ALL {
        assert!(through(format, &events).0 == events, "{}", format.as_str());
    }
}

#[test]
fn time_that_steps_back_is_kept_where_the_format_can_hold_it() {
    let at = |t_us| event(t_us, 1, 2, true);
    let events = [at(50), at(40), at(60)];
    for format in [
        WriteFormat::Dat,
        WriteFormat::Aedat4,
        WriteFormat::Csv,
        WriteFormat::Npy,
        WriteFormat::Spi,
        WriteFormat::Ev8,
    ] {
        assert_eq!(through(format, &events).0, events, "{}", format.as_str());
    }
    for format in [WriteFormat::Evt2, WriteFormat::Evt3, WriteFormat::Es] {
        let scratch = Scratch::new();
        let mut writer =
            write::create(&scratch.file(format.as_str()), format, GEOMETRY).expect("a file");
        let error = writer.write(&events).expect_err("holds no step back").to_string();
        assert!(error.contains("help:"), "{error}");
    }
}

//! What is written is read back: every event, in order, through every format that is written.

use std::path::PathBuf;

use evtach_core::{Event, Geometry, Polarity};
use evtach_host::recording::write::{self, WriteFormat};
use evtach_host::recording::{self, OpenOptions};
use proptest::prelude::*;

/// A file that goes away with its value.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let unique =
            format!("evtach-{}-{:?}-{name}", std::process::id(), std::thread::current().id());
        Self(std::env::temp_dir().join(unique))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

const GEOMETRY: Geometry = Geometry { width_px: 1280, height_px: 720 };

fn through(format: WriteFormat, events: &[Event]) -> (Vec<Event>, Geometry) {
    let file = Scratch::new(format.as_str());
    let mut writer =
        write::create(&file.0, format, GEOMETRY).expect("a file in the temporary folder");
    // In unequal pieces, as a stream comes.
    for piece in events.chunks(777) {
        writer.write(piece).expect("events that fit");
    }
    writer.finish().expect("room on the disk");
    let mut recording =
        recording::open(&file.0, &OpenOptions::default()).expect("what was written");
    let mut read = Vec::new();
    while recording.read_chunk(&mut read).expect("what was written") {}
    assert_eq!(recording.side().notes, [""; 0]);
    (read, recording.geometry)
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
                Event { t_us, x, y, polarity: if on { Polarity::On } else { Polarity::Off } }
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
            if format != WriteFormat::Csv {
                prop_assert_eq!(geometry, GEOMETRY);
            }
        }
    }
}

#[test]
fn long_recordings_cross_every_packet_and_chunk_border() {
    let events: Vec<Event> = (0..100_000_u32)
        .map(|index| Event {
            t_us: u64::from(index) * 3,
            x: (index % 1280) as u16,
            y: (index / 7 % 720) as u16,
            polarity: if index % 3 == 0 { Polarity::On } else { Polarity::Off },
        })
        .collect();
    for format in WriteFormat::ALL {
        assert!(through(format, &events).0 == events, "{}", format.as_str());
    }
}

#[test]
fn time_that_steps_back_is_kept_where_the_format_can_hold_it() {
    let at = |t_us| Event { t_us, x: 1, y: 2, polarity: Polarity::On };
    let events = [at(50), at(40), at(60)];
    for format in [WriteFormat::Dat, WriteFormat::Aedat4, WriteFormat::Csv] {
        assert_eq!(through(format, &events).0, events, "{}", format.as_str());
    }
    for format in [WriteFormat::Evt2, WriteFormat::Evt3] {
        let file = Scratch::new(format.as_str());
        let mut writer = write::create(&file.0, format, GEOMETRY).expect("a file");
        let error = writer.write(&events).expect_err("EVT holds no step back").to_string();
        assert!(error.contains("help:"), "{error}");
    }
}

//! What is written is read back: every event, in order, through every format that is written.

use evtach_core::{Event, Geometry, GyroSample};
use evtach_host::recording::write::{self, WriteFormat};
use evtach_host::recording::{self, ImuSample, OpenOptions};
use proptest::prelude::*;

use crate::scratch::{Scratch, event, read};

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

/// A thousand events and a gyro sample in each millisecond.
fn with_gyro() -> (Vec<Event>, Vec<GyroSample>) {
    let events =
        (0..200_000_u32).map(|i| event(5000 + u64::from(i), (i % 1280) as u16, 3, i % 2 == 0));
    let samples = (0..210_u16).map(|i| GyroSample {
        t_us: u64::from(i) * 1000,
        roll_rad_s: (f32::from(i) - 100.0) * 3.7e-3,
    });
    (events.collect(), samples.collect())
}

#[test]
fn gyro_samples_come_back_before_the_events_of_their_time() {
    let (events, samples) = with_gyro();
    let scratch = Scratch::new();
    let file = scratch.file("gyro.aedat4");
    let mut writer = write::create(&file, WriteFormat::Aedat4, GEOMETRY).expect("a file");
    let mut rest = &samples[..];
    for events in events.chunks(777) {
        let until_us = events[events.len() - 1].t_us;
        let (reached, later) = rest.split_at(rest.partition_point(|s| s.t_us <= until_us));
        let reached: Vec<ImuSample> = reached.iter().map(ImuSample::rolling).collect();
        writer.write_imu(&reached).expect("samples that fit");
        writer.write(events).expect("events that fit");
        rest = later;
    }
    assert!(!rest.is_empty(), "some come behind the last event");
    let rest: Vec<ImuSample> = rest.iter().map(ImuSample::rolling).collect();
    writer.write_imu(&rest).expect("samples that fit");
    writer.finish().expect("room on the disk");

    let mut recording = recording::open(&file, &OpenOptions::default()).expect("what was written");
    let (mut found, mut rolls) = (Vec::new(), Vec::<GyroSample>::new());
    loop {
        let more = recording.read_chunk(&mut found).expect("no damage");
        rolls.extend(recording.take_imu().iter().map(ImuSample::roll));
        let until_us = found.last().map_or(0, |event| event.t_us);
        let due = samples.partition_point(|sample| sample.t_us <= until_us);
        assert!(rolls.len() >= due, "{} of {due} samples at {until_us} us", rolls.len());
        if !more {
            break;
        }
    }
    assert!(found == events);
    assert_eq!(rolls.len(), samples.len());
    for (found, sample) in rolls.iter().zip(&samples) {
        assert_eq!(found.t_us, sample.t_us);
        // Into degrees and back: each rounds once.
        let off = (found.roll_rad_s - sample.roll_rad_s).abs();
        assert!(off <= 2.0 * f32::EPSILON * sample.roll_rad_s.abs(), "{found:?} for {sample:?}");
    }
}

#[test]
fn a_recording_without_gyro_samples_declares_none() {
    let (events, samples) = with_gyro();
    let samples: Vec<ImuSample> = samples.iter().map(ImuSample::rolling).collect();
    for format in WriteFormat::ALL {
        let scratch = Scratch::new();
        for (given, name) in [(&samples[..0], "without"), (&samples[..], "with")] {
            let file = scratch.file(name);
            let mut writer = write::create(&file, format, GEOMETRY).expect("a file");
            writer.write_imu(given).expect("samples that fit, or have no place");
            writer.write(&events).expect("events that fit");
            writer.finish().expect("room on the disk");
            let mut found = read(&file, None).expect("what was written");
            assert!(found.error.is_none() && found.events == events, "{}", format.as_str());
            let kept = if format.holds_imu() { given.len() } else { 0 };
            assert_eq!(found.recording.take_imu().len(), kept, "{}", format.as_str());
            let bytes = std::fs::read(&file).expect("what was written");
            let declared = bytes.windows(4).any(|word| word == b"IMUS");
            assert_eq!(declared, kept > 0, "{}", format.as_str());
        }
    }
}

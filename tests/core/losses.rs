//! Events that the sensor or the link lost: each is counted, and what few are left tells no speed.

use evtach_core::{Geometry, Reading, Reason, Settings, Status};
use evtach_host::measure::{Capacity, drain, with_tachometer};
use evtach_host::synth::{Scene, generate};

const FRAME_EVENTS: usize = 251;

/// Readings where only one of so many frames of events arrives, the last of them, and the losses are told when they show.
fn one_frame_of(frames: usize, capacity: Capacity) -> Vec<Reading> {
    let scene = Scene { duration_ms: 400.0, seed: 1, ..Scene::default() };
    let events = generate(&scene).expect("a scene in range").events;
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let mut readings = Vec::new();
    with_tachometer(Settings::new(geometry), capacity, |tachometer| {
        for (number, frame) in (1..).zip(events.chunks(FRAME_EVENTS)) {
            if usize::is_multiple_of(number, frames) {
                tachometer.push(frame);
            } else {
                tachometer.lost(frame.len() as u64);
            }
            drain(tachometer, |reading| readings.push(reading));
        }
        tachometer.finish();
        drain(tachometer, |reading| readings.push(reading));
    });
    readings
}

/// What is lost as regularly as this leaves bursts in which another speed was told, locked.
#[test]
fn what_few_events_are_left_of_is_saturated() {
    for frames in [20, 30, 50, 70, 1_000] {
        for capacity in Capacity::ALL {
            let readings = one_frame_of(frames, capacity);
            assert!(!readings.is_empty());
            for reading in readings {
                assert_eq!(reading.status, Status::Refused(Reason::Saturated), "{reading:#?}");
                assert!(reading.rotors.iter().all(|rotor| rotor.speed.is_none()), "{reading:#?}");
            }
        }
    }
}

/// What is lost before the first event arrives counts, too.
#[test]
fn what_is_lost_first_is_told() {
    for capacity in Capacity::ALL {
        let readings = one_frame_of(1_000, capacity);
        assert!(readings[0].lost >= 999 * FRAME_EVENTS as u64, "{readings:#?}");
    }
}

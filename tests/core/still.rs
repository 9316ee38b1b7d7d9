//! Before a still scene nothing is read, and the reading of that ends; and what turns later is read soon and often.

use evtach_core::{Event, Geometry, Poll, Reading, Settings, Status};
use evtach_host::measure::{Capacity, with_tachometer};
use evtach_host::synth::scene::Sensor;
use evtach_host::synth::{Rotor, Scene, generate, presets};
use evtach_tests::show;

/// Readings of these recordings, of some seconds each, at most.
const MOST_READINGS: usize = 200;

/// A sensor that is noisy, and one that a hand holds before a wall.
fn stills() -> [(&'static str, Scene); 2] {
    let sensor = Sensor { noise_hz: 1.0, ..Sensor::default() };
    let noise = Scene { rotors: Vec::new(), sensor, ..Scene::default() };
    let (camera, background) = (presets::hand(), presets::wall());
    let wall = Scene { rotors: Vec::new(), camera, background, ..Scene::default() };
    [("noise", noise), ("wall", wall)]
}

/// Adds so much of a scene to what is there.
fn then(events: &mut Vec<Event>, scene: &Scene, duration_ms: f64) -> u64 {
    let begun_us = events.last().map_or(0, |last| last.t_us + 1);
    let scene = Scene { duration_ms, ..scene.clone() };
    let made = generate(&scene).expect("a scene in range").events;
    events.extend(made.into_iter().map(|event| Event { t_us: begun_us + event.t_us, ..event }));
    begun_us
}

/// What is read when it is measured `steps` at a time between two pushes of so much, and the rest at the end.
fn read(events: &[Event], capacity: Capacity, piece_us: u64, steps: u32) -> Vec<Reading> {
    let mut readings = Vec::new();
    let settings = Settings::new(Geometry::new(346, 260).expect("a sensor in range"));
    with_tachometer(settings, capacity, |tachometer| {
        for piece in events.chunk_by(|a, b| a.t_us / piece_us == b.t_us / piece_us) {
            tachometer.push(piece);
            let mut left = steps;
            while let Poll::Ready(reading) = tachometer.poll(left) {
                readings.push(reading);
                assert!(readings.len() < MOST_READINGS, "the same windows again and again");
                left = left.min(steps / 2);
            }
        }
        tachometer.finish();
        while let Poll::Ready(reading) = tachometer.poll(u32::MAX) {
            readings.push(reading);
            assert!(readings.len() < MOST_READINGS, "the same windows again and again");
        }
    });
    readings
}

fn end_us(reading: &Reading) -> u64 {
    reading.t_us + u64::from(reading.window_us / 2)
}

fn has_speed(reading: &Reading) -> bool {
    reading.rotors.iter().any(|rotor| rotor.speed.is_some())
}

/// Which windows were measured, and what came of them. How many events stand in a window that grew differs by one or two with how
/// far its last segment was filled when it did.
fn windows(readings: &[Reading]) -> Vec<(u64, u32, Status, usize)> {
    let of = |r: &Reading| (r.t_us, r.window_us, r.status, r.rotors.len());
    readings.iter().map(of).collect()
}

#[test]
fn a_still_scene_ends_in_a_refusal_in_any_rhythm() {
    for (name, still) in stills() {
        let mut events = Vec::new();
        then(&mut events, &still, 3_400.0);
        for capacity in Capacity::ALL {
            let promptly = read(&events, capacity, 500, u32::MAX);
            let last = promptly.last().expect("a reading");
            assert!(matches!(last.status, Status::Refused(_)), "{name}: {last:?}");
            assert!(promptly.iter().all(|reading| !has_speed(reading)), "{name}: {promptly:#?}");
            // Behind one of two seconds they begin short again.
            let longest = promptly.iter().position(|r| r.window_us > 1_900_000);
            let behind = &promptly[longest.expect("a long window") + 1..];
            let begins = behind.first().map(|reading| reading.window_us);
            assert!(begins.is_some_and(|us| us < 160_000), "{name}: {promptly:#?}");
            assert!(promptly.windows(2).all(|pair| end_us(&pair[0]) < end_us(&pair[1])), "{name}");
            let in_pieces = read(&events, capacity, 20_000, u32::MAX);
            assert_eq!(windows(&in_pieces), windows(&promptly), "{name}, {capacity:?}");
            // A machine that hardly gets to measuring.
            for steps in [0, 3, 40] {
                let slowly = read(&events, capacity, 1_000, steps);
                let last = slowly.last().expect("a reading");
                assert!(matches!(last.status, Status::Refused(_)), "{name}: {last:?}");
            }
        }
    }
}

/// Whether it begins to turn while no window is measured, or while one grows that then holds little of it.
#[test]
fn what_turns_after_a_still_scene_is_read_soon_and_often() {
    for (name, still) in stills() {
        let fan =
            Scene { rotors: vec![Rotor { rpm: 1500.0, ..Rotor::default() }], ..still.clone() };
        for still_ms in [2_300.0, 3_000.0] {
            let mut events = Vec::new();
            then(&mut events, &still, still_ms);
            let on_us = then(&mut events, &fan, 4_500.0);
            for capacity in Capacity::ALL {
                let readings = read(&events, capacity, 500, u32::MAX);
                let seen: Vec<&Reading> =
                    readings.iter().filter(|reading| has_speed(reading)).collect();
                let first_us = seen.first().map_or(u64::MAX, |first| end_us(first)) - on_us;
                let often: Vec<&&Reading> =
                    seen.iter().filter(|reading| end_us(reading) > on_us + 3_500_000).collect();
                show(&format!(
                    "{name} for {still_ms} ms, {capacity:?}: first read {:.2} s after it was switched on; {} readings in the last second",
                    first_us as f64 * 1e-6,
                    often.len()
                ));
                assert!(first_us < 3_500_000, "{first_us}");
                let least = if capacity == Capacity::Full { 18 } else { 10 };
                assert!(often.len() >= least, "{}", often.len());
                for reading in &seen {
                    let [rotor] = &reading.rotors[..] else { unreachable!("{reading:#?}") };
                    let rpm = rotor.speed.as_ref().map_or(0.0, |speed| speed.rpm());
                    assert!((rpm / 1500.0 - 1.0).abs() < 5e-3 && rotor.id == 0, "{reading:#?}");
                }
            }
        }
        let mut events = Vec::new();
        then(&mut events, &still, 2_300.0);
        then(&mut events, &fan, 1_000.0);
        for capacity in Capacity::ALL {
            let readings = read(&events, capacity, 500, u32::MAX);
            // Shorter than the spare segments of 50 ms, or one piece may overrun them.
            let in_pieces = read(&events, capacity, 40_000, u32::MAX);
            assert_eq!(windows(&in_pieces), windows(&readings), "{name}, {capacity:?}");
        }
    }
}

/// The first windows that hold it hold little of it, and what the hand moved before.
#[test]
fn what_comes_into_view_of_a_hand_is_not_told_wrong() {
    const LARGEST_SIGMAS: f32 = 6.0;
    let [_, (_, wall)] = stills();
    let (mut worst, mut told) = (0.0_f32, 0);
    for rpm in [600.0, 1500.0] {
        for (seed, still_ms) in (80..).zip([1_000.0, 3_700.0]) {
            let mut events = Vec::new();
            then(&mut events, &Scene { seed, ..wall.clone() }, still_ms);
            let rotors = vec![Rotor { rpm, radius_px: 40.0, ..Rotor::default() }];
            then(&mut events, &Scene { seed, rotors, ..wall.clone() }, 800.0);
            for capacity in Capacity::ALL {
                let readings = read(&events, capacity, 500, u32::MAX);
                let speeds = readings.iter().flat_map(|reading| &reading.rotors);
                for speed in speeds.filter_map(|rotor| rotor.speed) {
                    let off = (speed.rpm() - rpm as f32).abs() / speed.rpm_sigma();
                    show(&format!("{rpm} rpm after {still_ms} ms, {capacity:?}: {off:.1} sigma"));
                    worst = worst.max(off);
                    told += 1;
                }
            }
        }
    }
    assert!(told > 0 && worst < LARGEST_SIGMAS, "{worst}, {told} speeds");
}

/// A window of two seconds shows no blades that pass more than 256 times a second.
#[test]
fn what_turns_fast_after_a_still_scene_is_read_all_the_same() {
    let [(_, still), _] = stills();
    let fast = Rotor { rpm: 9000.0, radius_px: 15.0, ..Rotor::default() };
    for still_ms in [2_600.0, 4_200.0] {
        let mut events = Vec::new();
        then(&mut events, &still, still_ms);
        let fan = Scene { rotors: vec![fast.clone()], ..still.clone() };
        let on_us = then(&mut events, &fan, 4_000.0);
        for capacity in Capacity::ALL {
            let readings = read(&events, capacity, 500, u32::MAX);
            let seen: Vec<&Reading> =
                readings.iter().filter(|reading| has_speed(reading)).collect();
            let first_us = seen.first().map_or(u64::MAX, |first| end_us(first)) - on_us;
            show(&format!(
                "{still_ms} ms still, {capacity:?}: first read {:.2} s after it was switched on",
                first_us as f64 * 1e-6
            ));
            assert!(first_us < 4_200_000, "{readings:#?}");
            for reading in seen {
                let [rotor] = &reading.rotors[..] else { unreachable!("{reading:#?}") };
                let rpm = rotor.speed.as_ref().map_or(0.0, |speed| speed.rpm());
                assert!((rpm / 9000.0 - 1.0).abs() < 1e-3, "{reading:#?}");
            }
        }
    }
}

#[test]
fn a_slow_rotor_after_a_still_scene_keeps_its_long_window() {
    let [(_, still), _] = stills();
    let slow = Scene { rotors: vec![Rotor { rpm: 60.0, ..Rotor::default() }], ..still.clone() };
    let mut events = Vec::new();
    then(&mut events, &still, 3_000.0);
    let on_us = then(&mut events, &slow, 6_000.0);
    for capacity in Capacity::ALL {
        let readings = read(&events, capacity, 500, u32::MAX);
        let behind: Vec<&Reading> =
            readings.iter().filter(|reading| end_us(reading) > on_us + 2_700_000).collect();
        assert!(behind.len() >= 4, "{readings:#?}");
        for reading in behind {
            assert_eq!(
                (reading.status, reading.window_us),
                (Status::Locked, 1_999_998),
                "{reading:#?}"
            );
        }
    }
}

/// The window before the gap was locked, and says nothing about what comes after.
#[test]
fn what_comes_after_a_gap_is_measured_at_the_end_of_the_stream() {
    let scene = Scene {
        rotors: vec![Rotor { rpm: 3000.0, radius_px: 40.0, ..Rotor::default() }],
        ..Scene::default()
    };
    let mut events = Vec::new();
    then(&mut events, &scene, 600.0);
    let until = events.len();
    let later_us = then(&mut events, &scene, 120.0) + 5_000_000;
    events[until..].iter_mut().for_each(|event| event.t_us += 5_000_000);
    for capacity in Capacity::ALL {
        let readings = read(&events, capacity, 500, u32::MAX);
        assert!(readings.iter().any(|r| r.status == Status::Locked && r.t_us < later_us));
        let after = readings.iter().find(|reading| reading.t_us > later_us);
        assert!(after.is_some_and(has_speed), "{capacity:?}: {:?}", windows(&readings));
    }
}

/// A PC searches the whole image every so often, the device a part of it in every so many readings: either way it follows a rotor
/// that is locked instead of measuring it afresh, which takes a PC twenty times as long.
#[test]
fn a_locked_rotor_is_measured_afresh_only_once() {
    let scene = Scene {
        rotors: vec![Rotor { rpm: 1500.0, radius_px: 40.0, ..Rotor::default() }],
        duration_ms: 1_600.0,
        ..Scene::default()
    };
    let events = generate(&scene).expect("a scene in range").events;
    let settings = Settings::new(Geometry::new(346, 260).expect("a sensor in range"));
    for capacity in Capacity::ALL {
        let (mut searches_later, mut afresh, mut readings, mut before) = (false, 0, 0, "idle");
        with_tachometer(settings, capacity, |tachometer| {
            for piece in events.chunk_by(|a, b| a.t_us / 500 == b.t_us / 500) {
                tachometer.push(piece);
                while tachometer.is_measuring() {
                    let stage = tachometer.stage();
                    searches_later |= stage == "visits" && readings > 0;
                    afresh += u32::from(stage == "initial" && stage != before);
                    before = stage;
                    readings += u32::from(matches!(tachometer.poll(1), Poll::Ready(_)));
                }
            }
        });
        assert_eq!(afresh, 1, "{capacity:?}: {readings} readings");
        assert!(searches_later && readings > 12, "{capacity:?}: {readings}");
    }
}

/// While another is followed.
#[test]
fn what_turns_later_beside_a_rotor_is_found_while_that_one_is_read() {
    // 40 turns, so that the first goes on as if nothing had happened.
    const ALONE_MS: f64 = 1_600.0;
    const BOTH_MS: f64 = 4_000.0;
    let first = Rotor { rpm: 1500.0, radius_px: 40.0, x_px: 90.0, y_px: 130.0, ..Rotor::default() };
    for (rpm, radius_px) in [(-2300.0, 35.0), (3100.0, 12.0)] {
        let second = Rotor { rpm, radius_px, x_px: 260.0, y_px: 120.0, ..Rotor::default() };
        let alone = Scene { rotors: vec![first.clone()], ..Scene::default() };
        let both = Scene { rotors: vec![first.clone(), second], ..Scene::default() };
        let mut events = Vec::new();
        then(&mut events, &alone, ALONE_MS);
        let on_us = then(&mut events, &both, BOTH_MS);
        for capacity in Capacity::ALL {
            let readings = read(&events, capacity, 500, u32::MAX);
            let speeds = |reading: &Reading| {
                reading.rotors.iter().filter(|rotor| rotor.speed.is_some()).count()
            };
            let found = readings.iter().position(|reading| speeds(reading) == 2);
            let found = found.expect("a reading of both");
            let after_us = end_us(&readings[found]).saturating_sub(on_us);
            let behind = &readings[found..];
            let of_both = behind.iter().filter(|reading| speeds(reading) == 2).count();
            show(&format!(
                "radius {radius_px} px, {} memory: found after {:.1} s; both in {of_both} of {} readings from then on",
                capacity.as_str(),
                after_us as f64 * 1e-6,
                behind.len()
            ));
            assert!(after_us < 3_500_000, "{after_us}");
            assert!(10 * of_both >= 9 * behind.len(), "{of_both} of {}", behind.len());
            for reading in behind {
                for rotor in &reading.rotors {
                    let told = rotor.speed.map_or(0.0, |speed| speed.omega_rad_s * 9.549_297);
                    let truth = if rotor.x_px < 175.0 { 1500.0 } else { rpm as f32 };
                    assert!(
                        rotor.speed.is_none() || (told / truth - 1.0).abs() < 5e-3,
                        "{reading:#?}"
                    );
                }
            }
        }
    }
}

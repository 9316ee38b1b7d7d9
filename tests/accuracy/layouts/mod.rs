//! Where rotors stand and what else is in the picture: each scene is measured in both memories against its truth.
#![allow(clippy::panic)] // A test fails by it.

mod measured;

use evtach_core::{Event, Geometry, Reading, Reason, Status};
use evtach_host::measure::Capacity;
use evtach_host::synth::presets::{Preset, hand, shaken, wall};
use evtach_host::synth::scene::{Background, Camera, Lamp, Sensor, Shape, Vibration};
use evtach_host::synth::{Model, Rotor, Scene};
use evtach_tests::{Loaded, made, measure, show};

use self::measured::{all_read, at, rpm, run, scene, wide};

#[test]
fn a_busy_background_from_the_hand() {
    let background = Background { contrast: 0.4, boxes: 20, ..wall() };
    let rotor = at(150.0, 120.0, 45.0, -2200.0);
    all_read("busy", &Scene { camera: hand(), background, ..scene(60, vec![rotor]) });
}

#[test]
fn two_that_touch() {
    all_read("touching", &Scene { seed: 61, duration_ms: 210.0, ..Preset::Touching.scene() });
}

#[test]
fn radii_of_60_and_25_px() {
    let rotors = vec![at(100.0, 130.0, 60.0, 2400.0), at(250.0, 130.0, 25.0, -3100.0)];
    all_read("unequal radii", &scene(62, rotors));
}

#[test]
fn speeds_of_ten_to_one() {
    let rotors = vec![at(95.0, 130.0, 50.0, 600.0), at(250.0, 130.0, 50.0, 6000.0)];
    all_read("ten to one", &Scene { duration_ms: 320.0, ..scene(63, rotors) });
}

#[test]
fn four_of_unequal_speeds_and_directions() {
    let rotors = vec![
        at(160.0, 120.0, 45.0, 1200.0),
        at(470.0, 125.0, 45.0, -6000.0),
        at(165.0, 355.0, 45.0, 3000.0),
        at(475.0, 350.0, 45.0, -2000.0),
    ];
    all_read("four", &wide(64, rotors));
}

/// Their lines are one in a short window, and one rotation about a point between explains some of them all: they are read as the rotors
/// that they are.
#[test]
fn far_apart_and_nearly_alike() {
    let sensor = Sensor {
        threshold_spread: 0.027,
        refractory_us: 152.0,
        latency_spread_us: 71.9,
        jitter_us: 108.0,
        noise_hz: 0.112,
        dropout: 0.191,
        blur_px: 0.88,
        ..Sensor::default()
    };
    let vibration = Vibration { amplitude_px: 0.388, ..shaken() };
    let two = |rotor, shape, contrast| Rotor { blades: 2, shape, contrast, ..rotor };
    let mut wrong = Vec::new();
    for seed in 1..=4 {
        let rotors = vec![
            two(at(142.0, 125.0, 65.3, 897.0), Shape::Tapered, 0.8),
            two(at(156.0, 359.0, 75.0, -981.0), Shape::Swept, -0.93),
            two(at(470.0, 118.0, 19.9, 981.0), Shape::Straight, -0.79),
            two(at(494.0, 365.0, 15.9, -839.0), Shape::Tapered, 0.59),
        ];
        let scene = Scene {
            model: Model::Threshold,
            duration_ms: 163.0,
            sensor: sensor.clone(),
            vibration: vibration.clone(),
            ..wide(seed, rotors)
        };
        for capacity in Capacity::ALL {
            let name = format!("seed {seed}, {} memory", capacity.as_str());
            let measured = run(&scene, capacity);
            wrong.extend(measured.wrong_speeds(&name, false));
            // The last is too small to be owed.
            let unread = (0..3).filter(|number| measured.of(*number).is_none());
            wrong.extend(unread.map(|number| format!("{name}: rotor {number} is not read")));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn three_in_a_row() {
    let rotors = vec![
        at(60.0, 130.0, 42.0, 2900.0),
        at(172.0, 130.0, 42.0, -3300.0),
        at(284.0, 130.0, 42.0, 2500.0),
    ];
    all_read("row", &scene(65, rotors));
}

#[test]
fn six_at_once() {
    let speeds = [3000.0, -3400.0, 2600.0, -3900.0, 4300.0, -2200.0];
    let rotors = speeds.iter().enumerate().map(|(i, rpm)| {
        at(110.0 + 210.0 * (i % 3) as f64, 130.0 + 220.0 * (i / 3) as f64, 45.0, *rpm)
    });
    all_read("six", &wide(66, rotors.collect()));
}

#[test]
fn partly_outside_the_frame() {
    all_read("cropped", &scene(67, vec![at(30.0, 130.0, 55.0, -2700.0)]));
}

#[test]
fn tilted_by_20_degrees() {
    all_read("tilted", &Scene { seed: 68, duration_ms: 210.0, ..Preset::Tilted.scene() });
}

/// From 41 degrees off the axis the picture is a quarter flatter, and blades go by a third faster and slower in turn.
#[test]
fn a_tilt_costs_no_precision() {
    let rotor = Rotor { tilt_deg: 41.4, tilt_axis_deg: 29.0, ..at(173.0, 130.0, 45.0, 1480.0) };
    let mut scene = Scene { duration_ms: 400.0, ..scene(74, vec![rotor]) };
    scene.clock.error_ppm = Some(0.0);
    let measured = run(&scene, Capacity::Full);
    let mut errors: Vec<f64> = measured
        .readings
        .iter()
        .filter_map(|reading| rpm(reading.rotors.first()?))
        .map(|rpm| (rpm / measured.truth.rotors[0].rpm_camera_mean_signed - 1.0).abs())
        .collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors.len() >= 5 && errors[errors.len() / 2] < 25e-6, "{errors:?}");
}

/// What does not pass anywhere twice in the window of a fast rotor shows in a longer one.
#[test]
fn a_slow_one_beside_a_fast_one() {
    let beside = |fast_rpm, slow: Rotor| vec![at(90.0, 130.0, 50.0, fast_rpm), slow];
    let mark = Rotor { blades: 1, ..at(250.0, 130.0, 50.0, 240.0) };
    let cases = [
        ("1000 and 100", 2_200.0, beside(1000.0, at(250.0, 130.0, 50.0, -100.0))),
        ("600 and 60", 2_400.0, beside(-600.0, at(250.0, 130.0, 40.0, 60.0))),
        ("3000 and a mark at 240", 2_200.0, beside(3000.0, mark)),
    ];
    for (name, duration_ms, rotors) in cases {
        all_read(name, &Scene { duration_ms, ..scene(69, rotors) });
    }
    // Of 1.8 million events a second, the device keeps too few of the slow one's.
    let slow = at(265.0, 190.0, 40.0, 120.0);
    let rotors = vec![at(80.0, 80.0, 50.0, 3000.0), at(250.0, 70.0, 50.0, -2000.0), slow];
    let three = Scene { duration_ms: 2_200.0, ..scene(69, rotors) };
    let wrong = run(&three, Capacity::Full).wrong_speeds("3000, 2000 and 120", true);
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Nor does it have to be there from the start.
#[test]
fn a_slow_one_that_starts_beside_a_fast_one() {
    let fast = || at(90.0, 130.0, 50.0, 3000.0);
    let alone = Scene { duration_ms: 1_500.0, ..scene(70, vec![fast()]) };
    let slow = at(250.0, 130.0, 50.0, -100.0);
    let both = Scene { duration_ms: 9_000.0, ..scene(71, vec![fast(), slow]) };
    for capacity in Capacity::ALL {
        let mut events = made(&alone).events.clone();
        let behind = made(&both);
        events.extend(behind.events.iter().map(|e| Event { t_us: e.t_us + 1_500_000, ..*e }));
        let geometry = Geometry::new(both.width_px, both.height_px).expect("a sensor in range");
        let (readings, _) = measure(&Loaded { geometry, events }, capacity);
        let name = capacity.as_str();
        let reads = |reading: &Reading, speed: f64| {
            reading.rotors.iter().filter_map(rpm).any(|read| (read / speed - 1.0).abs() < 0.01)
        };
        let slow_read = readings.iter().find(|reading| reads(reading, -100.0));
        let first = slow_read.unwrap_or_else(|| panic!("{name}: not found in {}", readings.len()));
        let seconds = first.t_us as f64 * 1e-6;
        show(&format!("{name} memory: read at {seconds:.1} s of what starts at 1.5 s"));
        let last = readings.last().expect("readings");
        assert!(reads(last, 3000.0) && reads(last, -100.0), "{name}: {last:?}");
    }
}

/// Blades that pass 180 000 times a minute are found and named as such, and the rotor beside them is none the worse for it.
#[test]
fn one_locked_while_another_is_too_fast() {
    let fast = Rotor { blades: 6, ..at(250.0, 130.0, 40.0, 30_000.0) };
    let both = scene(69, vec![at(90.0, 130.0, 50.0, 3000.0), fast]);
    let mut wrong = Vec::new();
    for capacity in Capacity::ALL {
        let name = format!("{} memory", capacity.as_str());
        let too_fast = |reason| reason == Reason::TooFast;
        wrong.extend(run(&both, capacity).wrong_beside_refused(&name, too_fast));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// A path has 63 blocks, each of whole periods: of 64 to 94 in the window, and of 126 to 157, all must find room in them.
#[test]
fn a_hand_is_followed_to_the_end_however_many_blades_pass() {
    let mut wrong = Vec::new();
    for (blades, rpm) in [(2, 15_000.0), (3, 10_000.0), (6, 4_600.0), (3, -18_000.0)] {
        let rotor = Rotor { blades, ..at(170.0, 130.0, 50.0, rpm) };
        let scene = Scene { camera: hand(), background: wall(), ..scene(77, vec![rotor]) };
        for capacity in Capacity::ALL {
            let name = format!("{blades} blades, {} memory", capacity.as_str());
            let measured = run(&scene, capacity);
            wrong.extend(measured.beyond_sigma(&name));
            let rotors = measured.readings.iter().flat_map(|reading| &reading.rotors);
            for share in
                rotors.filter_map(|rotor| Some(rotor.speed?.rpm_sigma() / rotor.speed?.rpm()))
            {
                show(&format!("{name}, {rpm} rpm: sigma {:.3} permille", 1e3 * share));
                if share > 3e-4 {
                    wrong.push(format!("{name}: {rpm:+.0} rpm to {:.2} permille", 1e3 * share));
                }
            }
            if measured.readings.iter().any(|reading| reading.status != Status::Locked) {
                wrong.push(format!("{name}: {rpm:+.0} rpm: not locked in all readings"));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// A hand moves the axis by as much as tells one harmonic from the next: the right speed, or none.
#[test]
fn small_rotors_with_many_blades_in_a_trembling_hand() {
    let sensor = Sensor {
        threshold_spread: 0.145,
        refractory_us: 115.0,
        latency_spread_us: 15.0,
        jitter_us: 113.0,
        noise_hz: 0.38,
        blur_px: 0.51,
        dropout: 0.11,
        ..Sensor::default()
    };
    let camera =
        Camera { tremor_px: 2.5, tremor_mrad: 2.5, drift_px_s: [-2.4, -9.8], ..Camera::default() };
    let mut wrong = Vec::new();
    for (radius_px, rpm) in [(13.0, -7016.0), (17.0, -9000.0), (22.0, -9360.0)] {
        let rotor = Rotor {
            blades: 8,
            shape: Shape::Straight,
            contrast: -1.09,
            tilt_deg: 20.0,
            tilt_axis_deg: 107.0,
            ..at(170.0, 130.0, radius_px, rpm)
        };
        let still =
            Scene { model: Model::Threshold, duration_ms: 205.0, ..scene(506, vec![rotor]) };
        let scene = Scene { sensor: sensor.clone(), camera: camera.clone(), ..still };
        for capacity in Capacity::ALL {
            let name = format!("{radius_px} px, {} memory", capacity.as_str());
            wrong.extend(run(&scene, capacity).wrong_speeds(&name, false));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// What shows about a hundredth of the events, and a neighbour of its harmonic that keeps step about another centre.
#[test]
fn a_small_slow_one_before_a_busy_wall_in_the_hand() {
    let camera =
        Camera { tremor_px: 2.7, tremor_mrad: 2.7, drift_px_s: [5.6, -9.4], ..Camera::default() };
    let background = Background { contrast: 0.373, ..wall() };
    let sensor = Sensor { blur_px: 0.88, latency_spread_us: 15.0, ..Sensor::default() };
    let mut wrong = Vec::new();
    for seed in 1..=3 {
        let rotor = Rotor { blades: 5, shape: Shape::Tapered, ..at(171.0, 114.0, 24.0, 300.0) };
        let scene = Scene {
            model: Model::Threshold,
            duration_ms: 450.0,
            camera: camera.clone(),
            background: background.clone(),
            sensor: sensor.clone(),
            ..wide(seed, vec![rotor])
        };
        let measured = run(&scene, Capacity::Full);
        wrong.extend(measured.wrong_speeds(&format!("seed {seed}"), true));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// More parts than are named: the speed, and no blade count.
#[test]
fn nine_eleven_and_sixteen_spokes() {
    let mut wrong = Vec::new();
    for (seed, blades) in [(70, 9), (71, 11), (72, 16)] {
        let spokes = Rotor { blades, shape: Shape::Spokes, ..at(173.0, 130.0, 80.0, -400.0) };
        for capacity in Capacity::ALL {
            let name = format!("{blades} spokes, {} memory", capacity.as_str());
            let scene = Scene { duration_ms: 420.0, ..scene(seed, vec![spokes.clone()]) };
            let measured = run(&scene, capacity);
            wrong.extend(measured.wrong_speeds(&name, false));
            match measured.of(0) {
                Some(rotor) if rotor.blades.is_some() => {
                    wrong.push(format!("{name}: {:?} blades", rotor.blades));
                }
                Some(_) => {}
                None => {
                    let last = measured.readings.last().map(|reading| reading.status);
                    if !matches!(last, Some(Status::Refused(Reason::Ambiguous))) {
                        wrong.push(format!("{name}: {last:?}"));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn one_odd_blade() {
    let mut wrong = Vec::new();
    for (seed, blades) in [(73, 3), (74, 5), (75, 2), (76, 4), (77, 6), (78, 7), (79, 8)] {
        let rotor = Rotor { blades, odd_width: 0.6, ..at(173.0, 130.0, 55.0, 1900.0) };
        let scene = scene(seed, vec![rotor]);
        for capacity in Capacity::ALL {
            let name = format!("one of {blades} blades odd, {} memory", capacity.as_str());
            let measured = run(&scene, capacity);
            wrong.extend(measured.wrong_speeds(&name, true));
            if let Some(read) = measured.of(0).filter(|rotor| rotor.blades != Some(blades)) {
                wrong.push(format!("{name}: {:?} blades", read.blades));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn without_polarity() {
    let sensor = Sensor { all_on: true, ..Sensor::default() };
    let rotors = vec![at(100.0, 130.0, 50.0, 2000.0), at(250.0, 130.0, 40.0, -3500.0)];
    all_read("all ON", &Scene { sensor, ..scene(75, rotors) });
}

/// Reads a rotor without polarity in both memories.
fn read_without_polarity(name: &str, seed: u64, rotor: Rotor) {
    let sensor = Sensor { all_on: true, ..Sensor::default() };
    let scene = Scene { sensor, ..scene(seed, vec![rotor]) };
    for capacity in Capacity::ALL {
        let wrong = run(&scene, capacity).wrong_speeds(name, true);
        assert!(wrong.is_empty(), "{} memory\n{}", capacity.as_str(), wrong.join("\n"));
    }
}

/// One blade half as wide as the other: nothing tells that they are two, but each shows sharply what turns.
#[test]
fn without_polarity_two_that_differ() {
    for (seed, shape) in [(71, Shape::Straight), (72, Shape::Tapered), (73, Shape::Swept)] {
        let rotor = Rotor { blades: 2, odd_width: 0.55, shape, ..at(173.0, 130.0, 30.0, -1450.0) };
        read_without_polarity(&format!("two that differ, all ON, {shape:?}"), seed, rotor);
    }
}

/// Its edges, a fifth or a quarter of a turn apart, cancel in the second harmonic.
#[test]
fn without_polarity_a_single_broad_blade() {
    for (seed, rpm) in [(81, 2500.0), (82, -9700.0)] {
        let blade = Rotor { blades: 1, shape: Shape::Swept, ..at(173.0, 130.0, 54.0, rpm) };
        read_without_polarity("a single broad blade, all ON", seed, blade);
    }
}

/// Both edges of a blade as wide as its gap cancel in its harmonic, and a hand blurs what is left of it.
#[test]
fn without_polarity_in_the_hand() {
    let camera =
        Camera { tremor_px: 1.74, tremor_mrad: 1.74, drift_px_s: [-0.8, 9.6], ..Camera::default() };
    let sensor = Sensor {
        all_on: true,
        refractory_us: 470.0,
        latency_spread_us: 15.0,
        blur_px: 0.88,
        ..Sensor::default()
    };
    let rotor = Rotor {
        blades: 6,
        shape: Shape::Swept,
        odd_width: 0.63,
        tilt_deg: 20.0,
        tilt_axis_deg: 82.0,
        contrast: -1.19,
        ..at(225.0, 210.0, 20.0, -1544.0)
    };
    for seed in [1, 3] {
        let scene = Scene {
            model: Model::Threshold,
            duration_ms: 223.0,
            camera: camera.clone(),
            sensor: sensor.clone(),
            ..scene(seed, vec![rotor.clone()])
        };
        all_read("all ON in the hand", &scene);
    }
}

/// What is wrong with one rotor under a lamp, in both memories, every reading within its standard error. Unless it is `owed` there
/// too, the device's smaller memory may refuse it.
fn under_a_lamp(lit: &Scene, owed: bool) -> Vec<String> {
    let wrong = |capacity: Capacity| {
        let name = format!("under a lamp, {} memory", capacity.as_str());
        let measured = run(lit, capacity);
        let mut wrong = measured.wrong_speeds(&name, owed || capacity == Capacity::Full);
        wrong.extend(measured.beyond_sigma(&name));
        wrong
    };
    Capacity::ALL.into_iter().flat_map(wrong).collect()
}

/// Blades that pass as often as the lamp flashes, or as one of its overtones does: the line is one, and only where it turns is it a rotor.
#[test]
fn blades_in_step_with_the_lamp() {
    let mut wrong = Vec::new();
    let in_step = [
        (81, 100.0, 4, 1500.0),
        (82, 120.0, 3, 2400.0),
        (83, 100.0, 3, -2000.0),
        (84, 100.0, 4, 3000.0),
        (85, 120.0, 3, -4800.0),
        (86, 100.0, 3, 6000.0),
    ];
    for (seed, frequency_hz, blades, rpm) in in_step {
        let lamp = Lamp { frequency_hz, ..dim() };
        let rotor = Rotor { blades, ..at(173.0, 130.0, 50.0, rpm) };
        let lit = Scene { lamp: Some(lamp), ..scene(seed, vec![rotor]) };
        wrong.extend(under_a_lamp(&lit, false));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Slow blades under a lamp, which adds its frequency to theirs: as long as less than a period of their own has been seen, the faster
/// rotor that they then look like must not be told.
#[test]
fn a_lamp_makes_no_fast_rotor_of_a_slow_one() {
    let mut wrong = Vec::new();
    // Mains, and light that flickers faster.
    let lamps_hz = [
        (1, 100.0),
        (2, 100.0),
        (86, 100.0),
        (87, 100.0),
        (1, 250.0),
        (2, 500.0),
        (3, 1000.0),
        (4, 2000.0),
    ];
    for (seed, frequency_hz) in lamps_hz {
        let lamp = Lamp { frequency_hz, depth: 0.1, ..dim() };
        let rotor = Rotor { blades: 6, ..at(173.0, 130.0, 23.0, 78.0) };
        let lit = Scene { lamp: Some(lamp), duration_ms: 160.0, ..scene(seed, vec![rotor]) };
        for capacity in Capacity::ALL {
            let name = format!("seed {seed}, {frequency_hz} Hz, {} memory", capacity.as_str());
            wrong.extend(run(&lit, capacity).wrong_speeds(&name, false));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// A lamp with overtones that dims the whole picture a little.
fn dim() -> Lamp {
    Lamp { depth: 0.12, harmonics: vec![0.3, 0.15], ..Lamp::default() }
}

/// Lamps of both mains, with overtones, over the whole picture: a rotor keeps its speed, and without one there is none.
#[test]
fn flicker_neither_bends_a_speed_nor_makes_one() {
    for (seed, frequency_hz) in [(76, 100.0), (77, 120.0)] {
        let lamp = Lamp { frequency_hz, ..dim() };
        // Blades that pass close to the lamp's first overtone.
        let rotor = at(173.0, 130.0, 50.0, 20.0 * frequency_hz * 2.0 * 0.93);
        let lit = Scene { lamp: Some(lamp.clone()), ..scene(seed, vec![rotor]) };
        let wrong = under_a_lamp(&lit, true);
        assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
        let spot_px = Some([150.0, 120.0, 60.0]);
        for lamp in [lamp.clone(), Lamp { depth: 0.6, spot_px, ..lamp }] {
            let dark = Scene { lamp: Some(lamp), ..scene(seed, Vec::new()) };
            for capacity in Capacity::ALL {
                let measured = run(&dark, capacity);
                let wrong = measured.wrong_speeds("a lamp alone", false);
                assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
            }
        }
    }
}

#![allow(clippy::unwrap_used, clippy::panic)]

use std::f64::consts::TAU;

use evtach_core::Polarity;

use super::scene::{Background, Camera, Clock, Gyro, Lamp, Mover, Sensor, Shape, Vibration};
use super::*;

const MODELS: [Model; 2] = [Model::Threshold, Model::Edge];

/// A tripod, no clock error, and eight turns.
fn fixed(model: Model, rpm: f64) -> Scene {
    let rotors = vec![Rotor { rpm, ..Rotor::default() }];
    let clock = Clock { sigma_ppm: 0.0, error_ppm: Some(0.0) };
    let duration_ms = 8.02 * 60e3 / rpm.abs();
    Scene { model, rotors, clock, duration_ms, seed: 7, ..Scene::default() }
}

/// Relative slope of the events' phase against the truth over whole turns, and the phases' coherence.
/// Events are turned back by the exact angle at their time, so a wrong truth shows as a slope.
fn phase_error(scene: &Scene, made: &Synthetic) -> (f64, f64) {
    let motion = Motion::new(scene);
    let rotor = &scene.rotors[0];
    let spin = &motion.spins()[0];
    let n = f64::from(rotor.blades);
    let turns_at = |t_s: f64| (spin.angle(t_s) - spin.angle(0.0)).abs() / TAU;
    let turns = turns_at(scene.duration_s()) as usize;
    let mut sums = vec![(0.0f64, 0.0f64, 0.0f64); turns];
    for event in &made.events {
        let t_s = event.t_us as f64 * 1e-6;
        let [cx, cy] = motion.centre(rotor, t_s);
        let (dx, dy) = (f64::from(event.x) - cx, f64::from(event.y) - cy);
        let r = dx.hypot(dy);
        let Some(block) = sums.get_mut(turns_at(t_s) as usize) else { continue };
        if r < rotor.hub_radius_px() || r > rotor.radius_px {
            continue;
        }
        let angle = dy.atan2(dx) - motion.roll(t_s) - spin.angle(t_s);
        let sign = if event.polarity == Polarity::On { 1.0 } else { -1.0 };
        block.0 += sign * (n * angle).cos();
        block.1 += sign * (n * angle).sin();
        block.2 += 1.0;
    }
    let (mut last, mut line) = (sums[0].1.atan2(sums[0].0), Vec::new());
    for (re, im, _) in &sums {
        last += field::wrapped(im.atan2(*re) - last);
        line.push(last / n);
    }
    let mid = (turns as f64 - 1.0) / 2.0;
    let mean = line.iter().sum::<f64>() / turns as f64;
    let (mut num, mut den) = (0.0, 0.0);
    for (i, phase) in line.iter().enumerate() {
        num += (i as f64 - mid) * (phase - mean);
        den += (i as f64 - mid).powi(2);
    }
    let total: f64 = sums.iter().map(|s| s.0.hypot(s.1)).sum();
    let count: f64 = sums.iter().map(|s| s.2).sum();
    (num / den / TAU * rotor.rpm.signum(), total / count)
}

#[test]
fn events_turn_exactly_as_the_truth_says() {
    for model in MODELS {
        for rpm in [300.0, 1200.0, -3000.0, 6000.0] {
            let scene = fixed(model, rpm);
            let (slope, coherence) = phase_error(&scene, &generate(&scene).unwrap());
            assert!(slope.abs() < 25e-6, "{model:?} {rpm}: off by {:.1} ppm", slope * 1e6);
            assert!(coherence > 0.3, "{model:?} {rpm}: coherence {coherence}");
        }
    }
}

#[test]
fn a_wrong_truth_would_show() {
    let scene = fixed(Model::Edge, 3000.0);
    let made = generate(&scene).unwrap();
    let mut other = scene.clone();
    other.rotors[0].rpm *= 1.001;
    let (slope, _) = phase_error(&other, &made);
    assert!((slope + 1e-3).abs() < 1e-4, "{slope}");
    other.rotors[0].rpm = -3000.0;
    let (_, coherence) = phase_error(&other, &made);
    assert!(coherence < 0.1, "a reversed rotor looks coherent: {coherence}");
}

#[test]
fn motion_ramp_and_hunting_stay_in_step_with_the_truth() {
    for model in MODELS {
        let mut scene = fixed(model, 2400.0);
        scene.camera = Camera { tremor_px: 3.0, tremor_mrad: 3.0, ..Camera::default() };
        scene.vibration = Vibration { amplitude_px: 1.0, second_px: 0.4, frequency_hz: None };
        scene.rotors[0].ramp_per_s = 0.3;
        scene.rotors[0].hunting = 0.01;
        scene.rotors[0].hunting_hz = 20.0;
        let (slope, coherence) = phase_error(&scene, &generate(&scene).unwrap());
        assert!(slope.abs() < 60e-6, "{model:?}: off by {:.1} ppm", slope * 1e6);
        assert!(coherence > 0.3, "{model:?}: coherence {coherence}");
    }
}

#[test]
fn positive_rpm_is_clockwise_on_the_screen() {
    for model in MODELS {
        let mut scene = fixed(model, 600.0);
        scene.duration_ms = 40.0;
        scene.rotors[0].blades = 1;
        scene.rotors[0].phase_deg = Some(0.0);
        scene.sensor.noise_hz = 0.0;
        // After a quarter of a turn (25 ms) the blade has gone from the right to the bottom: y points down.
        let made = generate(&scene).unwrap();
        let late = made.events.iter().filter(|e| (24_000..26_000).contains(&e.t_us));
        let mean = late.clone().map(|e| f64::from(e.y)).sum::<f64>() / late.count() as f64;
        assert!(mean > 145.0, "{model:?}: mean row {mean}");
        assert_eq!(made.truth.rotors[0].direction, "cw");
    }
}

#[test]
fn equal_seeds_give_equal_recordings_whatever_the_threads() {
    for model in MODELS {
        let mut scene = fixed(model, 1500.0);
        scene.duration_ms = 30.0;
        let many = generate(&scene).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let one = pool.install(|| generate(&scene).unwrap());
        assert_eq!(many.events, one.events);
        assert_eq!(many.truth, one.truth);
        scene.seed += 1;
        assert_ne!(many.events, generate(&scene).unwrap().events);
    }
}

#[test]
fn on_and_off_balance_and_rates_are_plausible() {
    for model in MODELS {
        let made = generate(&fixed(model, 3000.0)).unwrap();
        let on = made.events.iter().filter(|e| e.polarity == Polarity::On).count();
        let share = on as f64 / made.events.len() as f64;
        assert!((0.42..0.58).contains(&share), "{model:?}: {share} ON");
        let per_turn = made.truth.rotors[0].events as f64 / 8.02;
        assert!((10_000.0..120_000.0).contains(&per_turn), "{model:?}: {per_turn} a turn");
    }
}

#[test]
fn the_first_turn_is_like_the_others() {
    let mut scene = fixed(Model::Threshold, 600.0);
    scene.duration_ms = 200.0;
    scene.sensor.noise_hz = 0.0;
    let made = generate(&scene).unwrap();
    let period_us = 1e6 * scene.rotors[0].period_s();
    let mut counts = [0.0f64; 6];
    for event in &made.events {
        counts[((event.t_us as f64 / period_us) as usize).min(5)] += 1.0;
    }
    let later = counts[1..].iter().sum::<f64>() / 5.0;
    assert!((counts[0] / later - 1.0).abs() < 0.01, "{counts:?}");
}

#[test]
fn a_sensor_that_has_only_just_started_times_its_first_edges_otherwise() {
    let mut scene = fixed(Model::Threshold, 600.0);
    scene.sensor.noise_hz = 0.0;
    scene.sensor.cold_start = true;
    let (slope, _) = phase_error(&scene, &generate(&scene).unwrap());
    // More than any that has been started before: `events_turn_exactly_as_the_truth_says`.
    assert!(slope.abs() > 3e-5, "{slope}");
}

#[test]
fn blades_that_sit_loosely_turn_evenly_all_the_same() {
    for model in MODELS {
        let mut scene = fixed(model, 600.0);
        scene.sensor.noise_hz = 0.0;
        let even = generate(&scene).unwrap();
        scene.rotors[0].blade_spread_mrad = 8.0;
        let loose = generate(&scene).unwrap();
        assert_ne!(even.events, loose.events, "{model:?}");
        let (error, coherence) = phase_error(&scene, &loose);
        assert!(error.abs() < 3e-5, "{model:?}: {error}");
        assert!(coherence > 0.3, "{model:?}: {coherence}");
        let (more, fewer) = (even.events.len() as f64, loose.events.len() as f64);
        assert!((fewer / more - 1.0).abs() < 0.01, "{model:?}: {fewer} of {more}");
    }
}

#[test]
fn a_slow_readout_loses_and_counts() {
    let mut scene = fixed(Model::Edge, 3000.0);
    let all = generate(&scene).unwrap();
    assert_eq!(all.truth.dropped, 0);
    let all_events = all.events.len() as f64;
    scene.sensor.readout_mev_s = Some(0.8);
    scene.sensor.readout_queue = 500;
    let some = generate(&scene).unwrap();
    assert!(some.truth.dropped > 0);
    let sum = some.events.len() as u64 + some.truth.dropped;
    let missing = all.events.len() as u64 - sum;
    // What was still in the queue at the end is neither read nor lost.
    assert!(missing <= 501, "{missing}");
    let per_ms = some.events.iter().filter(|e| e.t_us / 1000 == 100).count();
    assert!(per_ms <= 801, "{per_ms}");
    // The truth counts what is left of the rotor's: noise is lost as well.
    let left = |all: u64| all as f64 * some.events.len() as f64 / all_events;
    let of_rotor = some.truth.rotors[0].events as f64;
    assert!((of_rotor / left(all.truth.rotors[0].events) - 1.0).abs() < 0.02, "{of_rotor}");
}

#[test]
fn the_gyro_integrates_to_the_roll() {
    let mut scene = fixed(Model::Edge, 3000.0);
    scene.duration_ms = 1000.0;
    scene.sensor.noise_hz = 0.0;
    scene.rotors.clear();
    scene.camera = Camera {
        tremor_mrad: 3.0,
        roll_rad_s: 0.05,
        gyro: Some(Gyro { noise_rad_s: 0.0, ..Gyro::default() }),
        ..Camera::default()
    };
    let made = generate(&scene).unwrap();
    let sum: f64 = made.gyro.iter().map(|s| f64::from(s.roll_rad_s)).sum();
    let mean = sum / made.gyro.len() as f64;
    assert_eq!(made.gyro.len(), 1000);
    assert!(
        (mean - made.truth.roll_mean_rad_s).abs() < 1e-3,
        "{mean} {}",
        made.truth.roll_mean_rad_s
    );
    assert!(made.truth.roll_mean_rad_s.abs() > 0.03);
}

#[test]
fn a_rolling_camera_shifts_the_camera_speed_only() {
    let mut scene = fixed(Model::Edge, 300.0);
    scene.camera.roll_rad_s = 0.1;
    let motion = Motion::new(&scene);
    assert!((motion.rpm_room(0, 0.0, 1.0).unwrap() - 300.0).abs() < 1e-9);
    let rolled = motion.rpm_camera(0, 0.0, 1.0).unwrap() - 300.0;
    assert!((rolled - 0.1 * 60.0 / TAU).abs() < 1e-9);
}

#[test]
fn tremor_has_the_stated_size() {
    let mut squares = (0.0, 0.0);
    for seed in 0..40 {
        let mut scene = fixed(Model::Edge, 300.0);
        scene.seed = seed;
        scene.camera = Camera { tremor_px: 3.0, tremor_mrad: 3.0, ..Camera::default() };
        let motion = Motion::new(&scene);
        for i in 0..500 {
            let t_s = f64::from(i) * 0.02;
            squares.0 += motion.roll(t_s).powi(2);
            squares.1 += motion.pose(t_s).shift[0].powi(2);
        }
    }
    let rms = |sum: f64| (sum / 20_000.0).sqrt();
    assert!((rms(squares.0) / 3e-3 - 1.0).abs() < 0.05, "{}", rms(squares.0));
    assert!((rms(squares.1) / 3.0 - 1.0).abs() < 0.05, "{}", rms(squares.1));
}

#[test]
fn a_fast_clock_stretches_the_stamps() {
    let mut scene = fixed(Model::Edge, 3000.0);
    scene.duration_ms = 150.0;
    scene.clock.error_ppm = Some(5000.0);
    let made = generate(&scene).unwrap();
    let last = made.events.last().unwrap().t_us;
    assert!((150_600..150_750).contains(&last), "{last}");
    assert_eq!(made.truth.clock_error_ppm, 5000.0);
}

#[test]
fn every_shape_turns_in_both_models() {
    for model in MODELS {
        for shape in [Shape::Straight, Shape::Tapered, Shape::Swept, Shape::Dot, Shape::Spokes] {
            for blades in [1, 5] {
                let mut scene = fixed(model, 6000.0);
                scene.rotors[0].shape = shape;
                scene.rotors[0].blades = blades;
                let made = generate(&scene).unwrap();
                let (slope, coherence) = phase_error(&scene, &made);
                let name = format!("{model:?} {shape:?} {blades}");
                assert!(
                    made.truth.rotors[0].events > 1000,
                    "{name}: {} events",
                    made.truth.rotors[0].events
                );
                assert!(slope.abs() < 1e-3, "{name}: {:.1} ppm", slope * 1e6);
                assert!(coherence > 0.02, "{name}: {coherence}");
            }
        }
    }
}

#[test]
fn scenes_without_a_rotor_have_events_and_are_to_be_refused() {
    let none = Scene { rotors: Vec::new(), seed: 3, ..Scene::default() };
    let shake = Scene {
        camera: Camera { tremor_px: 3.0, tremor_mrad: 3.0, ..Camera::default() },
        background: Background { contrast: 0.4, boxes: 6, ..Background::default() },
        ..none.clone()
    };
    let bar = Mover::Bars {
        direction_deg: 20.0,
        speed_px_s: 1500.0,
        width_px: 20.0,
        spacing_px: None,
        offset_px: -120.0,
        contrast: 0.8,
    };
    let walker = Mover::Walker {
        x_px: 120.0,
        y_px: 130.0,
        height_px: 150.0,
        speed_px_s: 150.0,
        step_hz: 2.0,
        contrast: -0.8,
    };
    let scenes = [
        ("noise", none.clone(), 5_000),
        ("shake", shake, 20_000),
        ("bar", Scene { movers: vec![bar], ..none.clone() }, 50_000),
        ("walker", Scene { movers: vec![walker], ..none.clone() }, 15_000),
        ("lamp", Scene { lamp: Some(Lamp::default()), duration_ms: 30.0, ..none }, 100_000),
    ];
    for (name, scene, least) in scenes {
        let made = generate(&scene).unwrap();
        assert_eq!(made.truth.verdict, Verdict::Refuse);
        assert!(made.events.len() > least, "{name}: {} events", made.events.len());
    }
}

#[test]
fn the_sensor_does_what_its_settings_say() {
    let quiet = Scene {
        rotors: Vec::new(),
        sensor: Sensor { noise_hz: 10.0, ..Sensor::default() },
        ..Scene::default()
    };
    let noise = generate(&quiet).unwrap().events.len() as f64;
    let expected = 346.0 * 260.0 * 10.0 * 0.15;
    assert!((noise / expected - 1.0).abs() < 0.03, "{noise}");
    let mut hot = quiet.clone();
    hot.sensor.noise_hz = 0.0;
    hot.sensor.hot_pixels = 5;
    let events = generate(&hot).unwrap().events;
    let mut places: Vec<_> = events.iter().map(|e| (e.x, e.y)).collect();
    places.sort_unstable();
    places.dedup();
    assert_eq!(places.len(), 5);
    let mut on = fixed(Model::Threshold, 3000.0);
    on.sensor.all_on = true;
    assert!(generate(&on).unwrap().events.iter().all(|e| e.polarity == Polarity::On));
    let mut lossy = fixed(Model::Edge, 3000.0);
    let all = generate(&lossy).unwrap().truth.rotors[0].events as f64;
    lossy.sensor.dropout = 0.2;
    let some = generate(&lossy).unwrap().truth.rotors[0].events as f64;
    assert!((some / all - 0.8).abs() < 0.01, "{}", some / all);
}

#[test]
fn the_scene_survives_json_and_rejects_nonsense() {
    let scene = Scene { lamp: Some(Lamp::default()), ..Scene::default() };
    let text = serde_json::to_string(&scene).unwrap();
    assert_eq!(serde_json::from_str::<Scene>(&text).unwrap(), scene);
    assert!(serde_json::from_str::<Scene>(r#"{"rotor": []}"#).is_err());
    let mut bad = Scene::default();
    bad.rotors[0].blades = 0;
    let error = generate(&bad).unwrap_err();
    assert_eq!(error.place, "rotors[0].blades");
    bad.rotors[0] = Rotor { ramp_per_s: -20.0, ..Rotor::default() };
    assert!(generate(&bad).is_err());
}

#[test]
fn every_preset_can_be_made() {
    use clap::ValueEnum as _;
    for preset in presets::Preset::value_variants() {
        let mut scene = preset.scene();
        scene.duration_ms = scene.duration_ms.min(30.0);
        let made = generate(&scene).unwrap();
        let refuse = scene.rotors.is_empty();
        assert_eq!(made.truth.verdict == Verdict::Refuse, refuse, "{preset:?}");
        assert!(made.events.len() > 1000, "{preset:?}: {} events", made.events.len());
        for r in &made.truth.rotors {
            assert!(r.events > 200, "{preset:?}: a rotor with {} events", r.events);
        }
    }
}

#[test]
fn the_events_themselves_show_the_camera_speed() {
    for model in MODELS {
        let mut scene = fixed(model, 1200.0);
        scene.camera.roll_rad_s = 0.5;
        let made = generate(&scene).unwrap();
        // Explained by a still camera, the events turn with the speed relative to the camera: 4 permille faster.
        let mut still = scene.clone();
        still.camera.roll_rad_s = 0.0;
        still.rotors[0].rpm = made.truth.rotors[0].rpm_camera_mean_signed;
        let (slope, _) = phase_error(&still, &made);
        assert!(slope.abs() < 60e-6, "{model:?}: off by {:.1} ppm", slope * 1e6);
        assert!(still.rotors[0].rpm > 1204.0, "{}", still.rotors[0].rpm);
    }
}

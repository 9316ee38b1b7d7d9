//! Pixels that have just been switched on: what they tell at first must not bend the first reading.

use evtach_core::{Direction, Event, Geometry};
use evtach_host::measure::Capacity;
use evtach_host::synth::scene::{Clock, Sensor};
use evtach_host::synth::{Motion, Rotor, Scene, generate};
use evtach_tests::{Loaded, made, measure, show};

/// Largest error in standard errors, and what these may be.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
const LARGEST_SIGMA_PERMILLE: f64 = 1.0;
/// How early a pixel of a narrow bandwidth tells an edge where the stream begins, and how fast that fades: it has taken the light of
/// the first instant for what it always was.
const EARLY_US: f64 = 1_500.0;
const FADES_US: f64 = 3_000.0;
/// What the errors of many readings may be at most in the mean, in their standard errors.
const LARGEST_RMS_SIGMA: f64 = 1.0;

fn not_settled(mut event: Event) -> Event {
    let t_us = event.t_us as f64;
    event.t_us = (t_us - EARLY_US * (-t_us / FADES_US).exp()).max(0.0) as u64;
    event
}

/// The first reading of a rotor, from a camera that trembles by so many pixels and milliradians.
fn first_reading(name: &str, tremor_px: f64, capacity: Capacity) {
    let rotor = Rotor { blades: 5, rpm: 1500.0, ..Rotor::default() };
    let mut scene = Scene { seed: 17, duration_ms: 150.0, rotors: vec![rotor], ..Scene::default() };
    (scene.camera.tremor_px, scene.camera.tremor_mrad) = (tremor_px, tremor_px);
    let made = made(&scene);
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let events = made.events.iter().copied().map(not_settled).collect();
    let (readings, _) = measure(&Loaded { geometry, events }, capacity);
    let speed = readings.first().and_then(|reading| reading.rotors.first()?.speed);
    let speed = speed.expect("a speed");
    assert_eq!(speed.direction(), Direction::Cw);
    let right_rpm = Motion::new(&scene).rpm_camera(0, 0.0, 0.15).expect("a rotor");
    let (rpm, sigma_rpm) = (f64::from(speed.rpm()), f64::from(speed.rpm_sigma()));
    let off_sigma = (rpm - right_rpm) / sigma_rpm;
    let [off, sigma] = [rpm - right_rpm, sigma_rpm].map(|rpm| 1e3 * rpm / right_rpm);
    let told =
        format!("{name}, {} memory: {off:+.3} permille, {off_sigma:+.1} sigma", capacity.as_str());
    show(&told);
    assert!(off_sigma.abs() < LARGEST_ERROR_SIGMA && sigma < LARGEST_SIGMA_PERMILLE, "{told}");
}

#[test]
fn pixels_settle_before_they_are_believed() {
    for capacity in Capacity::ALL {
        first_reading("tripod", 0.0, capacity);
        first_reading("hand", 3.0, capacity);
    }
}

/// A slow rotor of a little more than two turns, number `i` of its kind, before a sensor that has only just started.
fn slow(i: u8) -> Scene {
    let share = f64::from(i) / 24.0;
    let rpm = (60.0 + 340.0 * share) * if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let rotor = Rotor {
        blades: 2 + i % 5,
        radius_px: 30.0 + f64::from(i * 7 % 24) * 1.7,
        blade_spread_mrad: 5.0,
        rpm,
        ..Rotor::default()
    };
    let threshold = [0.12, 0.2, 0.3][usize::from(i) % 3];
    Scene {
        seed: 900 + u64::from(i),
        duration_ms: (2.05 + 0.55 * share) * 60e3 / rpm.abs(),
        rotors: vec![rotor],
        sensor: Sensor { threshold, cold_start: true, ..Sensor::default() },
        clock: Clock { error_ppm: Some(0.0), ..Clock::default() },
        ..Scene::default()
    }
}

/// Its pixels report their first edge early, in a quarter of the window or less: by so much more may the speed be off.
#[test]
fn slow_rotors_are_told_with_what_pixels_do_at_first() {
    let (mut squares, mut told) = (0.0, 0.0);
    for i in 0..24 {
        let scene = slow(i);
        let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
        let events = generate(&scene).expect("a scene in range").events;
        let loaded = Loaded { geometry, events };
        let right_rpm = scene.rotors[0].rpm;
        for capacity in Capacity::ALL {
            let (readings, _) = measure(&loaded, capacity);
            let rotors = readings.iter().flat_map(|reading| &reading.rotors);
            for speed in rotors.filter_map(|rotor| rotor.speed) {
                let rpm = f64::from(speed.rpm());
                let rpm = if speed.direction() == Direction::Cw { rpm } else { -rpm };
                let off_sigma = (rpm - right_rpm) / f64::from(speed.rpm_sigma());
                let told_rpm =
                    format!("{right_rpm:+.1} rpm, {}: {off_sigma:+.2} sigma", capacity.as_str());
                show(&told_rpm);
                assert!(off_sigma.abs() < LARGEST_ERROR_SIGMA, "{told_rpm}");
                squares += off_sigma * off_sigma;
                told += 1.0;
            }
        }
    }
    let rms_sigma = f64::sqrt(squares / told);
    show(&format!("{told} speeds, {rms_sigma:.2} sigma in the mean"));
    assert!(told > 47.0 && rms_sigma < LARGEST_RMS_SIGMA, "{told} speeds, {rms_sigma}");
}

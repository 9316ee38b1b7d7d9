//! Pixels that have just been switched on: what they tell at first must not bend the first reading.

use evtach_core::{Direction, Event, Geometry};
use evtach_host::measure::Capacity;
use evtach_host::synth::{Motion, Rotor, Scene};
use evtach_tests::{Loaded, made, measure, show};

/// Largest error in standard errors, and what these may be.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
const LARGEST_SIGMA_PERMILLE: f64 = 1.0;
/// How early a pixel of a narrow bandwidth tells an edge where the stream begins, and how fast that fades: it has taken the light of
/// the first instant for what it always was.
const EARLY_US: f64 = 1_500.0;
const FADES_US: f64 = 3_000.0;

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

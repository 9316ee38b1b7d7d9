//! Random scenes of the kind that `bench trust` makes, in each of which a wrong speed was once told, or one far beyond its error
//! bar: none may be now. The scenes stand in `mistaken.jsonl`, with what was told.

use evtach_core::Geometry;
use evtach_host::measure::Capacity;
use evtach_host::synth::{Motion, Scene, generate};
use evtach_tests::{Loaded, measure, show};
use serde::Deserialize;

/// Farthest that any speed may be off, relative, and in its own standard errors: what `bench trust` asks.
const MOST_ERROR: f64 = 0.01;
const MOST_SIGMAS: f64 = 6.0;

#[derive(Deserialize)]
struct Mistake {
    /// What was told.
    told: String,
    /// The memory that it was told with.
    memory: String,
    scene: Scene,
}

#[test]
fn what_was_told_wrong_is_not_told_again() {
    let mut failures = Vec::new();
    for line in include_str!("mistaken.jsonl").lines() {
        let Mistake { told, memory, scene } = serde_json::from_str(line).expect("a scene");
        let capacity = *Capacity::ALL.iter().find(|c| c.as_str() == memory).expect("a memory");
        let made = generate(&scene).expect("a scene in range");
        let motion = Motion::new(&scene);
        let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
        let (readings, _) = measure(&Loaded { geometry, events: made.events }, capacity);
        let mut speeds = 0;
        for reading in &readings {
            let half_s = 0.5e-6 * f64::from(reading.window_us);
            let middle_s = reading.t_us as f64 * 1e-6;
            let right_rpm = |rotor| motion.rpm_camera(rotor, middle_s - half_s, middle_s + half_s);
            for speed in reading.rotors.iter().filter_map(|rotor| rotor.speed) {
                let rpm =
                    f64::from(speed.omega_rad_s) * f64::from(evtach_core::Speed::RPM_PER_RAD_S);
                let most = MOST_SIGMAS * f64::from(speed.rpm_sigma());
                let right = |right_rpm: f64| {
                    let off_rpm = (rpm - right_rpm).abs();
                    off_rpm < MOST_ERROR * right_rpm.abs() && off_rpm < most
                };
                if !(0..scene.rotors.len()).filter_map(right_rpm).any(right) {
                    let sigma = speed.rpm_sigma();
                    failures.push(format!("{told}: {rpm:.1} +- {sigma:.2} rpm at {middle_s:.3} s"));
                }
                speeds += 1;
            }
        }
        show(&format!("{told} ({memory} memory): {speeds} speeds in {} readings", readings.len()));
    }
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

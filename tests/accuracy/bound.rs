//! No error bar is smaller than what the events can tell at all.

use evtach_core::{Geometry, Settings};
use evtach_host::measure::{Capacity, measure_events};
use evtach_host::synth::{Model, Rotor, Scene, generate};
use evtach_tests::show;

/// Turns a minute of one rad/s.
const RPM_PER_RAD_S: f64 = 60.0 / std::f64::consts::TAU;

/// The least standard error of a slope through the times of so many events, relative (Cramer-Rao): the scene's true jitter, and
/// all events of the rotor.
fn bound(jitter_us: f64, window_us: f64, events: f64) -> f64 {
    12f64.sqrt() * jitter_us / (window_us * events.sqrt())
}

#[test]
fn no_sigma_is_below_the_physical_bound() {
    for model in [Model::Threshold, Model::Edge] {
        for (rpm, blades, seed) in
            [(300.0, 3, 61), (900.0, 4, 62), (-1500.0, 2, 63), (3000.0, 5, 64), (9000.0, 3, 65)]
        {
            let rotors = vec![Rotor { rpm, blades, ..Rotor::default() }];
            let scene = Scene { model, seed, duration_ms: 600.0, rotors, ..Scene::default() };
            let made = generate(&scene).expect("a scene in range");
            let geometry = Geometry::new(scene.width_px, scene.height_px).expect("in range");
            // The clock's error alone would lift most of them above it.
            let settings = Settings { clock_sigma_ppm: 0.0, ..Settings::new(geometry) };
            let per_us = made.truth.rotors[0].events as f64 / (1e3 * scene.duration_ms);
            for capacity in Capacity::ALL {
                let (readings, _) = measure_events(&made.events, &[], settings, capacity);
                let mut told = 0;
                for reading in &readings {
                    let window_us = f64::from(reading.window_us);
                    let least = bound(scene.sensor.jitter_us, window_us, per_us * window_us);
                    for speed in reading.rotors.iter().filter_map(|rotor| rotor.speed) {
                        told += 1;
                        let sigma = f64::from(speed.omega_sigma_rad_s) * RPM_PER_RAD_S / rpm.abs();
                        let name = format!("{rpm} rpm, {model:?}, {capacity:?}");
                        show(&format!("{name}: {:.1} times the bound", sigma / least));
                        assert!(sigma >= least, "{name}: {sigma:e} below {least:e}");
                    }
                }
                assert!(told > 0, "{rpm} rpm, {model:?}, {capacity:?}: no speed");
            }
        }
    }
}

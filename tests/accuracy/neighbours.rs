//! Rotors of which a neighbour of the right harmonic keeps more step than the right one does, about a centre beside the axis, and what is
//! seen on one side only.

use evtach_core::{Event, Geometry, Speed};
use evtach_host::measure::Capacity;
use evtach_host::synth::presets::hand;
use evtach_host::synth::scene::{Background, Camera, Sensor};
use evtach_host::synth::{Model, Motion, Rotor, Scene};
use evtach_tests::{Loaded, made, measure, show};

/// Largest error in standard errors, and in permille.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
const LARGEST_ERROR_PERMILLE: f64 = 2.0;

/// How many readings have a speed of the scene's rotor, which must be right, and its blades; of the events that are seen.
fn read(
    name: &str,
    scene: &Scene,
    capacity: Capacity,
    is_seen: impl Fn(usize, &Event) -> bool,
) -> usize {
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let made = made(scene);
    let seen = made.events.iter().enumerate().filter(|(index, event)| is_seen(*index, event));
    let events = seen.map(|(_, event)| *event).collect();
    let (readings, _) = measure(&Loaded { geometry, events }, capacity);
    let motion = Motion::new(scene);
    let mut speeds = 0;
    for reading in &readings {
        let half_s = 0.5e-6 * f64::from(reading.window_us);
        let middle_s = reading.t_us as f64 * 1e-6;
        let right_rpm = motion.rpm_camera(0, middle_s - half_s, middle_s + half_s);
        let right_rpm = right_rpm.expect("a rotor");
        for rotor in &reading.rotors {
            let Some(speed) = rotor.speed else { continue };
            let rpm = f64::from(speed.omega_rad_s) * f64::from(Speed::RPM_PER_RAD_S);
            let off_permille = 1e3 * (rpm / right_rpm - 1.0);
            let off_sigma = (rpm - right_rpm) / f64::from(speed.rpm_sigma());
            let told = format!("{name}: {off_permille:+.3} permille, {off_sigma:+.1} sigma");
            assert!(
                off_permille.abs() < LARGEST_ERROR_PERMILLE
                    && off_sigma.abs() < LARGEST_ERROR_SIGMA,
                "{told}"
            );
            let blades = scene.rotors[0].blades;
            assert!(rotor.blades.is_none_or(|counted| counted == blades), "{told}: {rotor:#?}");
            show(&told);
            speeds += 1;
        }
    }
    speeds
}

/// Seven blades, one of them narrower, in a hand: eight windings were refused, or told as eight blades at 520 rpm.
#[test]
fn the_rival_of_what_is_refused_is_measured_too() {
    for seed in [2, 42, 44, 61, 75, 130] {
        let rotor = Rotor {
            blades: 7,
            rpm: 573.0,
            x_px: 147.0,
            y_px: 146.0,
            radius_px: 31.0,
            odd_width: 0.7,
            ..Rotor::default()
        };
        let scene = Scene {
            seed,
            duration_ms: 300.0,
            model: Model::Threshold,
            rotors: vec![rotor],
            camera: Camera { tremor_px: 4.0, ..hand() },
            background: Background { contrast: 0.0, boxes: 0, ..Background::default() },
            sensor: Sensor {
                threshold: 0.5,
                blur_px: 1.5,
                jitter_us: 80.0,
                noise_hz: 0.2,
                dropout: 0.3,
                readout_mev_s: Some(1.0),
                ..Sensor::default()
            },
            ..Scene::default()
        };
        let name = format!("seven blades, seed {seed}");
        assert!(read(&name, &scene, Capacity::Device, |_, _| true) > 0, "{name}");
    }
}

/// What is lit from one side is seen there more often: a single blade keeps step with twice its speed as well as with its own, and was `too_fast`.
#[test]
fn a_single_blade_lit_from_one_side() {
    for (seed, rpm, radius_px) in [(1, 6_300.0, 50.0), (2, -6_700.0, 26.0)] {
        let rotor = Rotor { blades: 1, rpm, radius_px, ..Rotor::default() };
        let (x_px, y_px) = (rotor.x_px, rotor.y_px);
        let scene = Scene { seed, duration_ms: 300.0, rotors: vec![rotor], ..Scene::default() };
        // All of it on the right, none on the left; every hundredth event has the same chance of so many.
        let is_lit = |index: usize, event: &Event| {
            let (dx, dy) = (f64::from(event.x) - x_px, f64::from(event.y) - y_px);
            let lit = 0.5 + 0.5 * dx / dx.hypot(dy).max(1.0);
            (index * 37 % 100) as f64 + 0.5 < 100.0 * lit.powf(1.4)
        };
        for capacity in Capacity::ALL {
            let name = format!("{rpm} rpm, {} memory", capacity.as_str());
            assert!(read(&name, &scene, capacity, is_lit) > 0, "{name}");
        }
    }
}

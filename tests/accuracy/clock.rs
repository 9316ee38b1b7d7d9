//! The camera's clock, whose error no recording shows, in what a speed is known to.

use evtach_core::{Frame, Geometry, Reading, Settings, Speed, Status};
use evtach_host::measure::{Capacity, measure_events, summarise};
use evtach_host::synth::scene::{Camera, Gyro};
use evtach_host::synth::{Rotor, Scene};
use evtach_tests::{made, show};

/// So large that it counts beside all other errors, and no speed is refused for it.
const CLOCK_PPM: f32 = 100.0;

/// How far the clock lifts a standard error, over what was stated of it: 1 where the squares add up.
fn lifted(with: Speed, without: Speed) -> f64 {
    // What no window covers is filled in by how well each is known.
    assert!((with.omega_rad_s / without.omega_rad_s - 1.0).abs() < 1e-5, "{with:?} {without:?}");
    let variance = |speed: Speed| f64::from(speed.omega_sigma_rad_s).powi(2);
    let clock = 1e-6 * f64::from(CLOCK_PPM) * f64::from(with.omega_rad_s);
    (variance(with) - variance(without)) / (clock * clock)
}

fn speeds(readings: &[Reading]) -> Vec<(Status, Speed)> {
    let rotors = readings.iter().flat_map(|reading| &reading.rotors);
    rotors.filter_map(|rotor| Some((rotor.status, rotor.speed?))).collect()
}

#[test]
fn the_clock_is_in_the_error_of_each_reading_and_of_their_mean() {
    let rotor = |rpm| Rotor { rpm, ..Rotor::default() };
    let scene = |rpm, duration_ms, camera| Scene {
        rotors: vec![rotor(rpm)],
        duration_ms,
        camera,
        seed: 5,
        ..Scene::default()
    };
    let gyro = Some(Gyro { offset_rad_s: 0.0, ..Gyro::default() });
    let hand = Camera { tremor_px: 3.0, tremor_mrad: 3.0, gyro, ..Camera::default() };
    // Locked, also over time that no window covers; coarse; in a hand, which rolls; and in the room.
    let scenes = [
        ("tripod", scene(3000.0, 530.0, Camera::default()), Status::Locked, Frame::Camera),
        ("part of a turn", scene(300.0, 170.0, Camera::default()), Status::Coarse, Frame::Camera),
        ("hand", scene(-3000.0, 400.0, hand.clone()), Status::Locked, Frame::Camera),
        ("room", scene(-3000.0, 400.0, hand), Status::Locked, Frame::Room),
    ];
    for (name, scene, status, frame) in scenes {
        let recording = made(&scene);
        let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
        let samples = if frame == Frame::Room { &recording.gyro[..] } else { &[] };
        let told = |clock_sigma_ppm| {
            let settings =
                Settings { clock_sigma_ppm, gyro_sigma_rad_s: 3e-3, ..Settings::new(geometry) };
            let (readings, _) =
                measure_events(&recording.events, samples, settings, Capacity::Full);
            let end_us = (scene.duration_s() * 1e6) as u64;
            let mean = summarise(&readings, &(0..end_us), clock_sigma_ppm).rotors[0].speed;
            (speeds(&readings), mean.expect("a speed"))
        };
        let ((with, mean_with), (without, mean_without)) = (told(CLOCK_PPM), told(0.0));
        assert!(with.iter().any(|(told, speed)| (*told, speed.frame) == (status, frame)), "{name}");
        assert_eq!(with.len(), without.len(), "{name}");
        for ((_, with), (_, without)) in with.into_iter().zip(without) {
            let lifted = lifted(with, without);
            assert!((lifted - 1.0).abs() < 0.01, "{name}: {lifted} of the clock's variance");
        }
        let lifted = lifted(mean_with, mean_without);
        show(&format!("{name}: {lifted:.4} of the clock's variance in the mean"));
        assert!(
            (lifted - 1.0).abs() < 0.02,
            "{name}: {lifted} of the clock's variance in the mean"
        );
    }
}

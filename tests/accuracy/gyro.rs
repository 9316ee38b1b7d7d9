//! A gyro whose zero nobody took: the speed in the room is right, and said to be no better than it is.

use evtach_core::{Frame, Geometry, Reading, Settings};
use evtach_host::measure::{Capacity, measure_events};
use evtach_host::synth::scene::{Camera, Gyro};
use evtach_host::synth::{Model, Rotor, Scene, generate, presets};
use evtach_tests::show;

const RPM: f64 = 600.0;

/// Seconds that a hand holds the camera for.
const LASTS_S: f64 = 10.0;

/// Offsets in rad/s: none, and about what cameras at rest have shown, either way; and in which memory.
const OFFSETS: [(f64, Capacity); 3] =
    [(0.0, Capacity::Device), (0.02, Capacity::Device), (-0.02, Capacity::Full)];

fn readings(camera: Camera, offset_rad_s: f64, seed: u64, capacity: Capacity) -> Vec<Reading> {
    readings_with(Settings::new, camera, offset_rad_s, seed, capacity)
}

fn readings_with(
    settings: impl Fn(Geometry) -> Settings,
    camera: Camera,
    offset_rad_s: f64,
    seed: u64,
    capacity: Capacity,
) -> Vec<Reading> {
    let gyro = Gyro { offset_rad_s, ..Gyro::default() };
    let scene = Scene {
        rotors: vec![Rotor { rpm: RPM, radius_px: 30.0, ..Rotor::default() }],
        camera: Camera { gyro: Some(gyro), ..camera },
        duration_ms: LASTS_S * 1e3,
        model: Model::Edge,
        seed,
        ..Scene::default()
    };
    let made = generate(&scene).expect("a scene in range");
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    measure_events(&made.events, &made.gyro, settings(geometry), capacity).0
}

/// How far a reading is off, how far it may be (one sigma), both in rpm, and what it is relative to.
fn told(reading: &Reading) -> Option<(f64, f64, Frame)> {
    let speed = reading.rotors.first()?.speed?;
    Some((f64::from(speed.rpm()) - RPM, speed.rpm_sigma().into(), speed.frame))
}

fn mean(of: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = of.fold((0.0_f64, 0.0), |(count, sum), one| (count + 1.0, sum + one));
    sum / count.max(1.0)
}

#[test]
fn from_a_hand_a_speed_is_right_while_the_offset_of_the_gyro_is_being_found() {
    // Each reading takes the gyro where what is left of its offset is less than what the hand's roll leaves.
    let mut in_the_room = 0;
    for (seed, (offset_rad_s, capacity)) in (70..).zip(OFFSETS) {
        let readings = readings(presets::hand(), offset_rad_s, seed, capacity);
        let told: Vec<_> = readings.iter().filter_map(told).collect();
        assert!(told.len() > 80, "{} of {} readings", told.len(), readings.len());
        for (off, sigma, frame) in &told {
            assert!(off.abs() < 4.0 * sigma, "{offset_rad_s}: {off} +/- {sigma}, {frame:?}");
        }
        // While nothing is known of the offset, the gyro is left out.
        assert_eq!(told.first().map(|(_, _, frame)| *frame), Some(Frame::Camera));
        let fifth = told.len() / 5;
        let (first, last) = (&told[..fifth], &told[told.len() - fifth..]);
        let sigma = |of: &[(f64, f64, Frame)]| mean(of.iter().map(|(_, sigma, _)| *sigma));
        let (before, after) = (sigma(first), sigma(last));
        // What the offset leaves is common to all of them.
        let off = mean(last.iter().map(|(off, _, _)| *off));
        show(&format!(
            "gyro {:+.0} mrad/s off, {capacity:?}: sigma {before:.3} rpm in the first two seconds, {after:.3} in the last, off by {off:.3}",
            1e3 * offset_rad_s
        ));
        in_the_room += last.iter().filter(|(_, _, frame)| *frame == Frame::Room).count();
        // An offset that stayed in it would be 0.19 rpm, and a mean over two seconds of a hand is good to 0.06.
        assert!(off.abs() < 0.12, "{off}");
    }
    assert!(in_the_room > 0, "the gyro helped nowhere");
}

#[test]
fn on_a_tripod_a_gyro_takes_nothing_from_a_speed() {
    for (seed, (offset_rad_s, capacity)) in (80..).zip(OFFSETS) {
        let readings = readings(Camera::default(), offset_rad_s, seed, capacity);
        for reading in &readings {
            let (off, sigma, frame) = told(reading).expect("a speed");
            assert!(off.abs() < 4.0 * sigma, "{offset_rad_s}: {off} +/- {sigma}");
            assert_eq!(frame, Frame::Camera);
            assert!(sigma < 1e-3 * RPM, "{sigma}");
        }
    }
}

/// As on a turntable. A hand's roll averages out, and so is what the gyro tells in the mean taken for its offset; this one does not.
#[test]
fn a_camera_that_rolls_round_is_not_taken_for_a_gyro_s_offset() {
    const ROLL_RAD_S: f64 = 0.3;
    let camera = || Camera { roll_rad_s: ROLL_RAD_S, ..presets::hand() };
    let rpm_relative = ROLL_RAD_S * 60.0 / std::f64::consts::TAU;
    for (gyro_sigma_rad_s, wanted, right) in
        [(None, Frame::Camera, rpm_relative), (Some(3e-3), Frame::Room, 0.0)]
    {
        let settings = |geometry| {
            let settings = Settings::new(geometry);
            let gyro_sigma_rad_s = gyro_sigma_rad_s.unwrap_or(settings.gyro_sigma_rad_s);
            Settings { gyro_sigma_rad_s, ..settings }
        };
        let readings = readings_with(settings, camera(), 0.0, 90, Capacity::Device);
        let told: Vec<_> = readings.iter().filter_map(told).collect();
        assert!(told.len() > 80, "{} of {} readings", told.len(), readings.len());
        for (off, sigma, frame) in told {
            assert_eq!(frame, wanted);
            assert!((off - right).abs() < 4.0 * sigma, "{off} instead of {right} +/- {sigma}");
        }
    }
}

//! A readout that cannot keep up: while its queue fills, all speeds seem lower by the same share, which must not be told for theirs.

use evtach_core::Geometry;
use evtach_host::measure::Capacity;
use evtach_host::synth::{Rotor, Scene, generate};
use evtach_tests::{Loaded, made, measure, show};

/// Speed of the rotor.
const RPM: f64 = 3_000.0;
/// Farthest that any speed may be off, relative, and in its own standard errors.
const MOST_ERROR: f64 = 0.01;
const LARGEST_ERROR_SIGMA: f64 = 4.0;
/// Largest standard error of a speed where the queue is seen to fill.
const LARGEST_SIGMA_PERMILLE: f64 = 1.0;
/// Length of the recording.
const DURATION_MS: f64 = 200.0;

/// The scene with a readout that keeps up with such a share of its events, and holds so many.
fn scene(share: f64, readout_queue: u32) -> Scene {
    let rotor = Rotor { blades: 3, rpm: RPM, ..Rotor::default() };
    let mut scene =
        Scene { seed: 23, duration_ms: DURATION_MS, rotors: vec![rotor], ..Scene::default() };
    let all = made(&scene).events.len() as f64;
    scene.sensor.readout_mev_s = Some(share * all / (1e3 * DURATION_MS));
    scene.sensor.readout_queue = readout_queue;
    scene
}

/// Standard errors in permille of all speeds that are told; all of them are right.
fn sigmas_permille(share: f64, queue: u32, capacity: Capacity) -> Vec<f64> {
    let scene = scene(share, queue);
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let events = generate(&scene).expect("a scene in range").events;
    let (readings, _) = measure(&Loaded { geometry, events }, capacity);
    let speeds = readings.iter().flat_map(|reading| &reading.rotors).filter_map(|r| r.speed);
    speeds
        .map(|speed| {
            let (rpm, sigma_rpm) = (f64::from(speed.rpm()), f64::from(speed.rpm_sigma()));
            let [off, sigma] = [rpm - RPM, sigma_rpm].map(|rpm| 1e3 * rpm / RPM);
            let told = format!(
                "{share} of all events, {queue} may wait, {} memory: {off:+.3} +- {sigma:.3} permille",
                capacity.as_str()
            );
            show(&told);
            let off_sigma = (off / sigma).abs();
            assert!(off.abs() < 1e3 * MOST_ERROR && off_sigma < LARGEST_ERROR_SIGMA, "{told}");
            sigma
        })
        .collect()
}

#[test]
fn no_speed_is_told_that_a_filling_queue_has_stretched() {
    for capacity in Capacity::ALL {
        for queue in [512, 4_096] {
            for share in [0.3, 0.6, 0.9, 0.97, 0.985, 0.995, 1.01] {
                sigmas_permille(share, queue, capacity);
            }
        }
    }
}

#[test]
fn a_queue_that_is_seen_to_fill_leaves_the_speed_sure() {
    for capacity in Capacity::ALL {
        for share in [0.4, 0.7] {
            let sigmas = sigmas_permille(share, 4_096, capacity);
            assert!(
                sigmas.iter().any(|sigma| *sigma < LARGEST_SIGMA_PERMILLE),
                "{share}, {} memory: {sigmas:?}",
                capacity.as_str()
            );
        }
    }
}

//! The random scenes.
//!
//! A fifth without a rotor: shaken walls, bars and gratings, walkers, lamps, noise, and mixtures. The others: speeds from
//! 60 to 60 000 rpm and 1 to 8 blades (at most 150 000 passages a minute), radii from 12 to 80 px, every shape, half from
//! the hand or on a shaken table, blades that sit up to half a degree (one standard deviation) off their even places, half before
//! a sensor that has only just started, a tenth each with a ramp, hunting, one odd blade, a lamp (faint everywhere, or a deep
//! spot); a sixth with more than one rotor; some cut by the frame, some tilted, some too short on purpose, a few with a saturated
//! readout or lost polarity.

use evtach_host::synth::presets::{hand, shaken, wall};
use evtach_host::synth::scene::{Background, Lamp, Mover, Shape};
use evtach_host::synth::{Model, Rotor, Scene};
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

use super::super::spec::{gyro, window_s};

/// The scene of a trial.
pub fn scene(trial: u64) -> Scene {
    // Not the scene's own stream: a trial and a table cell with the same seed have nothing in common.
    let mut rng = Pcg64Mcg::seed_from_u64(trial ^ 0x7455_5354);
    let model = if rng.random::<bool>() { Model::Threshold } else { Model::Edge };
    let mut scene = Scene { model, seed: trial, rotors: Vec::new(), ..Scene::default() };
    sensor(&mut scene, &mut rng);
    camera(&mut scene, &mut rng);
    if rng.random_bool(0.2) {
        nothing_turns(&mut scene, &mut rng);
    } else {
        rotors(&mut scene, &mut rng);
    }
    // Last, so that all else of a trial is as it was when blades sat exactly and every pixel knew its level.
    for rotor in &mut scene.rotors {
        rotor.blade_spread_mrad = rng.random_range(0.0..8.0);
    }
    scene.sensor.cold_start = rng.random();
    scene
}

fn sensor(scene: &mut Scene, rng: &mut Pcg64Mcg) {
    let s = &mut scene.sensor;
    s.jitter_us = log_uniform(rng, 20.0, 200.0);
    s.latency_spread_us = log_uniform(rng, 10.0, 100.0);
    s.noise_hz = log_uniform(rng, 0.1, 5.0);
    s.threshold_spread = rng.random_range(0.02..0.15);
    s.refractory_us = log_uniform(rng, 50.0, 500.0);
    s.blur_px = rng.random_range(0.5..1.2);
    s.dropout = rng.random_range(0.0..0.2);
    s.hot_pixels = if rng.random_bool(0.3) { rng.random_range(1..20) } else { 0 };
    s.all_on = rng.random_bool(0.02);
    if rng.random_bool(0.05) {
        s.readout_mev_s = Some(log_uniform(rng, 0.5, 5.0));
    }
}

fn camera(scene: &mut Scene, rng: &mut Pcg64Mcg) {
    let kind = rng.random_range(0.0..1.0);
    if kind < 0.35 {
        let share = rng.random_range(0.3..1.0);
        scene.camera = hand();
        scene.camera.tremor_px *= share;
        scene.camera.tremor_mrad *= share;
        let drift = |rng: &mut Pcg64Mcg| rng.random_range(-10.0..10.0);
        scene.camera.drift_px_s = [drift(rng), drift(rng)];
        if rng.random_bool(0.3) {
            scene.camera.gyro = Some(gyro(rng));
        }
    } else if kind < 0.5 {
        scene.vibration = shaken();
        scene.vibration.amplitude_px *= rng.random_range(0.2..1.5);
    }
    if rng.random_bool(0.5) {
        scene.background = Background { contrast: rng.random_range(0.1..0.4), ..wall() };
    }
}

fn rotors(scene: &mut Scene, rng: &mut Pcg64Mcg) {
    let count = if rng.random_bool(0.16) { rng.random_range(2..=4) } else { 1 };
    if count > 1 {
        (scene.width_px, scene.height_px) = (640, 480);
    }
    let (width, height) = (f64::from(scene.width_px), f64::from(scene.height_px));
    for i in 0..count {
        let mut rotor = rotor(rng);
        if count == 1 {
            // One in twelve is cut by the frame.
            let margin = if rng.random_bool(0.08) { 0.6 } else { 1.05 } * rotor.radius_px + 8.0;
            rotor.x_px = rng.random_range(margin..(width - margin).max(margin + 1.0));
            rotor.y_px = rng.random_range(margin..(height - margin).max(margin + 1.0));
        } else {
            // One in each quarter.
            rotor.radius_px = rotor.radius_px.min(75.0);
            rotor.x_px = width * (0.25 + 0.5 * f64::from(i % 2)) + rng.random_range(-20.0..20.0);
            rotor.y_px = height * (0.25 + 0.5 * f64::from(i / 2)) + rng.random_range(-10.0..10.0);
        }
        scene.rotors.push(rotor);
    }
    if count > 1 {
        // A drone's rotors: alike, with similar speeds.
        let (rpm, blades) = (scene.rotors[0].rpm.abs(), scene.rotors[0].blades);
        for rotor in &mut scene.rotors {
            rotor.blades = blades;
            rotor.rpm =
                rpm.clamp(300.0, 12_000.0) * rng.random_range(0.6..1.4) * rotor.rpm.signum();
        }
    }
    let needed = scene.rotors.iter().map(|r| window_s(r.rpm, r.blades)).fold(0.0, f64::max);
    let share =
        if rng.random_bool(0.1) { rng.random_range(0.2..0.9) } else { rng.random_range(1.03..1.6) };
    scene.duration_ms = (needed * share * 1e3).min(2500.0);
    if rng.random_bool(0.1) {
        // All the light faintly, or a spot of it deeply.
        let faint = rng.random::<bool>();
        let mut light = lamp(rng, if faint { 0.12 } else { 0.3 });
        let spot = [width / 2.0, height / 2.0, rng.random_range(30.0..90.0)];
        light.spot_px = if faint { None } else { light.spot_px.or(Some(spot)) };
        scene.lamp = Some(light);
    }
}

fn rotor(rng: &mut Pcg64Mcg) -> Rotor {
    let blades: u8 = rng.random_range(1..=8);
    let fastest = (150_000.0 / f64::from(blades)).min(60_000.0);
    let rpm = log_uniform(rng, 60.0, fastest);
    let shape = match rng.random_range(0..10) {
        0..4 => Shape::Tapered,
        4..7 => Shape::Swept,
        7..9 => Shape::Straight,
        _ => Shape::Dot,
    };
    // Very fast large rotors would outrun every sensor.
    let largest = if rpm > 12_000.0 { 40.0 } else { 80.0 };
    let mut rotor = Rotor {
        blades,
        shape,
        rpm: if rng.random::<bool>() { rpm } else { -rpm },
        radius_px: log_uniform(rng, 12.0, largest),
        contrast: rng.random_range(0.5..1.2) * if rng.random_bool(0.3) { -1.0 } else { 1.0 },
        ..Rotor::default()
    };
    if rng.random_bool(0.1) {
        rotor.odd_width = rng.random_range(0.5..0.9);
    }
    if rng.random_bool(0.1) {
        rotor.ramp_per_s = rng.random_range(-0.05..0.05);
    }
    if rng.random_bool(0.1) {
        rotor.hunting = log_uniform(rng, 1e-4, 5e-3);
        rotor.hunting_hz = rng.random_range(1.0..8.0);
    }
    if rng.random_bool(0.2) {
        rotor.tilt_deg = rng.random_range(0.0..25.0);
        rotor.tilt_axis_deg = rng.random_range(0.0..180.0);
    }
    rotor
}

fn nothing_turns(scene: &mut Scene, rng: &mut Pcg64Mcg) {
    scene.duration_ms = rng.random_range(150.0..500.0);
    match rng.random_range(0..6) {
        0 => {
            scene.camera = hand();
            scene.background = Background { contrast: rng.random_range(0.2..0.5), ..wall() };
        }
        1 => scene.movers.push(bars(rng, false)),
        2 => scene.movers.push(bars(rng, true)),
        3 => scene.movers.push(Mover::Walker {
            x_px: rng.random_range(60.0..280.0),
            y_px: rng.random_range(100.0..150.0),
            height_px: rng.random_range(60.0..200.0),
            speed_px_s: rng.random_range(-200.0..200.0),
            step_hz: rng.random_range(1.0..4.0),
            contrast: rng.random_range(0.4..1.0) * if rng.random::<bool>() { 1.0 } else { -1.0 },
        }),
        4 => {
            scene.lamp = Some(lamp(rng, 0.6));
            scene.duration_ms = scene.duration_ms.min(300.0);
            if rng.random_bool(0.3) {
                scene.movers.push(bars(rng, false));
            }
        }
        _ => {
            scene.sensor.noise_hz = log_uniform(rng, 0.5, 30.0);
            scene.sensor.hot_pixels = rng.random_range(0..60);
        }
    }
}

fn bars(rng: &mut Pcg64Mcg, grating: bool) -> Mover {
    let width_px = rng.random_range(6.0..60.0);
    let speed_px_s = log_uniform(rng, 200.0, 4000.0);
    Mover::Bars {
        direction_deg: rng.random_range(0.0..360.0),
        speed_px_s,
        width_px,
        spacing_px: grating.then(|| width_px * rng.random_range(1.5..4.0)),
        offset_px: -speed_px_s * rng.random_range(0.0..0.15),
        contrast: rng.random_range(0.4..1.0),
    }
}

fn lamp(rng: &mut Pcg64Mcg, deepest: f64) -> Lamp {
    Lamp {
        frequency_hz: if rng.random::<bool>() { 100.0 } else { 120.0 },
        depth: rng.random_range(0.05..deepest),
        harmonics: vec![rng.random_range(0.0..0.4), rng.random_range(0.0..0.2)],
        spot_px: rng.random_bool(0.7).then(|| {
            [
                rng.random_range(60.0..280.0),
                rng.random_range(50.0..210.0),
                rng.random_range(20.0..70.0),
            ]
        }),
    }
}

fn log_uniform(rng: &mut Pcg64Mcg, from: f64, to: f64) -> f64 {
    (rng.random_range(from.ln()..to.ln())).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_can_be_made_and_a_fifth_is_empty() {
        let empty = (0..2000).map(scene).filter(|s| s.rotors.is_empty()).count();
        assert!((340..460).contains(&empty), "{empty}");
        for trial in 0..2000 {
            let scene = scene(trial);
            assert!(scene.check().is_ok(), "{trial}: {:?}", scene.check());
            assert_eq!(scene, super::scene(trial));
            let passages = scene.rotors.iter().map(|r| r.rpm.abs() * f64::from(r.blades));
            assert!(passages.fold(0.0, f64::max) <= 150_000.1);
        }
    }
}

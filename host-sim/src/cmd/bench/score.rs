//! Readings against the truth.

use evtach_core::{Reading, RotorReading, Status};
use evtach_host::synth::{Motion, Scene};

/// Revolutions per minute per rad/s.
const RPM: f64 = 60.0 / std::f64::consts::TAU;

/// Relative error beyond which a speed is wrong.
const WRONG: f64 = 0.01;

/// Whether a speed with this relative error is wrong; in the wrong direction it always is.
pub fn is_wrong(error: f64) -> bool {
    error.is_nan() || error.abs() > WRONG
}

/// One measured rotor against its truth. Errors are relative and signed: estimate over truth, less one, so a speed of the
/// right size in the wrong direction has an error of -2.
#[derive(Clone, Debug, Default)]
pub struct Score {
    /// Initial alignment, relative to the camera.
    pub initial: Option<f64>,
    /// Refinement, relative to the camera.
    pub refined: Option<f64>,
    /// Further refinement, relative to the camera.
    pub further: Option<f64>,
    /// Long-baseline registration, relative to the camera.
    pub lock: Option<f64>,
    /// The reading's speed against the speed relative to the camera.
    pub camera: Option<f64>,
    /// The reading's speed against the speed relative to the room.
    pub room: Option<f64>,
    /// The reading's stated standard error, relative to the true speed.
    pub sigma: Option<f64>,
    /// Whether the rotor is locked, not merely coarse.
    pub locked: bool,
    /// Length of the window in seconds.
    pub window_s: f64,
    /// The blade count that was found.
    pub blades: Option<u8>,
    /// Name of the reason, where the rotor was found but refused.
    pub reason: Option<&'static str>,
}

/// A reading against the truth.
#[derive(Clone, Debug, Default)]
pub struct Scores {
    /// For each rotor of the scene what was measured; `None`: not found.
    pub rotors: Vec<Option<Score>>,
    /// Speeds that were given where no rotor is.
    pub ghosts: usize,
}

/// Scores one reading of a scene.
pub fn score(scene: &Scene, motion: &Motion, reading: &Reading) -> Scores {
    let ticks_per_s = 1e6 * (1.0 + motion.clock_error_ppm() * 1e-6);
    let window_s = f64::from(reading.window_us) / ticks_per_s;
    let middle_s = reading.t_us as f64 / ticks_per_s;
    let span = (middle_s - window_s / 2.0, middle_s + window_s / 2.0);
    let mut taken = vec![false; reading.rotors.len()];
    let rotors = (0..scene.rotors.len())
        .map(|number| {
            let i = nearest(scene, motion, number, middle_s, reading, &taken)?;
            taken[i] = true;
            rotor(motion, number, span, &reading.rotors[i])
        })
        .collect();
    let ghosts =
        reading.rotors.iter().zip(&taken).filter(|(r, taken)| r.speed.is_some() && !*taken);
    Scores { rotors, ghosts: ghosts.count() }
}

/// The free rotor of the reading that is nearest to a true one, at most three quarters of its radius away.
fn nearest(
    scene: &Scene,
    motion: &Motion,
    number: usize,
    middle_s: f64,
    reading: &Reading,
    taken: &[bool],
) -> Option<usize> {
    let rotor = &scene.rotors[number];
    let [x, y] = motion.centre(rotor, middle_s);
    let distance = |r: &RotorReading| (f64::from(r.x_px) - x).hypot(f64::from(r.y_px) - y);
    let free = reading.rotors.iter().enumerate().filter(|(i, _)| !taken[*i]);
    free.map(|(i, r)| (i, distance(r)))
        .filter(|(_, d)| *d <= (0.75 * rotor.radius_px).max(8.0))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

fn rotor(motion: &Motion, number: usize, span: (f64, f64), r: &RotorReading) -> Option<Score> {
    let camera_rpm = motion.rpm_camera(number, span.0, span.1)?;
    let room_rpm = motion.rpm_room(number, span.0, span.1)?;
    let off = |rad_s: f32, truth: f64| f64::from(rad_s) * RPM / truth - 1.0;
    let stage = |rad_s: Option<f32>| rad_s.map(|v| off(v, camera_rpm));
    let speed = r.speed.as_ref();
    let e = &r.evidence;
    Some(Score {
        initial: stage(e.initial_rad_s),
        refined: stage(e.refined_rad_s),
        further: stage(e.further_rad_s),
        lock: stage(e.lock_rad_s),
        camera: speed.map(|s| off(s.omega_rad_s, camera_rpm)),
        room: speed.map(|s| off(s.omega_rad_s, room_rpm)),
        sigma: speed.map(|s| (f64::from(s.omega_sigma_rad_s) * RPM / room_rpm).abs()),
        locked: r.status == Status::Locked,
        window_s: span.1 - span.0,
        blades: r.blades,
        reason: r.status.reason().map(evtach_core::Reason::as_str),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use evtach_core::{Evidence, Frame, Reason, Speed};

    use super::*;

    fn reading(rotors: &[RotorReading]) -> Reading {
        Reading {
            t_us: 75_000,
            window_us: 150_000,
            events: 1000,
            thinned: 0,
            lost: 0,
            status: Status::Locked,
            rotors: rotors.iter().cloned().collect(),
        }
    }

    fn at(x_px: f32, rpm: f64) -> RotorReading {
        RotorReading {
            id: 0,
            x_px,
            y_px: 130.0,
            radius_px: 50.0,
            blades: Some(3),
            status: Status::Locked,
            speed: Some(Speed {
                omega_rad_s: (rpm / RPM) as f32,
                omega_sigma_rad_s: 0.01,
                alpha_rad_s2: None,
                frame: Frame::Camera,
            }),
            evidence: Evidence::default(),
        }
    }

    #[test]
    fn errors_are_relative_to_the_window_s_truth() {
        let mut scene = Scene::default();
        scene.rotors[0].ramp_per_s = 1.0;
        scene.camera.roll_rad_s = 0.1;
        let motion = Motion::new(&scene);
        // The ramp adds 7.5 % in the middle of the window, the roll 0.955 rpm relative to the camera.
        let scores = score(&scene, &motion, &reading(&[at(173.0, 3225.0)]));
        let s = scores.rotors[0].as_ref().unwrap();
        assert!(s.room.unwrap().abs() < 1e-5, "{:?}", s.room);
        assert!((s.camera.unwrap() + 0.955 / 3225.0).abs() < 1e-5, "{:?}", s.camera);
        assert_eq!(scores.ghosts, 0);
    }

    #[test]
    fn the_wrong_direction_is_an_error_of_two() {
        let scene = Scene::default();
        let scores = score(&scene, &Motion::new(&scene), &reading(&[at(175.0, -3000.0)]));
        let error = scores.rotors[0].as_ref().unwrap().room.unwrap();
        assert!((error + 2.0).abs() < 1e-3);
        assert!(is_wrong(error) && is_wrong(0.0101) && is_wrong(f64::NAN));
        assert!(!is_wrong(-0.0099));
    }

    #[test]
    fn speeds_elsewhere_are_ghosts_and_refused_rotors_are_not() {
        let scene = Scene::default();
        let mut silent = at(300.0, 100.0);
        silent.speed = None;
        silent.status = Status::Refused(Reason::NoRotation);
        let found = reading(&[at(20.0, 500.0), silent, at(172.0, 3000.0)]);
        let scores = score(&scene, &Motion::new(&scene), &found);
        assert_eq!(scores.ghosts, 1);
        assert!(scores.rotors[0].is_some());
        let none = score(&scene, &Motion::new(&scene), &reading(&[at(20.0, 500.0)]));
        assert!(none.rotors[0].is_none());
    }
}

//! Where everything is at any time: the exact source of both the events and the truth.

use std::array;
use std::f64::consts::TAU;

use rand::Rng as _;

use super::random::{Purpose, normal, stream};
use super::scene::{Rotor, Scene};

/// Frequencies of the hand tremor in Hz.
const TREMOR_HZ: [f64; 4] = [1.3, 2.7, 8.5, 10.3];
/// Their amplitudes for a total rms of one: slow sway is three times the fast trembling.
const TREMOR_SHARE: [f64; 4] = [1.053, 0.823, 0.329, 0.329];

/// A sum of sines.
#[derive(Clone, Debug, Default)]
struct Sines(Vec<(f64, f64, f64)>);

impl Sines {
    fn at(&self, t_s: f64) -> f64 {
        self.0.iter().map(|&(a, w, p)| a * (w * t_s + p).sin()).sum()
    }

    fn rate(&self, t_s: f64) -> f64 {
        self.0.iter().map(|&(a, w, p)| a * w * (w * t_s + p).cos()).sum()
    }

    fn peak_rate(&self) -> f64 {
        self.0.iter().map(|&(a, w, _)| (a * w).abs()).sum()
    }

    fn tremor(rms: f64, rng: &mut rand_pcg::Pcg64Mcg) -> Self {
        let mut sines = Vec::new();
        for (hz, share) in TREMOR_HZ.iter().zip(TREMOR_SHARE) {
            // Drawn even when not needed: a still camera then sees the very same rotor as a moving one.
            let phase = rng.random_range(0.0..TAU);
            if rms != 0.0 {
                sines.push((rms * share, TAU * hz, phase));
            }
        }
        Self(sines)
    }
}

/// The room's position on the sensor at one time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pose {
    /// Shift of the image in pixels.
    pub shift: [f64; 2],
    /// Sine of the image's roll.
    pub sin: f64,
    /// Cosine of the image's roll.
    pub cos: f64,
    /// Shift of the rotors' mount in the room, in pixels.
    pub mount: [f64; 2],
}

/// Angle of one rotor over time.
#[derive(Clone, Debug)]
pub struct Spin {
    phase: f64,
    omega: f64,
    ramp: f64,
    hunting: f64,
    hunting_w: f64,
    hunting_phase: f64,
}

impl Spin {
    fn new(rotor: &Rotor, rng: &mut rand_pcg::Pcg64Mcg) -> Self {
        let drawn = rng.random_range(0.0..TAU);
        let hunting_phase = rng.random_range(0.0..TAU);
        Self {
            phase: rotor.phase_deg.map_or(drawn, f64::to_radians),
            omega: rotor.rpm * TAU / 60.0,
            ramp: rotor.ramp_per_s,
            hunting: rotor.hunting,
            hunting_w: rotor.hunting_hz * TAU,
            hunting_phase,
        }
    }

    /// Angle of the first blade in the room, in radians.
    #[must_use]
    pub fn angle(&self, t_s: f64) -> f64 {
        let mut turned = t_s + 0.5 * self.ramp * t_s * t_s;
        if self.hunting != 0.0 {
            let p = self.hunting_phase;
            turned += self.hunting / self.hunting_w * (p.cos() - (self.hunting_w * t_s + p).cos());
        }
        self.phase + self.omega * turned
    }

    /// Speed in the room in rad/s.
    #[must_use]
    pub fn rate(&self, t_s: f64) -> f64 {
        let hunting = self.hunting * (self.hunting_w * t_s + self.hunting_phase).sin();
        self.omega * (1.0 + self.ramp * t_s + hunting)
    }

    /// Upper bound of the magnitude of the speed over `from_s` to `to_s`, in rad/s.
    #[must_use]
    pub fn peak_rate(&self, from_s: f64, to_s: f64) -> f64 {
        let ramp = (self.ramp * from_s).abs().max((self.ramp * to_s).abs());
        self.omega.abs() * (1.0 + ramp + self.hunting.abs())
    }

    /// Lower bound of the magnitude of the speed over `from_s` to `to_s`, in rad/s; 0 where it might turn around.
    #[must_use]
    pub fn least_rate(&self, from_s: f64, to_s: f64) -> f64 {
        let ramp = (self.ramp * from_s).min(self.ramp * to_s);
        self.omega.abs() * (1.0 + ramp - self.hunting.abs()).max(0.0)
    }
}

/// All motion of a scene, with every random phase drawn.
#[derive(Clone, Debug)]
pub struct Motion {
    middle: [f64; 2],
    half_diagonal: f64,
    shift: [Sines; 2],
    drift: [f64; 2],
    roll: Sines,
    roll_drift: f64,
    mount: Sines,
    mount_direction: [f64; 2],
    spins: Vec<Spin>,
    clock_error_ppm: f64,
}

impl Motion {
    /// The motion of a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let mut rng = stream(scene.seed, Purpose::Motion, 0);
        let camera = &scene.camera;
        let shift =
            [Sines::tremor(camera.tremor_px, &mut rng), Sines::tremor(camera.tremor_px, &mut rng)];
        let roll = Sines::tremor(camera.tremor_mrad * 1e-3, &mut rng);
        let v = &scene.vibration;
        let drawn_hz = rng.random_range(35.0..60.0);
        let w = TAU * v.frequency_hz.unwrap_or(drawn_hz);
        let mut mount = vec![
            (v.amplitude_px, w, rng.random_range(0.0..TAU)),
            (v.second_px, 2.0 * w, rng.random_range(0.0..TAU)),
        ];
        mount.retain(|&(a, ..)| a != 0.0);
        let direction = rng.random_range(0.0..TAU);
        let clock = &scene.clock;
        let drawn_ppm = clock.sigma_ppm * normal(&mut stream(scene.seed, Purpose::Clock, 0));
        let spins = (0u64..)
            .zip(&scene.rotors)
            .map(|(i, rotor)| Spin::new(rotor, &mut stream(scene.seed, Purpose::Motion, 1 + i)))
            .collect();
        let (w, h) = (f64::from(scene.width_px), f64::from(scene.height_px));
        Self {
            middle: [(w - 1.0) / 2.0, (h - 1.0) / 2.0],
            half_diagonal: w.hypot(h) / 2.0,
            shift,
            drift: camera.drift_px_s,
            roll,
            roll_drift: camera.roll_rad_s,
            mount: Sines(mount),
            mount_direction: [direction.cos(), direction.sin()],
            spins,
            clock_error_ppm: clock.error_ppm.unwrap_or(drawn_ppm),
        }
    }

    /// Error of the sensor's clock in ppm, positive: fast.
    #[must_use]
    pub fn clock_error_ppm(&self) -> f64 {
        self.clock_error_ppm
    }

    /// The rotors' angles, in the order of the scene.
    #[must_use]
    pub fn spins(&self) -> &[Spin] {
        &self.spins
    }

    /// Roll of the image in radians, positive clockwise on the screen.
    #[must_use]
    pub fn roll(&self, t_s: f64) -> f64 {
        self.roll.at(t_s) + self.roll_drift * t_s
    }

    /// Roll rate of the image in rad/s.
    #[must_use]
    pub fn roll_rate(&self, t_s: f64) -> f64 {
        self.roll.rate(t_s) + self.roll_drift
    }

    /// Whether the camera moves.
    #[must_use]
    pub fn camera_moves(&self) -> bool {
        let sines = [&self.shift[0], &self.shift[1], &self.roll];
        sines.iter().any(|s| !s.0.is_empty()) || self.drift != [0.0; 2] || self.roll_drift != 0.0
    }

    /// Whether the rotors' mount moves in the room.
    #[must_use]
    pub fn mount_moves(&self) -> bool {
        !self.mount.0.is_empty()
    }

    /// Whether the rotors' centres move on the sensor.
    #[must_use]
    pub fn rotors_move(&self) -> bool {
        self.camera_moves() || self.mount_moves()
    }

    /// Upper bound of the speed of any point of the image because of the camera and the mount, in pixels per second.
    #[must_use]
    pub fn peak_image_speed(&self) -> f64 {
        let x = self.shift[0].peak_rate() + self.drift[0].abs();
        let y = self.shift[1].peak_rate() + self.drift[1].abs();
        let roll = (self.roll.peak_rate() + self.roll_drift.abs()) * self.half_diagonal;
        x.hypot(y) + roll + self.mount.peak_rate()
    }

    /// Speed of the fastest point of the image at one time because of camera and mount, in pixels per second.
    #[must_use]
    pub fn image_speed(&self, t_s: f64) -> f64 {
        let x = self.shift[0].rate(t_s) + self.drift[0];
        let y = self.shift[1].rate(t_s) + self.drift[1];
        let roll = self.roll_rate(t_s).abs() * self.half_diagonal;
        x.hypot(y) + roll + self.mount.rate(t_s).abs()
    }

    /// Pose of the room on the sensor.
    #[must_use]
    pub fn pose(&self, t_s: f64) -> Pose {
        let (sin, cos) = self.roll(t_s).sin_cos();
        let mount = self.mount.at(t_s);
        Pose {
            shift: [
                self.shift[0].at(t_s) + self.drift[0] * t_s,
                self.shift[1].at(t_s) + self.drift[1] * t_s,
            ],
            sin,
            cos,
            mount: [mount * self.mount_direction[0], mount * self.mount_direction[1]],
        }
    }

    /// Position in the room, in pixels, of what the pixel sees. The camera rolls about the sensor's middle.
    #[must_use]
    pub fn room(&self, pose: &Pose, x: f64, y: f64) -> [f64; 2] {
        let dx = x - self.middle[0] - pose.shift[0];
        let dy = y - self.middle[1] - pose.shift[1];
        [
            pose.cos * dx + pose.sin * dy + self.middle[0],
            pose.cos * dy - pose.sin * dx + self.middle[1],
        ]
    }

    /// Position on the sensor of a rotor's centre, in pixels.
    #[must_use]
    pub fn centre(&self, rotor: &Rotor, t_s: f64) -> [f64; 2] {
        let pose = self.pose(t_s);
        let dx = rotor.x_px + pose.mount[0] - self.middle[0];
        let dy = rotor.y_px + pose.mount[1] - self.middle[1];
        [
            pose.cos * dx - pose.sin * dy + self.middle[0] + pose.shift[0],
            pose.cos * dy + pose.sin * dx + self.middle[1] + pose.shift[1],
        ]
    }

    /// Mean speed of a rotor relative to the room over an interval of true time, in rpm with sign.
    #[must_use]
    pub fn rpm_room(&self, rotor: usize, from_s: f64, to_s: f64) -> Option<f64> {
        let spin = self.spins.get(rotor)?;
        Some((spin.angle(to_s) - spin.angle(from_s)) / (to_s - from_s) * 60.0 / TAU)
    }

    /// Mean speed of a rotor relative to the camera over an interval of true time, in rpm with sign.
    #[must_use]
    pub fn rpm_camera(&self, rotor: usize, from_s: f64, to_s: f64) -> Option<f64> {
        let roll = (self.roll(to_s) - self.roll(from_s)) / (to_s - from_s) * 60.0 / TAU;
        Some(self.rpm_room(rotor, from_s, to_s)? + roll)
    }
}

/// Poses at a fixed step with linear interpolation: the sines are too slow to evaluate per pixel and sample.
///
/// Every pixel walks through all of it, so it is kept short: what stays as it is stands there once.
#[derive(Debug)]
pub struct PoseTable {
    from_s: f64,
    last_step: usize,
    /// Shift, sine and cosine of [`Pose`].
    cameras: Vec<[f64; 4]>,
    mounts: Vec<[f64; 2]>,
    speeds: Vec<f64>,
}

impl PoseTable {
    /// Step in seconds; the second harmonic of the fastest vibration is then off by less than 1e-4 pixels.
    const STEP_S: f64 = 50e-6;
    /// Speeds are kept for every so many poses.
    const PER_SPEED: usize = 20;

    /// A table that covers `from_s` to `to_s`.
    #[must_use]
    pub fn new(motion: &Motion, from_s: f64, to_s: f64) -> Self {
        let steps = ((to_s - from_s) / Self::STEP_S).ceil() as usize + 2;
        let at = |i: usize| from_s + i as f64 * Self::STEP_S;
        let poses = |moves: bool| (0..if moves { steps } else { 1 }).map(|i| motion.pose(at(i)));
        let cameras = poses(motion.camera_moves());
        let mounts = poses(motion.mount_moves());
        let speeds = (0..steps.div_ceil(Self::PER_SPEED) + 1).map(|i| at(i * Self::PER_SPEED));
        Self {
            from_s,
            last_step: steps - 2,
            cameras: cameras.map(|p| [p.shift[0], p.shift[1], p.sin, p.cos]).collect(),
            mounts: mounts.map(|p| p.mount).collect(),
            speeds: speeds.map(|t_s| motion.image_speed(t_s)).collect(),
        }
    }

    /// The pose at a time.
    #[must_use]
    #[inline]
    pub fn at(&self, t_s: f64) -> Pose {
        let place = ((t_s - self.from_s) / Self::STEP_S).max(0.0);
        let step = (place as usize).min(self.last_step);
        let share = place - step as f64;
        let [x, y, sin, cos] = between(&self.cameras, step, share);
        Pose { shift: [x, y], sin, cos, mount: between(&self.mounts, step, share) }
    }

    /// Speed of the image around a time, in pixels per second; 0 when nothing moves.
    #[must_use]
    #[inline]
    pub fn speed(&self, t_s: f64) -> f64 {
        let i = ((t_s - self.from_s) / (Self::STEP_S * Self::PER_SPEED as f64)).max(0.0) as usize;
        let last = self.speeds.len() - 1;
        self.speeds[i.min(last)].max(self.speeds[(i + 1).min(last)])
    }
}

/// What lies between two entries of a table, or its only one.
#[inline]
fn between<const N: usize>(table: &[[f64; N]], step: usize, share: f64) -> [f64; N] {
    if let [only] = table {
        return *only;
    }
    let (a, b) = (&table[step], &table[step + 1]);
    array::from_fn(|k| a[k] + (b[k] - a[k]) * share)
}

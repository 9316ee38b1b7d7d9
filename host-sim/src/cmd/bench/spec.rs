//! What the tables are measured on, in one place.
//!
//! The standard scene is [`Scene::default`]: 346x260 pixels, one rotor of 50 px radius (a propeller at 40 cm), 40 us
//! jitter, thresholds spread by 10 %, 1 Hz/px noise, no events lost one by one, a clock whose error is drawn from 15 ppm.
//! From the hand: tremor of 3 px and 3 mrad rms at 1.3, 2.7, 8.5 and 10.3 Hz. Vibrating: 1 px at 35 to 60 Hz and 0.4 px at
//! twice that. Every seed moves the
//! centre, the speed (by up to 3 %, so that no window holds whole turns by luck) and the first blade, and takes turns with
//! direction and blade shape.
//!
//! Seeds below [`SCORED_FROM`] are for tuning: thresholds and gates may be chosen on them. Seeds from there on are scored,
//! and are not looked at to choose anything: the README names those that were all the same.

use evtach_host::synth::presets::{hand, shaken, wall};
use evtach_host::synth::scene::{Gyro, Shape};
use evtach_host::synth::{Model, Rotor, Scene};
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// The first scored seed.
pub const SCORED_FROM: u64 = 1000;

/// Speeds of the paper's evaluations, in rpm.
pub const SPEEDS_RPM: [f64; 5] = [300.0, 600.0, 1200.0, 3000.0, 6000.0];
/// Distances of the paper's evaluations, in cm.
pub const DISTANCES_CM: [f64; 5] = [30.0, 40.0, 50.0, 60.0, 70.0];
/// Blade counts of the paper's evaluations.
pub const BLADES: [u8; 3] = [2, 3, 4];
/// Radius in pixels of the standard rotor at one centimetre.
pub const RADIUS_PX_CM: f64 = 50.0 * 40.0;
/// Seeds a cell.
pub const SEEDS: u64 = 30;
/// The paper's window in milliseconds.
pub const PAPER_WINDOW_MS: f64 = 150.0;
/// Both event models, each with figures of its own.
pub const MODELS: [Model; 2] = [Model::Threshold, Model::Edge];

/// Both event models, or the one that was asked for.
pub fn models(only: Option<Model>) -> Vec<Model> {
    MODELS.into_iter().filter(|model| only.is_none_or(|only| only == *model)).collect()
}

/// The name of an event model in tables.
pub fn model_name(model: Model) -> &'static str {
    match model {
        Model::Threshold => "threshold",
        Model::Edge => "edge",
    }
}

/// The first seed of a run.
pub fn first_seed(tuning: bool) -> u64 {
    if tuning { 0 } else { SCORED_FROM }
}

/// How the camera is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Mount {
    /// On a tripod before a plain wall.
    Fixed,
    /// In the hand before a textured wall.
    Handheld,
    /// On a tripod, the rotor on a shaken table.
    Vibrating,
}

impl Mount {
    /// The name used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Handheld => "handheld",
            Self::Vibrating => "vibrating",
        }
    }
}

/// A cell of the accuracy tables.
#[derive(Clone, Copy, Debug)]
pub struct Condition {
    /// Nominal speed in rpm, without sign.
    pub rpm: f64,
    /// Blades.
    pub blades: u8,
    /// Radius in pixels.
    pub radius_px: f64,
    /// Camera.
    pub mount: Mount,
    /// Event model.
    pub model: Model,
}

/// Length in seconds of the window that a speed needs: 150 ms, three symmetry periods and two turns, 2 s at most.
pub fn window_s(rpm: f64, blades: u8) -> f64 {
    let turn_s = 60.0 / rpm.abs();
    (PAPER_WINDOW_MS * 1e-3).max(2.0 * turn_s).max(3.0 * turn_s / f64::from(blades)).min(2.0)
}

/// Length in milliseconds of a recording that holds the window even at the slow end of the seed's speeds.
pub fn duration_ms(rpm: f64, blades: u8) -> f64 {
    window_s(rpm * 0.97, blades) * 1e3 + 5.0
}

/// The scene of a cell and seed.
pub fn scene(condition: &Condition, seed: u64) -> Scene {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut scene = Scene {
        model: condition.model,
        seed,
        duration_ms: duration_ms(condition.rpm, condition.blades),
        ..Scene::default()
    };
    let sense = if seed.is_multiple_of(2) { 1.0 } else { -1.0 };
    scene.rotors = vec![Rotor {
        x_px: 173.0 + rng.random_range(-8.0..8.0),
        y_px: 130.0 + rng.random_range(-8.0..8.0),
        rpm: sense * condition.rpm * rng.random_range(0.97..1.03),
        blades: condition.blades,
        radius_px: condition.radius_px,
        shape: if (seed / 2).is_multiple_of(2) { Shape::Tapered } else { Shape::Swept },
        ..Rotor::default()
    }];
    match condition.mount {
        Mount::Fixed => {}
        Mount::Vibrating => scene.vibration = shaken(),
        Mount::Handheld => {
            scene.camera = hand();
            scene.camera.gyro = Some(gyro(&mut rng));
            scene.background = wall();
        }
    }
    scene
}

/// A drone: four two-blade rotors, unequal speeds and directions.
pub fn quad(model: Model, seed: u64) -> Scene {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut scene = Scene { model, seed, duration_ms: 155.0, ..Scene::default() };
    (scene.width_px, scene.height_px) = (640, 480);
    let places = [(200.0, 130.0), (440.0, 130.0), (440.0, 340.0), (200.0, 340.0)];
    scene.rotors = places
        .iter()
        .enumerate()
        .map(|(i, (x, y))| Rotor {
            x_px: x + rng.random_range(-6.0..6.0),
            y_px: y + rng.random_range(-6.0..6.0),
            rpm: if i.is_multiple_of(2) { 1.0 } else { -1.0 } * rng.random_range(3500.0..5500.0),
            blades: 2,
            radius_px: 44.0,
            ..Rotor::default()
        })
        .collect();
    scene
}

/// One standard deviation of the offset that such a gyro is taken to have, in rad/s.
pub const GYRO_SIGMA_RAD_S: f32 = 3e-3;

/// A gyro whose zero was taken at rest: a small offset remains.
pub fn gyro(rng: &mut Pcg64Mcg) -> Gyro {
    Gyro { offset_rad_s: rng.random_range(-1e-3..1e-3), ..Gyro::default() }
}

/// The least relative error of a speed from `events` events with a jitter of `jitter_us` over `window_s`: the standard
/// deviation of the slope of a line through phases (Cramer-Rao), 1 is 100 %.
pub fn bound(jitter_us: f64, window_s: f64, events: f64) -> f64 {
    12f64.sqrt() * jitter_us * 1e-6 / (window_s * events.max(1.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_that_of_a_line_fit() {
        // 10 000 events over 0.15 s with 50 us: 11.6 ppm, the value of the published table.
        assert!((bound(50.0, 0.15, 10_000.0) * 1e6 - 11.55).abs() < 0.05);
    }

    #[test]
    fn windows_hold_what_they_promise() {
        assert!((window_s(3000.0, 3) - 0.15).abs() < 1e-9);
        assert!((window_s(300.0, 3) - 0.4).abs() < 1e-9);
        assert!((window_s(-300.0, 1) - 0.6).abs() < 1e-9);
        assert!((window_s(60.0, 1) - 2.0).abs() < 1e-9);
    }
}

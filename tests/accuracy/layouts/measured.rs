//! A scene measured, and what is wrong with its readings.

use std::ops::RangeInclusive;

use evtach_core::{Direction, Geometry, Reading, Reason, RotorReading, Status};
use evtach_host::measure::Capacity;
use evtach_host::synth::{Rotor, Scene, Truth};
use evtach_tests::{Loaded, made, measure, show};

/// Largest relative error of a speed.
const LARGEST_ERROR: f64 = 0.01;
/// The same in standard errors, where they are asked for.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
/// What the last reading of a rotor may be off by: in standard errors one in two thousand may be farther.
const MOST_SIGMAS: f64 = 6.0;
/// Its centre, which a hand moves by as much.
const MOST_OFF_PX: f64 = 3.0;
/// Its radius over the true one: a small rotor's in a hand, of few events, is told too small.
const SIZES: RangeInclusive<f64> = 0.75..=1.15;

/// A scene's readings.
pub struct Measured {
    pub truth: Truth,
    pub readings: Vec<Reading>,
}

pub fn run(scene: &Scene, capacity: Capacity) -> Measured {
    let made = made(scene);
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let (readings, _) = measure(&Loaded { geometry, events: made.events.clone() }, capacity);
    Measured { truth: made.truth.clone(), readings }
}

/// Signed speed of a reading in rpm.
pub fn rpm(rotor: &RotorReading) -> Option<f64> {
    let speed = rotor.speed?;
    let sign = if speed.direction() == Direction::Cw { 1.0 } else { -1.0 };
    Some(sign * f64::from(speed.rpm()))
}

impl Measured {
    /// The last reading of a rotor of the scene that has a speed.
    pub fn of(&self, number: usize) -> Option<&RotorReading> {
        let truth = &self.truth.rotors[number];
        let near = |rotor: &&RotorReading| {
            let dx = f64::from(rotor.x_px) - truth.centre_px[0];
            let dy = f64::from(rotor.y_px) - truth.centre_px[1];
            dx.hypot(dy) < 0.5 * truth.radius_px
        };
        let last = |reading: &Reading| reading.rotors.iter().any(|r| near(&r) && r.speed.is_some());
        let reading = self.readings.iter().rev().find(|reading| last(reading))?;
        reading.rotors.iter().filter(near).find(|rotor| rotor.speed.is_some())
    }

    /// What is wrong with the speeds of all rotors; a rotor without one is wrong where `all` are owed.
    pub fn wrong_speeds(&self, name: &str, all: bool) -> Vec<String> {
        let mut wrong = Vec::new();
        for (number, truth) in self.truth.rotors.iter().enumerate() {
            let expected = truth.rpm_camera_mean_signed;
            match self.of(number).and_then(rpm) {
                Some(read) if (read / expected - 1.0).abs() <= LARGEST_ERROR => {}
                Some(read) => wrong.push(format!("{name}: {expected:+.1} rpm read as {read:+.1}")),
                None if all => wrong.push(format!("{name}: {expected:+.1} rpm: no speed")),
                None => {}
            }
        }
        let speeds = self.readings.iter().flat_map(|reading| &reading.rotors).filter_map(rpm);
        for read in speeds {
            let known = self.truth.rotors.iter().any(|truth| {
                (read / truth.rpm_camera_mean_signed - 1.0).abs() <= 5.0 * LARGEST_ERROR
            });
            if !known {
                wrong.push(format!("{name}: {read:+.1} rpm, which nothing turns at"));
            }
        }
        wrong
    }

    /// What is wrong with the rotors that are read, beside what 1 % of speed shows: standard error, blades, centre and radius.
    pub fn wrong_otherwise(&self, name: &str, scene: &Scene) -> Vec<String> {
        let mut wrong = Vec::new();
        for (number, (truth, made)) in self.truth.rotors.iter().zip(&scene.rotors).enumerate() {
            let Some((rotor, speed)) = self.of(number).and_then(|r| Some((r, r.speed?))) else {
                continue;
            };
            let off_rpm = rpm(rotor).unwrap_or_default() - truth.rpm_camera_mean_signed;
            let off_sigmas = off_rpm.abs() / f64::from(speed.rpm_sigma());
            let off_px = (f64::from(rotor.x_px) - truth.centre_px[0])
                .hypot(f64::from(rotor.y_px) - truth.centre_px[1]);
            let size = f64::from(rotor.radius_px) / truth.radius_px;
            let blades = rotor.blades;
            // Without polarity what may be edges as well as blades is left uncounted where a hand blurs it.
            let blurred = scene.sensor.all_on && scene.camera.tremor_px > 0.0;
            let uncounted = blurred && blades.is_none();
            if off_sigmas > MOST_SIGMAS
                || off_px > MOST_OFF_PX
                || !SIZES.contains(&size)
                || blades != Some(made.blades) && !uncounted
            {
                wrong.push(format!(
                    "{name}, rotor {number}: {off_sigmas:.1} sigma, {off_px:.1} px off, {size:.2} times the radius, {blades:?} blades"
                ));
            }
        }
        wrong
    }

    /// Speeds farther from that of the scene's one rotor than their own standard errors allow.
    pub fn beyond_sigma(&self, name: &str) -> Vec<String> {
        let expected = self.truth.rotors[0].rpm_camera_mean_signed;
        let rotors = self.readings.iter().flat_map(|reading| &reading.rotors);
        let off = |rotor: &RotorReading| {
            let (read, sigma) = (rpm(rotor)?, f64::from(rotor.speed?.rpm_sigma()));
            let far = (read - expected).abs() > LARGEST_ERROR_SIGMA * sigma;
            far.then(|| format!("{name}: {expected:+.3} rpm read as {read:+.3} +/- {sigma:.3}"))
        };
        rotors.filter_map(off).collect()
    }

    /// What is wrong where the first rotor is to be locked and the second, in the same reading, refused for one of these reasons.
    pub fn wrong_beside_refused(&self, name: &str, due: impl Fn(Reason) -> bool) -> Vec<String> {
        let mut wrong = self.wrong_speeds(name, false);
        if self.of(0).is_none_or(|rotor| rotor.status != Status::Locked) {
            wrong.push(format!("{name}: the first rotor is not locked"));
        }
        if let Some(rpm) = self.of(1).and_then(rpm) {
            wrong.push(format!("{name}: the second rotor is read as {rpm:+.1} rpm"));
        }
        let refused = |rotor: &RotorReading| {
            let [x_px, y_px] = self.truth.rotors[1].centre_px;
            let away_px = (f64::from(rotor.x_px) - x_px).hypot(f64::from(rotor.y_px) - y_px);
            away_px < 30.0 && rotor.status.reason().is_some_and(&due)
        };
        let both = |reading: &Reading| {
            reading.status == Status::Locked && reading.rotors.iter().any(refused)
        };
        if !self.readings.iter().any(both) {
            wrong.push(format!("{name}: no reading tells both: {:?}", self.readings));
        }
        wrong
    }
}

/// Every rotor with its right speed, within six standard errors, with its blades and where it stands, in both memories.
pub fn all_read(name: &str, scene: &Scene) {
    let wrong: Vec<String> = Capacity::ALL
        .into_iter()
        .flat_map(|capacity| {
            let name = format!("{name}, {} memory", capacity.as_str());
            let measured = run(scene, capacity);
            let mut wrong = measured.wrong_speeds(&name, true);
            wrong.extend(measured.wrong_otherwise(&name, scene));
            show(&format!("{name}: {} wrong", wrong.len()));
            wrong
        })
        .collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

pub fn at(x_px: f64, y_px: f64, radius_px: f64, rpm: f64) -> Rotor {
    Rotor { x_px, y_px, radius_px, rpm, ..Rotor::default() }
}

pub fn scene(seed: u64, rotors: Vec<Rotor>) -> Scene {
    Scene { seed, rotors, duration_ms: 210.0, ..Scene::default() }
}

pub fn wide(seed: u64, rotors: Vec<Rotor>) -> Scene {
    Scene { width_px: 640, height_px: 480, ..scene(seed, rotors) }
}

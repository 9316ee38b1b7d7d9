//! Readings one after another: each against the truth of its own window, how often they come, and by which letters.

use evtach_core::{Direction, Geometry, Reading, RotorReading};
use evtach_host::measure::Capacity;
use evtach_host::synth::{Motion, Rotor, Scene, generate};
use evtach_tests::{Loaded, measure, show};

/// Largest error of any reading in standard errors.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
/// Readings a second that a PC tells at least: it is asked for one every 50 ms.
const LEAST_READINGS_PER_S: f64 = 18.0;

/// One reading of one rotor of the scene.
struct Told {
    t_us: u64,
    letter: char,
    rpm: f64,
    sigma_rpm: f64,
    /// Mean speed over the very window.
    right_rpm: f64,
}

/// All readings of a scene, rotor by rotor, and what is wrong with them.
struct Series {
    name: String,
    rotors: Vec<Vec<Told>>,
    wrong: Vec<String>,
}

/// The rotor of the scene that stands where one was found.
fn number(scene: &Scene, found: &RotorReading) -> Option<usize> {
    scene.rotors.iter().position(|rotor| {
        let (dx, dy) = (f64::from(found.x_px) - rotor.x_px, f64::from(found.y_px) - rotor.y_px);
        dx.hypot(dy) < 0.5 * rotor.radius_px
    })
}

/// One found rotor beside the truth of its reading's window.
fn tell(motion: &Motion, number: usize, reading: &Reading, found: &RotorReading) -> Option<Told> {
    let speed = found.speed?;
    let sign = if speed.direction() == Direction::Cw { 1.0 } else { -1.0 };
    // Times of a reading are the sensor's, which is fast by its clock's error.
    let ticks_per_s = 1e6 + motion.clock_error_ppm();
    let middle_s = reading.t_us as f64 / ticks_per_s;
    let half_s = 0.5 * f64::from(reading.window_us) / ticks_per_s;
    Some(Told {
        t_us: reading.t_us,
        letter: char::from(b'A' + found.id),
        rpm: sign * f64::from(speed.rpm()),
        sigma_rpm: speed.rpm_sigma().into(),
        right_rpm: motion.rpm_room(number, middle_s - half_s, middle_s + half_s)?,
    })
}

fn series(name: &str, scene: &Scene, capacity: Capacity) -> Series {
    let made = generate(scene).expect("a scene in range");
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let (readings, _) = measure(&Loaded { geometry, events: made.events }, capacity);
    let motion = Motion::new(scene);
    let name = format!("{name}, {} memory", capacity.as_str());
    let mut rotors: Vec<Vec<Told>> = scene.rotors.iter().map(|_| Vec::new()).collect();
    let mut wrong = Vec::new();
    for reading in &readings {
        for found in reading.rotors.iter().filter(|rotor| rotor.speed.is_some()) {
            let number = number(scene, found);
            match number.and_then(|n| Some((n, tell(&motion, n, reading, found)?))) {
                Some((number, told)) => rotors[number].push(told),
                None => wrong.push(format!("{name}: a speed where nothing turns")),
            }
        }
    }
    // A pause would not show in the pace of what is left.
    for told in &rotors {
        if told.len() != readings.len() || told.is_empty() {
            wrong.push(format!("{name}: {} of {} readings", told.len(), readings.len()));
        }
    }
    Series { name, rotors, wrong }
}

impl Series {
    /// Adds what is wrong with speeds, letters and pace, and shows the worst of them.
    fn check(mut self, capacity: Capacity) -> Vec<String> {
        let (mut most_sigma, mut least_per_s) = (0.0_f64, f64::INFINITY);
        let mut letters = String::new();
        for rotor in &self.rotors {
            let (Some(first), Some(last)) = (rotor.first(), rotor.last()) else { continue };
            let lasts_s = last.t_us.saturating_sub(first.t_us).max(1) as f64 * 1e-6;
            least_per_s = least_per_s.min((rotor.len() - 1) as f64 / lasts_s);
            for told in rotor {
                let off_sigma = (told.rpm - told.right_rpm).abs() / told.sigma_rpm;
                most_sigma = most_sigma.max(off_sigma);
                if off_sigma.is_nan() || off_sigma > LARGEST_ERROR_SIGMA {
                    let Told { t_us, rpm, sigma_rpm, right_rpm, .. } = told;
                    self.wrong.push(format!(
                        "{} at {t_us} us: {right_rpm:+.3} rpm read as {rpm:+.3} +/- {sigma_rpm:.3}",
                        self.name
                    ));
                }
                if told.letter != first.letter {
                    self.wrong.push(format!(
                        "{} at {} us: {} has become {}",
                        self.name, told.t_us, first.letter, told.letter
                    ));
                }
            }
            if letters.contains(first.letter) {
                self.wrong.push(format!("{}: two rotors are {}", self.name, first.letter));
            }
            letters.push(first.letter);
        }
        // The device is slower, and its pace is counted in its image.
        if capacity == Capacity::Full && least_per_s < LEAST_READINGS_PER_S {
            self.wrong.push(format!("{}: {least_per_s:.1} readings a second", self.name));
        }
        show(&format!(
            "{:<32} {letters:<4} {least_per_s:5.1} readings a second, {most_sigma:.1} sigma off at most",
            self.name
        ));
        self.wrong
    }
}

fn every_reading(name: &str, scene: &Scene) {
    let wrong: Vec<String> = Capacity::ALL
        .into_iter()
        .flat_map(|capacity| series(name, scene, capacity).check(capacity))
        .collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

fn scene(seed: u64, rotors: Vec<Rotor>) -> Scene {
    Scene { seed, rotors, duration_ms: 800.0, ..Scene::default() }
}

#[test]
fn a_motor_that_speeds_up() {
    let rotor = Rotor { rpm: 1800.0, ramp_per_s: 0.05, ..Rotor::default() };
    every_reading("5 % a second", &scene(91, vec![rotor]));
}

/// A governor's waves: within a window the speed changes by more than a hundred times its sigma, and up to nearly one wave.
#[test]
fn a_motor_that_hunts() {
    let waves =
        [(92, 0.01, 2.0), (93, 0.01, 4.0), (94, 0.01, 6.0), (195, 0.02, 6.0), (95, 0.05, 4.0)];
    for (seed, hunting, hunting_hz) in waves {
        let rotor = Rotor { rpm: 3000.0, hunting, hunting_hz, ..Rotor::default() };
        let name = format!("{} % at {hunting_hz} Hz", 100.0 * hunting);
        every_reading(&name, &scene(seed, vec![rotor]));
    }
}

#[test]
fn four_keep_their_letters() {
    let places = [
        (200.0, 130.0, 3500.0),
        (440.0, 130.0, -4100.0),
        (200.0, 340.0, 4700.0),
        (440.0, 340.0, -5300.0),
    ];
    let four = places.map(|(x_px, y_px, rpm)| Rotor {
        x_px,
        y_px,
        rpm,
        blades: 2,
        radius_px: 44.0,
        ..Rotor::default()
    });
    let wide = Scene { width_px: 640, height_px: 480, ..scene(93, four.to_vec()) };
    every_reading("four rotors", &wide);
}

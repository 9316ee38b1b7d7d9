//! Readings one after another: each against the truth of its own window, how often they come, and by which letters.

use evtach_core::{Direction, Geometry, Reading, RotorReading};
use evtach_host::measure::Capacity;
use evtach_host::synth::presets::Preset;
use evtach_host::synth::{Motion, Rotor, Scene, generate};
use evtach_tests::{Loaded, made, measure, show};

/// Largest error of any reading in standard errors.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
/// Readings a second that a PC tells at least: it is asked for one every 50 ms.
const LEAST_READINGS_PER_S: f64 = 19.9;

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
    /// How many readings the tachometer gave, refused ones too.
    readings: usize,
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
    let events = made(scene).events.clone();
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let (readings, _) = measure(&Loaded { geometry, events }, capacity);
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
    Series { name, readings: readings.len(), rotors, wrong }
}

impl Series {
    /// How many speeds were told.
    fn told(&self) -> usize {
        self.rotors.iter().map(Vec::len).sum()
    }

    /// Adds what is wrong where a reading is missing, or they come too slowly.
    fn check_pace(&mut self, capacity: Capacity) {
        for rotor in &self.rotors {
            // A pause would not show in the pace of what is left.
            if rotor.len() != self.readings || rotor.is_empty() {
                self.wrong.push(format!(
                    "{}: {} of {} readings",
                    self.name,
                    rotor.len(),
                    self.readings
                ));
            }
            let (Some(first), Some(last)) = (rotor.first(), rotor.last()) else { continue };
            let lasts_s = last.t_us.saturating_sub(first.t_us).max(1) as f64 * 1e-6;
            let per_s = (rotor.len() - 1) as f64 / lasts_s;
            // The device is slower, and its pace is counted in its image.
            if capacity == Capacity::Full && per_s < LEAST_READINGS_PER_S {
                self.wrong.push(format!("{}: {per_s:.1} readings a second", self.name));
            }
        }
    }

    /// Adds what is wrong with speeds and letters, and shows the worst of them.
    fn check(mut self) -> Vec<String> {
        let mut most_sigma = 0.0_f64;
        let mut letters = String::new();
        for rotor in &self.rotors {
            let Some(first) = rotor.first() else { continue };
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
        let told = self.told();
        show(&format!(
            "{:<38} {letters:<4} {told:3} speeds in {:2} readings, {most_sigma:.1} sigma off at most",
            self.name, self.readings
        ));
        self.wrong
    }
}

/// Checks a scene with either memory: whether all of its readings come, if `pace` is asked, and that what comes is right.
fn check(name: &str, scene: &Scene, pace: bool) {
    let (mut wrong, mut told) = (Vec::new(), 0);
    for capacity in Capacity::ALL {
        let mut series = series(name, scene, capacity);
        if pace {
            series.check_pace(capacity);
        }
        told += series.told();
        wrong.extend(series.check());
    }
    assert!(told > 0, "{name}: no speed with either memory");
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

fn every_reading(name: &str, scene: &Scene) {
    check(name, scene, true);
}

fn scene(seed: u64, rotors: Vec<Rotor>) -> Scene {
    Scene { seed, rotors, duration_ms: 800.0, ..Scene::default() }
}

#[test]
fn a_motor_that_speeds_up() {
    let rotor = Rotor { rpm: 1800.0, ramp_per_s: 0.05, ..Rotor::default() };
    every_reading("5 % a second", &scene(91, vec![rotor]));
}

#[test]
fn an_acceleration_is_told_with_its_sign() {
    for (rpm, ramp_per_s) in [(1800.0, 0.05), (-3000.0, -0.06)] {
        let scene = scene(96, vec![Rotor { rpm, ramp_per_s, ..Rotor::default() }]);
        let made = generate(&scene).expect("a scene in range");
        let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
        let (readings, _) = measure(&Loaded { geometry, events: made.events }, Capacity::Full);
        let speeds = readings.iter().flat_map(|reading| &reading.rotors).filter_map(|r| r.speed);
        let told: Vec<f32> = speeds.filter_map(|speed| speed.accel_rpm_per_s()).collect();
        // Of the magnitude, whatever the direction.
        let right_rpm_per_s = (f64::abs(rpm) * ramp_per_s) as f32;
        let off = |told: &f32| (told / right_rpm_per_s - 1.0).abs();
        assert!(2 * told.len() > readings.len(), "{} of {}", told.len(), readings.len());
        assert!(told.iter().all(|told| off(told) < 0.1), "{right_rpm_per_s}: {told:?}");
    }
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

/// So strong ones that the path may stray, or not arrive at the window's ends: the speed may be refused, but not told wrong.
/// Seeds that were told wrong before, or that thresholds were tried with.
fn hunts_strongly(seeds: &[u64], rpm: f64, blades: u8, hunting: f64, hunting_hz: f64) {
    for &seed in seeds {
        let rotor = Rotor { rpm, blades, hunting, hunting_hz, ..Rotor::default() };
        let name = format!("{rpm} rpm, {} % at {hunting_hz} Hz, {seed}", 100.0 * hunting);
        check(&name, &scene(seed, vec![rotor]), false);
    }
}

// Tests of their own, as these take longest and are among the last to begin.
#[test]
fn a_motor_that_hunts_by_three_to_six_percent() {
    hunts_strongly(&[295], 300.0, 3, 0.05, 1.5);
    hunts_strongly(&[295], 300.0, 3, 0.03, 1.5);
    hunts_strongly(&[295], 2000.0, 2, 0.05, 5.0);
    hunts_strongly(&[600, 601], 900.0, 4, 0.06, 4.0);
}

#[test]
fn a_motor_that_hunts_by_ten_percent_at_4_hz() {
    hunts_strongly(&[95, 602, 605], 1200.0, 3, 0.1, 4.0);
}

#[test]
fn a_motor_that_hunts_by_ten_percent_at_6_hz() {
    hunts_strongly(&[195, 600, 605, 607], 1200.0, 3, 0.1, 6.0);
}

/// Windows grow once to see whether what moves beside a motor turns. One that speeds up is then not locked, which is no refusal: the
/// next short window tells, and from then on readings come as often as without.
#[test]
fn what_walks_beside_a_motor_that_speeds_up_does_not_stop_its_readings() {
    let rotor = Rotor { rpm: 1800.0, ramp_per_s: 0.05, x_px: 90.0, ..Rotor::default() };
    let movers = Preset::Walker.scene().movers;
    let scene = Scene { movers, duration_ms: 4_500.0, ..scene(97, vec![rotor]) };
    for capacity in Capacity::ALL {
        let series = series("beside a walker", &scene, capacity);
        let told = &series.rotors[0];
        assert_eq!(told.len(), series.readings, "no reading is refused");
        let late = told.iter().filter(|told| told.t_us > 3_500_000).count();
        show(&format!("{}: {} readings, {late} after 3.5 s", series.name, told.len()));
        // A second, less half a window.
        assert!(late >= if capacity == Capacity::Full { 17 } else { 8 }, "{late} readings");
        let wrong = series.check();
        assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
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

//! Rotors that stop, start, or change their speed at once: no reading tells the one speed as that of a window that holds both.

use evtach_core::{Event, Geometry, Speed};
use evtach_host::measure::Capacity;
use evtach_host::synth::{Rotor, Scene, generate};
use evtach_tests::{Loaded, measure, show};

/// Farthest that a speed may be off the mean of its window, relative.
const MOST_ERROR: f64 = 0.01;
/// Length of each part in seconds.
const PART_S: f64 = 0.4;

/// Events of some hundred milliseconds at each speed, one behind another.
fn events(speeds_rpm: &[f64], blades: u8) -> Vec<Event> {
    let mut events = Vec::new();
    for (part, &rpm) in speeds_rpm.iter().enumerate() {
        let rotor = Rotor { blades, rpm, radius_px: 40.0, ..Rotor::default() };
        // At rest it is as the background.
        let rotors = if rpm == 0.0 { Vec::new() } else { vec![rotor] };
        let duration_ms = 1e3 * PART_S;
        let scene = Scene { duration_ms, rotors, seed: 40 + part as u64, ..Scene::default() };
        let from_us = (part as f64 * 1e6 * PART_S) as u64;
        let later = |event: Event| Event { t_us: event.t_us + from_us, ..event };
        events.extend(generate(&scene).expect("a scene in range").events.into_iter().map(later));
    }
    events.sort_by_key(|event| event.t_us);
    events
}

/// Mean over a window of what turned so fast in each part.
fn mean_rpm(speeds_rpm: &[f64], from_s: f64, to_s: f64) -> f64 {
    let turned = |(part, rpm): (usize, &f64)| {
        let start_s = part as f64 * PART_S;
        rpm * (to_s.min(start_s + PART_S) - from_s.max(start_s)).max(0.0)
    };
    speeds_rpm.iter().enumerate().map(turned).sum::<f64>() / (to_s - from_s)
}

/// Speeds that are told, all of them right.
fn told(speeds_rpm: &[f64], blades: u8, capacity: Capacity) -> usize {
    let geometry = Geometry::new(346, 260).expect("a sensor in range");
    let loaded = Loaded { geometry, events: events(speeds_rpm, blades) };
    let (readings, _) = measure(&loaded, capacity);
    let mut speeds = 0;
    for reading in &readings {
        let (middle_s, half_s) =
            (reading.t_us as f64 * 1e-6, 0.5e-6 * f64::from(reading.window_us));
        let right_rpm = mean_rpm(speeds_rpm, middle_s - half_s, middle_s + half_s);
        for speed in reading.rotors.iter().filter_map(|rotor| rotor.speed) {
            let rpm = f64::from(speed.omega_rad_s) * f64::from(Speed::RPM_PER_RAD_S);
            speeds += 1;
            assert!(
                (rpm - right_rpm).abs() < MOST_ERROR * right_rpm.abs(),
                "{blades} blades at {speeds_rpm:?} rpm, {} memory: {rpm:.1} instead of {right_rpm:.1} rpm at {middle_s:.3} s",
                capacity.as_str()
            );
        }
    }
    show(&format!(
        "{blades} blades at {speeds_rpm:?} rpm, {} memory: {speeds} speeds in {} readings",
        capacity.as_str(),
        readings.len()
    ));
    speeds
}

/// Each speed is told in some window that holds nothing else, and none in those that hold more.
fn check(speeds_rpm: &[f64], blades: u8) {
    for capacity in Capacity::ALL {
        assert!(told(speeds_rpm, blades, capacity) > 0, "{speeds_rpm:?}: none told");
    }
}

#[test]
fn a_rotor_that_stops() {
    check(&[1900.0, 0.0], 4);
    check(&[700.0, 0.0], 2);
}

#[test]
fn a_rotor_that_starts() {
    // It is told once a window holds nothing else, which may take longer than this.
    for capacity in Capacity::ALL {
        told(&[0.0, 2500.0], 3, capacity);
    }
}

#[test]
fn a_rotor_that_changes_its_speed_at_once() {
    check(&[4095.0, 2047.0], 4);
}

#[test]
fn a_rotor_that_turns_round() {
    check(&[1243.0, -1243.0], 3);
}

#[test]
fn a_rotor_that_rests_again_and_again() {
    check(&[1200.0, 0.0, 1200.0, 0.0], 3);
}

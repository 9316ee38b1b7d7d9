//! Recordings that are no single stretch: pauses, turns round, streams behind each other.

use evtach_core::{Event, Polarity};
use evtach_host::synth::{Rotor, Scene, generate};
use serde_json::Value;

use super::{SIDES_PX, evtach, folder, measure, rotor, write};

/// A rotor at a speed, so many milliseconds long.
fn turning(rpm: f64, duration_ms: f64) -> Vec<Event> {
    let rotor = Rotor { x_px: 100.0, y_px: 80.0, rpm, ..Rotor::default() };
    let (width_px, height_px) = SIDES_PX;
    let scene = Scene { width_px, height_px, duration_ms, rotors: vec![rotor], ..Scene::default() };
    generate(&scene).expect("a scene in range").events
}

/// The rows of rotors in a table.
fn rows(stdout: &str) -> Vec<&str> {
    stdout.lines().filter(|line| line.contains(" rpm ")).collect()
}

/// What comes before a long pause is measured as at the end of a recording.
#[test]
fn a_pause_leaves_what_came_before_it() {
    let folder = folder();
    // Too short for a window.
    let short: Vec<Event> = rotor().into_iter().filter(|event| event.t_us < 140_000).collect();
    let later = |x| Event { t_us: 3_140_000, x, y: 5, polarity: Polarity::On };
    let beside =
        |i: u64| Event { t_us: 140_000 + 50_000 * i, x: 190, y: 5, polarity: Polarity::On };
    let region = &["--roi", "0,0,180,160"][..];
    for (options, behind) in [
        (&[][..], vec![later(5)]),
        // Where the rotor stands alone in a region, it pauses however much goes on beside it.
        (region, (0..60).map(beside).chain([later(50)]).collect()),
    ] {
        let told = |name, events: &[Event]| {
            let path = write(&folder, name, events).display().to_string();
            let run = evtach(&[&["measure", &path], options].concat(), b"");
            assert_eq!(run.code, Some(0), "{options:?}: {}", run.stderr);
            run.stdout
        };
        let (alone, paused) =
            (told("alone.raw", &short), told("paused.raw", &[short.clone(), behind].concat()));
        assert_eq!(rows(&paused).len(), 1, "{paused}");
        assert!(rows(&paused)[0].starts_with(rows(&alone)[0]), "{paused}{alone}");
    }
}

/// A rotor of another recording is another rotor, even where it stands at the same place.
#[test]
fn recordings_behind_each_other_have_rotors_of_their_own() {
    let folder = folder();
    let one = |name, rpm| write(&folder, name, &turning(rpm, 150.0));
    let bytes = |path| std::fs::read(path).expect("the file just written");
    let first = bytes(one("first.raw", 1500.0));
    for (rpm, way) in [(-1500.0, "ccw"), (3000.0, "cw")] {
        let path = folder.path().join("both.raw");
        std::fs::write(&path, [first.clone(), bytes(one("next.raw", rpm))].concat())
            .expect("room on the disk");
        let run = measure(&path);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let rows = rows(&run.stdout);
        let told = rows.iter().map(|row| row.split_whitespace().collect::<Vec<_>>());
        let told: Vec<_> =
            told.map(|words| (words[0], words[1].parse::<f64>(), words[5])).collect();
        let [(a, Ok(first_rpm), "cw"), (b, Ok(next_rpm), next_way)] = &told[..] else {
            panic!("no two rotors: {}", run.stdout)
        };
        assert_eq!((*a, *b, *next_way), ("A", "B", way));
        assert!((first_rpm / 1500.0 - 1.0).abs() < 2e-3, "{}", run.stdout);
        assert!((next_rpm / f64::abs(rpm) - 1.0).abs() < 2e-3, "{}", run.stdout);
        assert!(
            rows.iter().all(|row| row.contains(" from ") && !row.contains("rpm/s")),
            "{rows:?}"
        );
    }
}

/// What comes behind a wrong time is measured at its own, and the wrong one is told.
#[test]
fn a_wrong_time_is_no_time_of_what_follows() {
    let folder = folder();
    let mut events = turning(2400.0, 400.0);
    let at = events.len() / 3;
    for (ahead_us, options) in [
        (10_000_000_000, &[][..]),
        (10_000_000_000, &["--capacity", "device"]),
        (1_500_000, &[]),
        (1_500_000, &["--capacity", "device"]),
    ] {
        let right_us = events[at].t_us;
        events[at].t_us += ahead_us;
        let path = write(&folder, "wrong.npy", &events).display().to_string();
        events[at].t_us = right_us;
        let command = ["measure", "--geometry", "200x160", "--json", &path];
        let run = evtach(&[&command, options].concat(), b"");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(run.stderr.contains("1 events have a wrong time"), "{}", run.stderr);
        assert!(!run.stderr.contains("set back"), "{}", run.stderr);
        let document: Value = serde_json::from_str(&run.stdout).expect("a document");
        let number = |value: &Value| value.as_f64().expect("a number");
        assert!((number(&document["duration_s"]) - 0.4).abs() < 1e-3, "{document}");
        let readings = document["readings"].as_array().expect("a list");
        let times: Vec<f64> = readings.iter().map(|reading| number(&reading["t_s"])).collect();
        assert!(times.len() >= 2 && times.is_sorted() && times[times.len() - 1] < 0.4, "{times:?}");
        assert!((number(&document["rotors"][0]["rpm"]) / 2400.0 - 1.0).abs() < 1e-3, "{document}");
    }
}

/// As of a recording alone: behind it another was to begin, and has no events.
#[test]
fn a_recording_before_one_without_events_keeps_its_last_window() {
    let folder = folder();
    // Measured at its end only.
    let short: Vec<Event> = rotor().into_iter().filter(|event| event.t_us < 140_000).collect();
    let bytes = |path| std::fs::read(path).expect("the file just written");
    let alone = bytes(write(&folder, "alone.raw", &short));
    let path = folder.path().join("both.raw");
    std::fs::write(&path, [alone, bytes(write(&folder, "none.raw", &[]))].concat())
        .expect("room on the disk");
    let out = folder.path().join("out.png").display().to_string();
    let run = evtach(&["screen", &path.display().to_string(), &out], b"");
    assert!(run.stderr.contains("another recording begins at byte"), "{}", run.stderr);
    assert!(run.stdout.contains("LOCKED"), "{}", run.stdout);
}

/// What no reading is of is told, and so is a region that holds little.
#[test]
fn events_in_no_window_are_told() {
    let folder = folder();
    // The rotor is locked before the pause, and what is left of it is no window.
    let first = turning(2400.0, 200.0);
    let later: Vec<Event> =
        first.iter().map(|event| Event { t_us: event.t_us + 5_000_000, ..*event }).collect();
    let path = write(&folder, "twice.raw", &[first, later].concat()).display().to_string();
    for capacity in ["full", "device"] {
        let run = evtach(&["measure", "--capacity", capacity, &path], b"");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(run.stderr.contains(" events are in no window: "), "{capacity}: {}", run.stderr);
    }
    let path = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let run = evtach(&["measure", &path], b"");
    assert!(!run.stderr.contains("in no window"), "{}", run.stderr);
    let inside = rotor().iter().filter(|event| event.x < 4).count();
    let told = format!("{} of {} events lie outside --roi", rotor().len() - inside, rotor().len());
    for (roi, code, is_told) in [("0,0,4,160", 1, true), ("0,0,199,160", 0, false)] {
        let run = evtach(&["measure", "--roi", roi, &path], b"");
        assert_eq!(run.code, Some(code), "{}", run.stderr);
        assert_eq!(run.stderr.contains(&told), is_told, "{told}: {}", run.stderr);
        assert_eq!(run.stderr.contains("--roi"), is_told, "{}", run.stderr);
    }
}

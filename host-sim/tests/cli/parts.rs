//! Recordings that are no single stretch: pauses, turns round, streams behind each other.

use evtach_core::{Event, Polarity};
use evtach_host::synth::{Rotor, Scene, generate};

use super::{SIDES_PX, evtach, folder, measure, rotor, write};

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
    let one = |name, rpm| {
        let rotor = Rotor { x_px: 100.0, y_px: 80.0, rpm, ..Rotor::default() };
        let (width_px, height_px) = SIDES_PX;
        let scene = Scene { width_px, height_px, rotors: vec![rotor], ..Scene::default() };
        write(&folder, name, &generate(&scene).expect("a scene in range").events)
    };
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

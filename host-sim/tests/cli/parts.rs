//! Recordings that are no single stretch: pauses, turns round, streams behind each other.

use evtach_core::{Event, Polarity};

use super::{evtach, folder, rotor, write};

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

//! `evtach screen` and `evtach watch`, as far as they go without a terminal.

use std::path::Path;
use std::process::Command;

use evtach_host::frame::Frame;
use tempfile::TempDir;

use super::{assert_refused_as_bad, evtach};

fn demo() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../demo/fan.raw").display().to_string()
}

/// Draws the demo's screen, and says what was printed.
fn screen(folder: &TempDir, name: &str, options: &[&str]) -> (Frame, String) {
    let out = folder.path().join(name);
    let path = out.display().to_string();
    let demo = demo();
    let run = evtach(&[&["screen", &demo, &path], options].concat(), b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    (Frame::read_png(&out).expect("a picture of the screen"), run.stdout)
}

/// The locked speed among what was printed.
fn speed_in(said: &str) -> f64 {
    let shown = said.split("LOCKED ").nth(1).and_then(|rest| rest.split(' ').next());
    shown.and_then(|number| number.parse().ok()).expect("a speed")
}

#[test]
fn the_demos_screen_shows_its_speed_in_the_unit_asked_for() {
    let folder = TempDir::new().expect("a folder");
    let (rpm, said) = screen(&folder, "rpm.png", &[]);
    assert!((speed_in(&said) - 1180.0).abs() < 1.5, "{said}");
    let (again, _) = screen(&folder, "again.png", &[]);
    assert!(rpm == again);
    let (hertz, said) = screen(&folder, "hertz.png", &["--unit", "hz"]);
    assert!((speed_in(&said) - 1180.0 / 60.0).abs() < 0.025, "{said}");
    assert!(said.contains(" Hz"), "{said}");
    assert!(rpm != hertz);
}

/// A picture and a report go to stdout as to a file, and what is said of them to stderr.
#[test]
fn a_picture_and_a_report_may_go_to_a_pipe() {
    let folder = TempDir::new().expect("a folder");
    let demo = demo();
    let path = folder.path().join("out").display().to_string();
    let run = |args: [&str; 4]| {
        let output = Command::new(env!("CARGO_BIN_EXE_evtach")).args(args).output();
        output.expect("evtach starts")
    };
    for command in [["screen", &demo, "--mode=live"], ["plot", &demo, "--out"]] {
        let to = |place| run([command[0], command[1], command[2], place]);
        let (to_file, to_pipe) = (to(&path), to("-"));
        assert!(to_file.status.success() && to_pipe.status.success(), "{command:?}");
        assert!(to_pipe.stdout == std::fs::read(&path).expect("the file"), "{command:?}");
        let said = String::from_utf8(to_pipe.stderr).expect("text");
        assert!(said.lines().any(|line| line.starts_with('-')), "{said}");
    }
}

#[test]
fn before_the_first_window_there_is_no_speed() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("early.png").display().to_string();
    let run = evtach(&["screen", &demo(), &out, "--at", "0.05"], b"");
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    assert!(run.stdout.contains("SEARCHING"), "{}", run.stdout);
}

#[test]
fn a_pipe_is_told_what_serves_it_instead_of_watch() {
    assert_refused_as_bad(&evtach(&["watch", &demo()], b""), "evtach measure --json");
}

#[test]
fn a_moment_past_the_end_is_told() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("end.png").display().to_string();
    let run = |at: &str| evtach(&["screen", &demo(), &out, "--at", at], b"").stderr;
    let told = "ends 0.200 s after its first event";
    assert!(run("7").contains(told), "{}", run("7"));
    assert!(!run("0.19").contains("ends "), "{}", run("0.19"));
}

/// What a name ends in is what the file holds.
#[test]
fn pictures_are_not_written_under_names_of_others() {
    let demo = demo();
    assert_refused_as_bad(&evtach(&["screen", &demo, "out.jpg"], b""), "end its name in .png");
    let plot = evtach(&["plot", &demo, "--out", "out.png"], b"");
    assert_refused_as_bad(&plot, "end its name in .html or .svg");
}

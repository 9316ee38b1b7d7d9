//! The program as its users meet it: exit codes, streams, and the JSON contract.
#![allow(clippy::panic, reason = "a test fails by panicking")]

mod bad_input;
mod contract;
mod convert;
mod demo;
mod gyro;
mod parts;
mod screen;
mod usage;
mod watch;

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use evtach_core::{Event, Geometry, Polarity};
use evtach_host::recording::write::{WriteFormat, create};
use evtach_host::synth::{Rotor, Scene, generate};
use tempfile::TempDir;

/// What a run of `evtach` left behind.
struct Run {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

/// Runs the program; `stdin` is what is piped into it.
fn evtach(args: &[&str], stdin: &[u8]) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_evtach"))
        .args(args)
        .write_stdin(stdin)
        .output()
        .expect("evtach starts");
    let text = |bytes| String::from_utf8(bytes).expect("evtach writes UTF-8");
    Run { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Runs `evtach measure` on one file.
fn measure(path: &Path) -> Run {
    evtach(&["measure", &path.display().to_string()], b"")
}

/// Bad input: nothing on stdout, exit code 2, and the last line says what to do.
fn assert_refused_as_bad(run: &Run, tells: &str) {
    assert_eq!(run.code, Some(2), "{}{}", run.stdout, run.stderr);
    assert_eq!(run.stdout, "");
    assert!(run.stderr.contains(tells), "{tells:?} is not in: {}", run.stderr);
    let last = run.stderr.trim_end().lines().next_back().unwrap_or_default();
    let says_what_to_do = last.starts_with("help: ") || last.contains("; ");
    assert!(says_what_to_do, "the last line does not say what to do: {}", run.stderr);
    assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
}

/// Columns and rows of the recordings made here.
const SIDES_PX: (u16, u16) = (200, 160);

/// A rotor at 2400 rpm, clockwise, three blades.
fn rotor() -> Vec<Event> {
    let rotor = Rotor { x_px: 100.0, y_px: 80.0, rpm: 2400.0, ..Rotor::default() };
    let (width_px, height_px) = SIDES_PX;
    let scene = Scene { width_px, height_px, rotors: vec![rotor], seed: 70, ..Scene::default() };
    generate(&scene).expect("a scene in range").events
}

/// Nothing but noise.
fn noise() -> Vec<Event> {
    let (width_px, height_px) = SIDES_PX;
    let scene = Scene { width_px, height_px, rotors: Vec::new(), seed: 71, ..Scene::default() };
    generate(&scene).expect("a scene in range").events
}

/// Writes a recording into a folder.
fn write(folder: &TempDir, name: &str, events: &[Event]) -> PathBuf {
    let path = folder.path().join(name);
    let format = WriteFormat::from_path(&path).expect("an extension of a format");
    let geometry = Geometry::new(SIDES_PX.0, SIDES_PX.1).expect("a sensor in range");
    let mut writer = create(&path, format, geometry).expect("a file to write to");
    writer.write(events).expect("room on the disk");
    writer.finish().expect("room on the disk");
    path
}

/// A CSV of the events, under the given head lines.
fn csv(folder: &TempDir, name: &str, head: &str, events: &[Event]) -> PathBuf {
    let path = folder.path().join(name);
    let mut text = head.to_owned();
    for event in events {
        let on = u8::from(event.polarity == Polarity::On);
        text += &format!("{},{},{},{on}\n", event.t_us, event.x, event.y);
    }
    std::fs::write(&path, text).expect("room on the disk");
    path
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder for files of the test")
}

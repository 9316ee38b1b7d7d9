//! The camera's roll, from `evtach synth` by way of a file to the speed in the room.

use std::collections::VecDeque;

use evtach_core::{Event, Geometry, GyroSample, Polarity};
use evtach_host::recording::write::{self, WriteFormat};
use evtach_host::recording::{self, ImuSample, OpenOptions};
use evtach_host::synth::scene::{Camera, Gyro};
use evtach_host::synth::{Model, Rotor, Scene, generate};
use serde_json::Value;
use tempfile::TempDir;

use super::{Run, evtach, folder};

/// Makes the hand-held recording in a folder; where it is, its truth, and what was said.
fn handheld(folder: &TempDir, name: &str) -> (String, Value, Run) {
    let file = folder.path().join(name).display().to_string();
    let truth = folder.path().join("truth.json").display().to_string();
    // Both a tremor and a steady roll: the speeds relative to room and camera are 3 rpm apart.
    let scene = ["--preset", "handheld", "--roll", "0.3", "--duration-ms", "300", "--seed", "7"];
    let run = evtach(&[&["synth", &file, "--truth", &truth][..], &scene].concat(), b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let text = std::fs::read_to_string(truth).expect("the truth beside it");
    (file, serde_json::from_str(&text).expect("JSON"), run)
}

/// Speed with sign, its standard deviation, and its frame, of the one rotor.
fn speed(file: &str, options: &[&str]) -> (f64, f64, String) {
    let run = evtach(&[&["measure", "--json", file], options].concat(), b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let document: Value = serde_json::from_str(&run.stdout).expect("one JSON document");
    let rotor = &document["rotors"][0];
    let number = |name: &str| rotor[name].as_f64().expect("a number");
    let sign = if rotor["direction"] == "cw" { 1.0 } else { -1.0 };
    let frame = rotor["frame"].as_str().expect("a frame");
    (sign * number("rpm"), number("rpm_sigma"), frame.to_owned())
}

#[test]
fn the_gyro_in_a_recording_gives_the_speed_in_the_room() {
    let folder = folder();
    let (file, truth, said) = handheld(&folder, "hand.aedat4");
    assert!(!said.stderr.contains("no place"), "{}", said.stderr);
    let true_rpm = |name: &str| truth["rotors"][0][name].as_f64().expect("a speed");
    let converted = folder.path().join("again.aedat4").display().to_string();
    let run = evtach(&["convert", &file, &converted, "--rebase"], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);

    for file in [&file, &converted] {
        for capacity in ["full", "device"] {
            let asked = ["--gyro", "--gyro-sigma", "0.003", "--capacity", capacity];
            let (rpm, sigma, frame) = speed(file, &asked);
            let off = rpm - true_rpm("rpm_room_mean_signed");
            println!("{capacity}: {rpm:.3} ± {sigma:.3} rpm in the room, off by {off:+.3}");
            assert_eq!(frame, "room");
            assert!(off.abs() < 4.0 * sigma && sigma < 0.3, "off by {off:+.3} ± {sigma:.3} rpm");

            let (rpm, sigma, frame) = speed(file, &["--capacity", capacity]);
            let off = rpm - true_rpm("rpm_camera_mean_signed");
            println!("{capacity}: {rpm:.3} ± {sigma:.3} rpm by the camera, off by {off:+.3}");
            assert_eq!(frame, "camera");
            assert!(off.abs() < 4.0 * sigma, "off by {off:+.3} ± {sigma:.3} rpm");
        }
    }
}

/// As recorders write them, samples stand behind the events of their time.
#[test]
fn a_part_keeps_the_samples_that_stand_behind_its_events() {
    let folder = folder();
    let [whole, part] = ["whole.aedat4", "part.aedat4"].map(|name| folder.path().join(name));
    let geometry = Geometry::new(64, 48).expect("a sensor in range");
    let mut writer = write::create(&whole, WriteFormat::Aedat4, geometry).expect("a file");
    for ms in 0..300_u64 {
        let event = |us| Event { t_us: 1_000 * ms + us, x: 5, y: 7, polarity: Polarity::On };
        writer.write(&(0..1_000).map(event).collect::<Vec<_>>()).expect("events that fit");
        let behind = ms.checked_sub(30).map(|ms| GyroSample { t_us: 1_000 * ms, roll_rad_s: 0.1 });
        let samples: Vec<ImuSample> = behind.iter().map(ImuSample::rolling).collect();
        writer.write_imu(&samples).expect("samples that fit");
    }
    writer.finish().expect("room on the disk");
    let [from, to] = [&whole, &part].map(|path| path.display().to_string());
    let run = evtach(&["convert", &from, &to, "--end", "0.2"], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);

    let mut recording = recording::open(&part, &OpenOptions::default()).expect("what was written");
    let (mut events, mut samples) = (Vec::new(), Vec::new());
    while recording.read_chunk(&mut events).expect("no damage") {
        samples.append(&mut recording.take_imu());
    }
    samples.append(&mut recording.take_imu());
    assert_eq!((events.len(), samples.len()), (200_000, 200));
}

#[test]
fn a_report_takes_the_gyro_as_a_measurement_does() {
    let folder = folder();
    let (file, ..) = handheld(&folder, "hand.aedat4");
    let out = folder.path().join("report.html").display().to_string();
    for (options, frame) in [(&["--gyro", "--gyro-sigma", "0.003"][..], "room"), (&[], "camera")] {
        let run = evtach(&[&["plot", &file, "--out", &out], options].concat(), b"");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let page = std::fs::read_to_string(&out).expect("the report");
        assert!(page.contains(&format!("Rotor A: relative to the {frame};")), "{frame}");
        // The rotor's line of either command, word for word.
        let table = evtach(&[&["measure", &file], options].concat(), b"").stdout;
        let rotor = table.lines().nth(1).expect("a line for the rotor");
        assert!(rotor.contains(" rpm cw") && page.contains(rotor), "{rotor}");
        assert_eq!(rotor.contains(" rpm cw in the room "), frame == "room", "{rotor}");
    }
}

#[test]
fn a_recording_without_gyro_samples_says_so() {
    let folder = folder();
    let (file, _, said) = handheld(&folder, "hand.raw");
    assert!(said.stderr.contains("evt3 has no place for them"), "{}", said.stderr);
    let out = folder.path().join("report.html").display().to_string();
    for command in [&["measure", &file, "--gyro"][..], &["plot", &file, "--gyro", "--out", &out]] {
        let run = evtach(command, b"");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(run.stderr.contains("no gyro samples"), "{}", run.stderr);
    }
    let (file, ..) = handheld(&folder, "hand.aedat4");
    let run = evtach(&["convert", &file, &out, "--to", "evt3"], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("inertial samples left out"), "{}", run.stderr);
}

#[test]
fn a_gyro_that_takes_nothing_out_says_so() {
    let folder = folder();
    let (file, ..) = handheld(&folder, "hand.aedat4");
    let out = folder.path().join("report.html").display().to_string();
    let calibrated = ["--gyro", "--gyro-sigma", "0.003"];
    for command in [&["measure", &file][..], &["plot", &file, "--out", &out]] {
        // Of 0.3 s the offset is not known better than the hand rolls.
        for (options, is_told) in [(&["--gyro"][..], true), (&calibrated, false), (&[], false)] {
            let run = evtach(&[command, options].concat(), b"");
            assert_eq!(run.code, Some(0), "{}", run.stderr);
            let notes = run.stderr.lines().filter(|line| line.contains("--gyro takes nothing out"));
            assert_eq!(notes.count() == 1, is_told, "{options:?}: {}", run.stderr);
        }
    }
}

/// A recorder writes samples with the events of their time or behind them, also where the clock is set back meanwhile.
#[test]
fn a_gyro_behind_a_set_back_clock_is_waited_for_as_before_it() {
    let rotor = Rotor { radius_px: 20.0, ..Rotor::default() };
    let gyro = Some(Gyro::default());
    let shaken = Camera { tremor_px: 3.0, tremor_mrad: 3.0, ..Camera::default() };
    let scene = Scene {
        rotors: vec![rotor],
        camera: Camera { roll_rad_s: 0.3, gyro, ..shaken },
        model: Model::Edge,
        duration_ms: 100.0,
        seed: 7,
        ..Scene::default()
    };
    let hand = generate(&scene).expect("a scene in range");
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let folder = folder();
    let [with, behind] = [0, 30].map(|behind_ms| {
        let file = folder.path().join("set_back.aedat4");
        let mut writer = write::create(&file, WriteFormat::Aedat4, geometry).expect("a file");
        // Of each millisecond, by the clock that is set back and by one that goes on.
        let mut waiting = VecDeque::new();
        for (ms, is_ahead) in (0..200).map(|ms| (ms, ms < 100)) {
            let since_us = 1_000 * (ms % 100);
            let is_now = |t_us: u64| (since_us..since_us + 1_000).contains(&t_us);
            let clock_us = |t_us: u64| if is_ahead { t_us + 5_000_000 } else { t_us };
            let events = hand.events.iter().filter(|event| is_now(event.t_us));
            let event = |event: &Event| Event { t_us: clock_us(event.t_us), ..*event };
            writer.write(&events.map(event).collect::<Vec<_>>()).expect("events that fit");
            let samples = hand.gyro.iter().filter(|sample| is_now(sample.t_us));
            let sample =
                |sample: &GyroSample| GyroSample { t_us: clock_us(sample.t_us), ..*sample };
            waiting.push_back(samples.map(|s| ImuSample::rolling(&sample(s))).collect::<Vec<_>>());
            if waiting.len() > behind_ms {
                writer.write_imu(&waiting.pop_front().unwrap_or_default()).expect("samples");
            }
        }
        waiting.iter().for_each(|samples| writer.write_imu(samples).expect("samples"));
        writer.finish().expect("room on the disk");
        let file = file.display().to_string();
        let options = ["--gyro", "--gyro-sigma", "0.003", "--window-ms", "60"];
        let run = evtach(&[&["measure", "--json", &file], &options[..]].concat(), b"");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let document: Value = serde_json::from_str(&run.stdout).expect("one JSON document");
        // The first one behind the border.
        let readings = document["readings"].as_array().expect("a list");
        let later = readings.iter().find(|reading| reading["t_s"].as_f64() > Some(0.1));
        later.expect("a reading behind the border")["rotors"][0].clone()
    });
    assert_eq!(with["frame"], "room");
    assert_eq!(with, behind);
}

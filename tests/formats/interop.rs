//! Files of other software decode here to the same events, and files written here decode there.
//!
//! The peers come from PyPI into a virtual environment that `tests/interop/setup.sh` makes.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use evtach_core::{Event, Geometry};
use evtach_host::recording::ImuSample;
use evtach_host::recording::write::{self, WriteFormat};

use crate::scratch::{Scratch, event, read};

const SIZE: Geometry = Geometry { width_px: 320, height_px: 240 };

fn interop_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("interop")
}

/// Python with the peers, or `None` where it cannot be had.
fn python() -> Option<&'static str> {
    // Tests run side by side; the environment is made once.
    static PYTHON: OnceLock<Option<String>> = OnceLock::new();
    PYTHON.get_or_init(find_python).as_deref()
}

fn find_python() -> Option<String> {
    let output = Command::new("bash").arg(interop_folder().join("setup.sh")).output();
    match output {
        Ok(output) if output.status.success() => {
            Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
        }
        Ok(output) => {
            println!("skipped: no peers ({})", String::from_utf8_lossy(&output.stderr).trim());
            None
        }
        Err(error) => {
            println!("skipped: no shell ({error})");
            None
        }
    }
}

fn peers(python: &str, arguments: &[&str]) -> String {
    let output = Command::new(python)
        .arg(interop_folder().join("peers.py"))
        .args(arguments)
        .output()
        .expect("the virtual environment's Python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Events that cross the wraps of EVT 3 (16.8 s), share microseconds, and pause.
fn events() -> Vec<Event> {
    let mut t_us = 1_000_000;
    let mut mixed = 0x2545_f491_4f6c_dd1d_u64;
    (0..20_000_u32)
        .map(|index| {
            mixed ^= mixed << 13;
            mixed ^= mixed >> 7;
            mixed ^= mixed << 17;
            t_us += mixed % 40;
            if index % 5000 == 4999 {
                t_us += 15_000_000;
            }
            event(
                t_us,
                (mixed >> 20) as u16 % 320,
                (mixed >> 40) as u16 % 240,
                mixed >> 60 & 1 == 1,
            )
        })
        .collect()
}

fn write_ours(path: &Path, format: WriteFormat, events: &[Event]) {
    let mut writer = write::create(path, format, SIZE).expect("a file");
    writer.write(events).expect("events that fit");
    writer.finish().expect("room on the disk");
}

/// Writes AEDAT 4 with a thousand inertial samples a second for the first seconds, and gives these.
fn write_ours_with_imu(path: &Path, events: &[Event]) -> Vec<ImuSample> {
    let first_us = events.first().map_or(0, |event| event.t_us);
    let samples: Vec<ImuSample> = (0..3000_u16)
        .map(|index| ImuSample {
            t_us: first_us + u64::from(index) * 1000,
            gyro_rad_s: [0.01, -0.02, f32::from(index) * 1e-3],
            accel_m_s2: [0.1, -9.8, f32::from(index) * 1e-3],
        })
        .collect();
    let mut writer = write::create(path, WriteFormat::Aedat4, SIZE).expect("a file");
    for (samples, events) in samples.chunks(1000).zip(events.chunks(events.len().div_ceil(3))) {
        writer.write_imu(samples).expect("samples that fit");
        writer.write(events).expect("events that fit");
    }
    writer.finish().expect("room on the disk");
    samples
}

/// Recordings in a folder, those inside bag folders included.
fn recordings(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("the folder is readable").path();
        if path.is_dir() {
            found.extend(recordings(&path));
        } else if path.extension().is_some_and(|extension| extension != "yaml") {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn what_peers_write_is_read_here() {
    let Some(python) = python() else { return };
    let (scratch, events) = (Scratch::new(), events());
    let truth = scratch.file("events.npy");
    write_ours(&truth, WriteFormat::Npy, &events);
    let folder = scratch.file("peers");
    std::fs::create_dir(&folder).expect("the temporary folder is writable");
    let (truth, there) = (truth.display().to_string(), folder.display().to_string());
    peers(python, &["write", &truth, "320", "240", &there]);
    let files = recordings(&folder);
    assert!(files.len() >= 20, "{files:?}");
    for file in &files {
        let name = file.display();
        let found = read(file, None).map_err(|error| format!("{name}: {error}")).expect("readable");
        assert!(found.error.is_none(), "{name}: {:?}", found.error);
        assert!(
            found.events == events,
            "{name}: {} events, {:?}",
            found.events.len(),
            found.recording.assumed
        );
        // expelliarmus writes no size but the name of a camera.
        if !name.to_string().ends_with("expelliarmus.evt2.raw") {
            assert_eq!(found.recording.geometry, SIZE, "{name}");
        }
        println!("{}: {} events as written", name, found.events.len());
    }
}

#[test]
fn inertial_samples_of_dv_are_read_with_their_units() {
    let Some(python) = python() else { return };
    let (scratch, events) = (Scratch::new(), events());
    let truth = scratch.file("events.npy");
    write_ours(&truth, WriteFormat::Npy, &events);
    let (truth, there) = (truth.display().to_string(), scratch.path().display().to_string());
    peers(python, &["write", &truth, "320", "240", &there]);
    let mut found = read(&scratch.file("dv.lz4.aedat4"), None).expect("an AEDAT4 file");
    let samples = found.recording.take_imu();
    assert_eq!(samples.len(), 3);
    for (index, sample) in samples.iter().enumerate() {
        assert_eq!(sample.t_us, events[0].t_us + index as u64);
        let expected = [10.0, 20.0, 30.0 + index as f32].map(f32::to_radians);
        let error =
            sample.gyro_rad_s.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(error < 1e-6, "{sample:?}");
        assert!((sample.accel_m_s2[1] + 9.806_65).abs() < 1e-5, "{sample:?}");
        assert!((sample.roll().roll_rad_s + expected[2]).abs() < 1e-6, "{sample:?}");
    }
}

#[test]
fn what_is_written_here_is_read_by_peers() {
    let Some(python) = python() else { return };
    let (scratch, events) = (Scratch::new(), events());
    for (format, name) in [
        (WriteFormat::Evt2, "evt2.raw"),
        (WriteFormat::Evt3, "evt3.raw"),
        (WriteFormat::Dat, "dat"),
        (WriteFormat::Aedat4, "aedat4"),
        (WriteFormat::Csv, "csv"),
        (WriteFormat::Es, "es"),
        (WriteFormat::Npy, "npy"),
    ] {
        write_ours(&scratch.file(&format!("ours.{name}")), format, &events);
    }
    write_ours_with_imu(&scratch.file("ours.imu.aedat4"), &events);
    peers(python, &["read", &scratch.path().display().to_string()]);
    let mut read_back = 0;
    for file in recordings(scratch.path()) {
        let name = file.display().to_string();
        if name.ends_with(".read.npy") {
            let found = read(&file, Some(SIZE)).expect("an array by NumPy");
            assert!(found.events == events, "{name}: {} events", found.events.len());
            println!("{name}: {} events as written", found.events.len());
            read_back += 1;
        }
    }
    assert_eq!(read_back, 12);
}

#[test]
fn inertial_samples_written_here_are_read_by_dv_with_their_units() {
    let Some(python) = python() else { return };
    let scratch = Scratch::new();
    let file = scratch.file("ours.imu.aedat4");
    let samples = write_ours_with_imu(&file, &events());
    let printed = peers(python, &["imu", &file.display().to_string()]);
    let rows: Vec<Vec<f64>> = printed
        .lines()
        .map(|line| line.split(' ').map(|word| word.parse().expect("a number")).collect())
        .collect();
    assert_eq!(rows.len(), samples.len());
    for (row, sample) in rows.iter().zip(&samples) {
        let (t_us, there) = row.split_first().expect("a time and six numbers");
        assert_eq!(*t_us as u64, sample.t_us);
        let here = [sample.gyro_rad_s, sample.accel_m_s2].concat();
        assert_eq!(there.len(), here.len());
        for (there, here) in there.iter().zip(here) {
            // It takes gravity for 9.81007 m/s^2.
            let off = (there - f64::from(here)).abs();
            assert!(off <= 4e-4 * f64::from(here.abs()), "{row:?} for {sample:?}");
        }
    }
}

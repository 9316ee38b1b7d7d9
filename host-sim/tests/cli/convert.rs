//! `evtach convert` and `evtach info`.

use evtach_core::GyroSample;
use evtach_host::recording::ImuSample;

use super::*;

const SIDES: Geometry = Geometry { width_px: 200, height_px: 160 };

/// Events of a rotor with times that EVT 3 cannot hold as they are.
fn late() -> Vec<Event> {
    let base_us = 1_700_000_000_000_000;
    rotor().into_iter().map(|event| Event { t_us: event.t_us + base_us, ..event }).collect()
}

fn file(folder: &TempDir, name: &str, format: WriteFormat, events: &[Event]) -> String {
    let path = folder.path().join(name);
    let mut writer = create(&path, format, SIDES).expect("a file");
    writer.write(events).expect("events that fit");
    writer.finish().expect("room on the disk");
    path.display().to_string()
}

/// Events as CSV lines.
fn lines(events: impl IntoIterator<Item = Event>) -> String {
    let rows =
        events.into_iter().map(|e| format!("{},{},{},{}\n", e.t_us, e.x, e.y, e.polarity as u8));
    format!("t,x,y,p\n{}", rows.collect::<String>())
}

#[test]
fn through_every_format_and_back() {
    let folder = TempDir::new().expect("a temporary folder");
    let events = rotor();
    let mut from = file(&folder, "in.csv", WriteFormat::Csv, &events);
    for name in ["a.evt2.raw", "a.evt3.raw", "a.dat", "a.aedat4", "a.npy", "a.es"] {
        let to = folder.path().join(name).display().to_string();
        let run = evtach(&["convert", "--geometry", "200x160", &from, &to], b"");
        assert_eq!(run.code, Some(0), "{name}: {}", run.stderr);
        from = to;
    }
    let run = evtach(&["convert", &from, "-", "--to", "csv"], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout == lines(events), "{}", run.stderr);
}

#[test]
fn pipes_and_times_the_format_cannot_hold() {
    let folder = TempDir::new().expect("a temporary folder");
    let events = late();
    let from = file(&folder, "in.aedat4", WriteFormat::Aedat4, &events);
    let to = folder.path().join("out.raw").display().to_string();
    let run = evtach(&["convert", &from, &to], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("time begins at zero"), "{}", run.stderr);
    let bytes = std::fs::read(&to).expect("what was written");
    let run = evtach(&["convert", "-", "-", "--to", "csv"], &bytes);
    let first_us = events[0].t_us;
    let expected = events.iter().map(|event| Event { t_us: event.t_us - first_us, ..*event });
    assert!(run.stdout == lines(expected), "{}", run.stderr);
}

/// A pipe takes no position of the table afterwards: the table would be read as a packet.
#[test]
fn aedat4_through_a_pipe_is_whole() {
    let folder = TempDir::new().expect("a temporary folder");
    let events = rotor();
    let from = file(&folder, "in.raw", WriteFormat::Evt3, &events);
    // By its name, too, it is a pipe.
    let names: &[&str] = if cfg!(target_os = "linux") { &["-", "/dev/stdout"] } else { &["-"] };
    for name in names {
        let output = Command::new(env!("CARGO_BIN_EXE_evtach"))
            .args(["convert", &from, name, "--to", "aedat4"])
            .output()
            .expect("evtach starts");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{name}: {stderr}");
        let run = evtach(&["convert", "-", "-", "--to", "csv"], &output.stdout);
        assert_eq!(run.code, Some(0), "{name}: {}", run.stderr);
        assert!(run.stdout == lines(events.iter().copied()), "{name}: {}", run.stderr);
    }
}

#[test]
fn a_part_of_a_recording() {
    let folder = TempDir::new().expect("a temporary folder");
    let events = rotor();
    let from = file(&folder, "in.dat", WriteFormat::Dat, &events);
    let part = ["--roi", "90,70,20,30", "--start", "0.02", "--end", "0.05", "--decimate", "3"];
    let run = evtach(&[&["convert", &from, "-", "--to", "csv"][..], &part].concat(), b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let first_us = events[0].t_us;
    let inside = |event: &Event| {
        (90..110).contains(&event.x)
            && (70..100).contains(&event.y)
            && (20_000..=50_000).contains(&(event.t_us - first_us))
    };
    let expected: Vec<Event> =
        events.iter().filter(|event| inside(event)).step_by(3).copied().collect();
    assert!(expected.len() > 20);
    assert!(run.stdout == lines(expected), "{}", run.stderr);
}

/// Behind a break of the clock `convert`, `measure` and `screen` count on from the first event.
#[test]
fn a_part_behind_a_clock_that_is_set_back() {
    let folder = TempDir::new().expect("a temporary folder");
    let events = rotor();
    let ahead = events.iter().map(|event| Event { t_us: event.t_us + 5_000_000, ..*event });
    let set_back: Vec<Event> = ahead.chain(events.iter().copied()).collect();
    let csv = file(&folder, "set_back.csv", WriteFormat::Csv, &set_back);
    // By less than a clock is set back by, but as another recording.
    let one = std::fs::read(file(&folder, "one.raw", WriteFormat::Evt3, &events));
    let one = one.expect("what was written");
    let two = folder.path().join("two.raw").display().to_string();
    std::fs::write(&two, [one.as_slice(), &one].concat()).expect("room on the disk");
    let (first_us, last_us) = (events[0].t_us, events[events.len() - 1].t_us);
    let seconds = |us: u64| format!("{:.6}", (last_us - first_us + us) as f64 * 1e-6);
    let (start, end) = (seconds(20_000), seconds(90_000));
    let inside = |event: &&Event| (20_000..90_000).contains(&(event.t_us - first_us));
    let part: Vec<Event> = events.iter().filter(inside).copied().collect();
    for from in [&csv, &two] {
        let of_part = ["--geometry", "200x160", "--start", &start, "--end", &end];
        let convert = ["convert", from, "-", "--to", "csv"];
        let run = evtach(&[&convert[..], &of_part].concat(), b"");
        assert!(run.stdout == lines(part.iter().copied()), "{from}: {}", run.stderr);
        let run = evtach(&[&convert[..], &of_part, &["--rebase"]].concat(), b"");
        let began_us = first_us + 20_000;
        let rebased = part.iter().map(|event| Event { t_us: event.t_us - began_us, ..*event });
        assert!(run.stdout == lines(rebased), "{from}: {}", run.stderr);
        let run = evtach(&[&["measure", "--json", from][..], &of_part].concat(), b"");
        assert!(run.stdout.contains(&format!("\"events\":{},", part.len())), "{}", run.stdout);
        let out = folder.path().join("at.png").display().to_string();
        let run = evtach(&["screen", "--geometry", "200x160", "--at", &end, from, &out], b"");
        assert!(run.code != Some(2) && !run.stderr.contains("before --at"), "{}", run.stderr);
        let run = evtach(&[&convert[..], &["--geometry", "200x160", "--start", "9"]].concat(), b"");
        assert!(run.stderr.contains("no events from --start on; widen"), "{}", run.stderr);
    }
}

#[test]
fn a_wrong_time_among_right_ones_loses_nothing_unsaid() {
    let folder = TempDir::new().expect("a temporary folder");
    let mut events = rotor();
    let right = events.len();
    let hours_us = 10_000_000_000;
    events[right / 10].t_us += hours_us;
    let from = file(&folder, "in.csv", WriteFormat::Csv, &events);
    let run = evtach(&["convert", &from, "-", "--to", "csv", "--end", "60"], b"");
    assert_eq!(run.stdout.lines().count(), right, "{}", run.stderr);
    // A part behind it is that of either command.
    let part = ["--start", "0.05", "--end", "0.12"];
    let kept = evtach(&[&["convert", &from, "-", "--to", "csv"], &part[..]].concat(), b"");
    let measured = evtach(&[&["measure", "--json", &from], &part[..]].concat(), b"");
    assert_eq!(measured.code, Some(0), "{}", measured.stderr);
    let told = format!("\"events\":{},", kept.stdout.lines().count() - 1);
    assert!(measured.stdout.contains(&told), "{told}: {}", measured.stdout);
    // As the first one it would be where time begins.
    events.swap(0, right / 10);
    let from = file(&folder, "late.csv", WriteFormat::Csv, &events);
    let run = evtach(&["convert", &from, "-", "--to", "csv", "--rebase"], b"");
    let told = format!("{} events left out: their time lies before", right - 1);
    assert!(run.stdout.lines().count() == 2 && run.stderr.contains(&told), "{}", run.stderr);
}

#[test]
fn damage_behind_what_is_kept_is_no_error() {
    let events = rotor();
    let text = format!("{}oops\n1,2\n", lines(events.iter().copied()));
    let run = ["convert", "-", "-", "--to", "csv", "--geometry", "200x160"];
    assert_eq!(evtach(&run, text.as_bytes()).code, Some(2));
    let part = evtach(&[&run[..], &["--end", "0.02"]].concat(), text.as_bytes());
    assert_eq!(part.code, Some(0), "{}", part.stderr);
}

#[test]
fn bad_use_is_told() {
    let folder = TempDir::new().expect("a temporary folder");
    let from = file(&folder, "in.csv", WriteFormat::Csv, &rotor());
    let other = folder.path().join("out.xyz").display().to_string();
    assert_refused_as_bad(&evtach(&["convert", &from, &from], b""), "the same file");
    let linked = folder.path().join("linked.csv").display().to_string();
    std::fs::hard_link(&from, &linked).expect("a folder that takes links");
    let before = std::fs::read(&from).expect("the recording");
    assert_refused_as_bad(&evtach(&["convert", &from, &linked], b""), "the same file");
    assert_refused_as_bad(&evtach(&["plot", &from, "--out", &linked], b""), "the same file");
    assert_refused_as_bad(&evtach(&["screen", &from, &from], b""), "the same file");
    assert!(std::fs::read(&from).expect("the recording") == before, "the recording is as it was");
    assert_refused_as_bad(&evtach(&["convert", &from, &other], b""), "--to");
    assert_refused_as_bad(&evtach(&["convert", &from, "-", "--to", "npy"], b""), "unknown length");
}

#[test]
fn info_tells_what_a_recording_holds() {
    let folder = TempDir::new().expect("a temporary folder");
    let events = rotor();
    let from = file(&folder, "in.evt3.raw", WriteFormat::Evt3, &events);
    let run = evtach(&["info", &from], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let count = format!("events          {} (100.0 %)", events.len());
    for told in [
        "format          EVT3",
        "sensor          200x160",
        &count,
        "out of order    0",
        "gaps ",
        "periodic ",
    ] {
        assert!(run.stdout.contains(told), "{told:?} is not in: {}", run.stdout);
    }
}

#[test]
fn words_of_unknown_type_are_told() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = file(&folder, "in.evt3.raw", WriteFormat::Evt3, &rotor());
    for count in [0, 3] {
        let run = evtach(&["info", &path], b"");
        assert!(run.stdout.contains(&format!("unknown words   {count}\n")), "{}", run.stdout);
        let run = evtach(&["measure", &path], b"");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let told = format!("{count} words of unknown type");
        assert_eq!(run.stderr.contains(&told), count > 0, "{}", run.stderr);
        // Words of a type that EVT 3 does not define.
        let mut bytes = std::fs::read(&path).expect("the file just written");
        bytes.extend([0x00, 0x10, 0x00, 0xb0, 0x00, 0xc0]);
        std::fs::write(&path, bytes).expect("room on the disk");
    }
}

/// By the camera's clock the first part would lie behind the second, what is between them would be a gap of seconds, and a gyro would
/// seem twice as fast.
#[test]
fn info_lays_the_parts_of_a_clock_that_is_set_back_end_to_end() {
    let folder = TempDir::new().expect("a temporary folder");
    let events = rotor();
    let path = folder.path().join("set_back.aedat4");
    let mut writer = create(&path, WriteFormat::Aedat4, SIDES).expect("a file");
    for ahead_us in [5_000_000, 0] {
        let ahead = events.iter().map(|event| Event { t_us: event.t_us + ahead_us, ..*event });
        writer.write(&ahead.collect::<Vec<_>>()).expect("events that fit");
        let sample = |ms: u64| GyroSample { t_us: 1_000 * ms + ahead_us, roll_rad_s: 0.1 };
        let samples: Vec<_> = (0..150).map(|ms| ImuSample::rolling(&sample(ms))).collect();
        writer.write_imu(&samples).expect("samples that fit");
    }
    writer.finish().expect("room on the disk");
    let run = evtach(&["info", &path.display().to_string()], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let (first_us, last_us) = (events[0].t_us, events[events.len() - 1].t_us);
    let from_s = (first_us + 5_000_000) as f64 * 1e-6;
    let to_s = from_s + 2.0 * (last_us - first_us) as f64 * 1e-6;
    let span = format!("({from_s:.6} s to {to_s:.6} s)");
    let note = format!("note            behind event {} the clock is set back by", events.len());
    // 300 samples in twice 149 ms.
    for told in [&span, "gaps            none", "300 samples, 1007 a second", &note] {
        assert!(run.stdout.contains(told), "{told:?} is not in: {}", run.stdout);
    }
}

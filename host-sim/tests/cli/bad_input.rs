//! Bad input ends in a clear error or in a correct reading.

use evtach_core::{Event, Polarity};

use super::{assert_refused_as_bad, csv, evtach, folder, measure, noise, rotor, write};

/// Head of a CSV that tells its size.
const HEAD: &str = "%geometry:200,160\nt,x,y,p\n";

/// The table shows the rotor of these tests.
fn assert_reads_the_rotor(stdout: &str) {
    let row = stdout.lines().find(|line| line.trim_start().starts_with("A "));
    let row = row.unwrap_or_else(|| panic!("no rotor in: {stdout}"));
    let rpm: f64 = row.split_whitespace().nth(1).and_then(|rpm| rpm.parse().ok()).expect("a speed");
    assert!((rpm / 2400.0 - 1.0).abs() < 0.01, "{row}");
    assert!(row.contains(" rpm cw "), "{row}");
    assert!(row.contains(" 3 blades "), "{row}");
}

#[test]
fn a_rotor_is_exit_code_0() {
    let folder = folder();
    let run = measure(&write(&folder, "rotor.raw", &rotor()));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
}

#[test]
fn no_rotor_is_exit_code_1_with_a_reason() {
    let folder = folder();
    let run = measure(&write(&folder, "noise.raw", &noise()));
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let last = run.stdout.lines().next_back().unwrap_or_default();
    assert!(last.trim_start().starts_with("no reading: "), "{}", run.stdout);
    assert!(last.ends_with(')'), "what to do stands in brackets: {last}");
}

#[test]
fn empty_file() {
    let folder = folder();
    for name in ["empty.raw", "empty.csv", "empty.aedat4"] {
        let path = folder.path().join(name);
        std::fs::write(&path, b"").expect("room on the disk");
        assert_refused_as_bad(&measure(&path), "the file is empty");
    }
}

#[test]
fn header_without_events() {
    let folder = folder();
    for name in ["header.raw", "header.dat", "header.aedat4"] {
        assert_refused_as_bad(&measure(&write(&folder, name, &[])), "no events");
    }
    let names = write(&folder, "header.csv", &[]);
    assert_refused_as_bad(&measure(&names), "CSV without events");
    let run = evtach(&["measure", &names.display().to_string(), "--geometry", "200x160"], b"");
    assert_refused_as_bad(&run, "no events");
}

#[test]
fn text_file() {
    let folder = folder();
    let path = folder.path().join("letter.txt");
    std::fs::write(&path, "Dear reader,\nthis is a letter, not a recording.\n").expect("room");
    assert_refused_as_bad(&measure(&path), "letter.txt");
}

#[test]
fn binary_file() {
    let folder = folder();
    let path = folder.path().join("picture.raw");
    std::fs::write(&path, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x01\0").expect("room on the disk");
    assert_refused_as_bad(&measure(&path), "not a recording that is known here");
}

/// What lies before the cut is measured; that the file is cut is told.
#[test]
fn truncated_file() {
    let folder = folder();
    for name in ["cut.aedat4", "cut.raw", "cut.dat"] {
        let path = write(&folder, name, &rotor());
        let bytes = std::fs::read(&path).expect("the file just written");
        // An odd number, so that a word is cut in two.
        std::fs::write(&path, &bytes[..(bytes.len() * 9 / 10) | 1]).expect("room on the disk");
        let run = measure(&path);
        assert_eq!(run.code, Some(0), "{name}: {}", run.stderr);
        assert_reads_the_rotor(&run.stdout);
        let told = ["cut", "truncat", "incomplete", "ends", "byte"];
        assert!(told.iter().any(|word| run.stderr.contains(word)), "{name}: {}", run.stderr);
    }
}

/// Every subcommand uses what comes before the damage, tells its place, and says by its exit code that there is some.
#[test]
fn damage_in_the_midst() {
    let folder = folder();
    let path = csv(&folder, "damaged.csv", HEAD, &rotor());
    let text = std::fs::read_to_string(&path).expect("the file just written");
    let mut lines: Vec<&str> = text.lines().collect();
    let place = lines.len() * 9 / 10;
    lines[place] = "oops,1,2,1";
    std::fs::write(&path, lines.join("\n")).expect("room on the disk");
    let place = format!("CSV, line {}: the time is \"oops\"", place + 1);
    let path = path.display().to_string();
    let picture = folder.path().join("out.png").display().to_string();
    for (command, part, told) in [
        (&["measure", &path][..], &["--end", "0.12"][..], " rpm cw "),
        (&["measure", "--json", &path], &["--end", "0.12"], "\"status\":\"locked\""),
        (&["plot", &path, "--out", "-"], &["--end", "0.12"], "</html>"),
        (&["screen", &path, &picture], &["--at", "0.12"], "LOCKED"),
        (&["convert", &path, "-", "--to", "csv"], &["--end", "0.12"], "t,x,y,p"),
        (&["info", &path], &[], "out of order    0"),
    ] {
        let run = evtach(command, b"");
        assert_eq!(run.code, Some(2), "{command:?}: {}", run.stderr);
        assert!(run.stderr.contains(&place), "{command:?}: {}", run.stderr);
        assert!(run.stdout.contains(told), "{command:?}: {}", run.stdout);
        if !part.is_empty() {
            // What is damaged is not wanted.
            let run = evtach(&[command, part].concat(), b"");
            assert!(run.code < Some(2), "{command:?}: {}", run.stderr);
        }
    }
}

/// Cut within its header there is nothing to measure.
#[test]
fn truncated_header() {
    let folder = folder();
    let path = write(&folder, "stub.aedat4", &rotor());
    let bytes = std::fs::read(&path).expect("the file just written");
    std::fs::write(&path, &bytes[..20]).expect("room on the disk");
    assert_refused_as_bad(&measure(&path), "stub.aedat4");
}

/// The size is inferred from the events, and that is told.
#[test]
fn no_geometry() {
    let folder = folder();
    let run = measure(&csv(&folder, "rotor.csv", "t,x,y,p\n", &rotor()));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
    assert!(run.stderr.contains("the file does not say its size"), "{}", run.stderr);
    assert!(run.stderr.contains("--geometry"), "{}", run.stderr);
}

/// Thousandths may be milliseconds or microseconds: which is told or asked, and nothing is measured in the wrong one.
#[test]
fn a_unit_that_no_name_says() {
    let folder = folder();
    let thousandths = |name: &str, scale: u64| {
        let path = folder.path().join(name).display().to_string();
        let rows = rotor().into_iter().map(|e| {
            let t = e.t_us * scale;
            format!("{}.{:03},{},{},{}\n", t / 1000, t % 1000, e.x, e.y, e.polarity as u8)
        });
        std::fs::write(&path, rows.collect::<String>()).expect("room on the disk");
        path
    };
    let measure = |more: &[&str], path: &str| {
        evtach(&[&["measure", "--geometry", "200x160"], more, &[path]].concat(), b"")
    };
    let path = thousandths("ms.csv", 1);
    let run = measure(&[], &path);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let guess = "time in milliseconds, from the first events; --time-unit overrides";
    assert!(run.stderr.contains(guess), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
    let run = measure(&["--time-unit", "us"], &path);
    // A thousand times as fast as it turns: no rotor does.
    assert_eq!(run.code, Some(1), "{}", run.stdout);
    assert!(run.stderr.contains("time in microseconds, as given by --time-unit"), "{}", run.stderr);
    assert!(run.stderr.contains("200x160 as given by --geometry"), "{}", run.stderr);
    // A hundred times slower: in microseconds it would be ten times faster than it is.
    let path = thousandths("either.csv", 100);
    assert_refused_as_bad(&measure(&[], &path), "give --time-unit");
    // What says its unit itself is not read in another.
    let raw = write(&folder, "rotor.raw", &rotor()).display().to_string();
    assert_refused_as_bad(&measure(&["--time-unit", "ms"], &raw), "leave out --time-unit");
}

/// From a pipe it cannot be inferred: reading twice is not possible.
#[test]
fn no_geometry_from_a_pipe() {
    let folder = folder();
    let path = csv(&folder, "rotor.csv", "t,x,y,p\n", &rotor());
    let bytes = std::fs::read(&path).expect("the file just written");
    let run = evtach(&["measure", "-"], &bytes);
    assert_refused_as_bad(&run, "--geometry WxH");
    if cfg!(target_os = "linux") {
        let named = evtach(&["measure", "/dev/stdin"], &bytes);
        assert_refused_as_bad(&named, "--geometry WxH");
    }
    let run = evtach(&["measure", "--geometry", "200x160", "-"], &bytes);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
}

#[test]
fn stdin() {
    let folder = folder();
    for name in ["rotor.raw", "rotor.dat", "rotor.aedat4"] {
        let bytes = std::fs::read(write(&folder, name, &rotor())).expect("the file just written");
        let run = evtach(&["measure", "-"], &bytes);
        assert_eq!(run.code, Some(0), "{name}: {}", run.stderr);
        assert_reads_the_rotor(&run.stdout);
    }
    assert_refused_as_bad(&evtach(&["measure", "-"], b""), "the file is empty");
}

#[test]
fn events_outside_the_sensor() {
    let folder = folder();
    let mut events = rotor();
    let wild: Vec<Event> =
        events.iter().step_by(50).map(|e| Event { x: e.x + 3000, ..*e }).collect();
    let count = wild.len();
    events.extend(wild);
    events.sort_by_key(|e| e.t_us);
    let run = measure(&csv(&folder, "wild.csv", HEAD, &events));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
    let told = format!("{count} events outside the sensor left out");
    assert!(run.stderr.contains(&told), "{}", run.stderr);
    assert!(run.stderr.contains("--geometry"), "{}", run.stderr);
    let raw = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let run = evtach(&["measure", "--geometry", "1x1", &raw], b"");
    assert_refused_as_bad(&run, "no event lies inside a sensor of 1x1");
}

#[test]
fn time_going_backwards() {
    let folder = folder();
    let mut events = rotor();
    // Packets of two sources, merged carelessly: every hundredth event comes 3 ms late.
    let mut stepped = 0;
    for index in (0..events.len()).step_by(100) {
        if events[index].t_us > 3_000 {
            events[index].t_us -= 3_000;
            stepped += 1;
        }
    }
    let run = measure(&csv(&folder, "back.csv", HEAD, &events));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
    let told = format!("{stepped} events stepped back in time");
    assert!(run.stderr.contains(&told), "{told}: {}", run.stderr);
}

/// A camera that was restarted while recording: the clock begins again.
#[test]
fn clock_that_starts_again() {
    let folder = folder();
    let first: Vec<Event> =
        rotor().iter().map(|e| Event { t_us: e.t_us + 5_000_000, ..*e }).collect();
    let (length, lasts_us) = (first.len(), rotor().last().map_or(0, |event| event.t_us));
    let events = [first, rotor()].concat();
    let path = csv(&folder, "again.csv", HEAD, &events);
    let run = measure(&path);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
    let told = format!("behind event {length} the clock is set back by 5.");
    assert!(run.stderr.contains(&told), "{told}: {}", run.stderr);
    // The parts lie end to end.
    let both = format!(" {:.3} s, {} events", 2e-6 * lasts_us as f64, events.len());
    assert!(run.stdout.contains(&both), "{both}: {}", run.stdout);
    let run = evtach(&["plot", &path.display().to_string(), "--out", "-"], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains(&told), "{told}: {}", run.stderr);
    assert!(run.stdout.contains(&both), "{both} is not in the report");
}

/// Two short recordings: the second one's clock begins before the first one's ended, but by less than a clock is set back by.
#[test]
fn recordings_put_behind_each_other() {
    let folder = folder();
    let (count, lasts_us) = (rotor().len(), rotor().last().map_or(0, |event| event.t_us));
    let raw = write(&folder, "one.raw", &rotor());
    let text = csv(&folder, "one.csv", HEAD, &rotor());
    for (one, name, border) in [(raw, "two.raw", "byte"), (text, "two.csv", "line")] {
        let one = std::fs::read(one).expect("the file just written");
        let path = folder.path().join(name);
        std::fs::write(&path, [one.as_slice(), &one].concat()).expect("room on the disk");
        let run = measure(&path);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert_reads_the_rotor(&run.stdout);
        let told = format!("another recording begins at {border}");
        assert!(run.stderr.contains(&told), "{}", run.stderr);
        assert!(!run.stderr.contains("stepped back in time"), "{}", run.stderr);
        let both = format!(" {:.3} s, {} events", 2e-6 * lasts_us as f64, 2 * count);
        assert!(run.stdout.contains(&both), "{both}: {}", run.stdout);
        assert!(run.stdout.contains(" 0 lost)"), "{}", run.stdout);
    }
}

#[test]
fn all_on_polarity() {
    let folder = folder();
    let events: Vec<Event> =
        rotor().iter().map(|e| Event { polarity: Polarity::On, ..*e }).collect();
    let run = measure(&write(&folder, "on.raw", &events));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_reads_the_rotor(&run.stdout);
}

#[test]
fn missing_file_and_folder() {
    let folder = folder();
    let missing = folder.path().join("missing.raw");
    let run = measure(&missing);
    assert_refused_as_bad(&run, "missing.raw: cannot open: ");
    assert_eq!(run.stderr.matches("missing.raw").count(), 1, "{}", run.stderr);
    assert_refused_as_bad(&measure(folder.path()), "this is a folder");
    // Nor is there a folder to write to.
    let good = write(&folder, "good.raw", &rotor()).display().to_string();
    let out = missing.join("out.raw").display().to_string();
    for command in [&["convert", &good, &out][..], &["synth", &out, "--duration-ms", "5"]] {
        let run = evtach(command, b"");
        assert_refused_as_bad(&run, "cannot open: ");
        assert_eq!(run.stderr.matches(&out).count(), 1, "{}", run.stderr);
    }
}

/// The good one is measured all the same; the exit code is the largest.
#[test]
fn one_of_two_files_fails() {
    let folder = folder();
    let good = write(&folder, "good.raw", &rotor()).display().to_string();
    let silent = write(&folder, "noise.raw", &noise()).display().to_string();
    let missing = folder.path().join("missing.raw").display().to_string();
    for (files, code) in [
        ([&good, &missing], 2),
        ([&missing, &good], 2),
        ([&good, &silent], 1),
        ([&silent, &good], 1),
        ([&good, &good], 0),
        ([&silent, &missing], 2),
    ] {
        let run = evtach(&["measure", files[0], files[1]], b"");
        assert_eq!(run.code, Some(code), "{files:?}: {}", run.stderr);
        if files.contains(&&good) {
            assert_reads_the_rotor(&run.stdout);
        }
        let run = evtach(&["info", files[0], files[1]], b"");
        let missing = files.iter().filter(|file| **file == &missing).count();
        assert_eq!(run.code, Some(if missing > 0 { 2 } else { 0 }), "{}", run.stderr);
        assert_eq!(run.stdout.matches("sensor  ").count(), 2 - missing, "{}", run.stdout);
    }
}

#[test]
fn bad_usage() {
    let folder = folder();
    let good = write(&folder, "good.raw", &rotor()).display().to_string();
    for args in [
        vec!["measure"],
        vec!["measure", "--geometry", "0x5", &good],
        vec!["measure", "--roi", "1,2,3", &good],
        vec!["measure", "--blades", "0", &good],
        vec!["measure", "--window-ms", "1", &good],
        vec!["measure", "--no-such-flag", &good],
        vec!["measure", "--start", "nan", &good],
        vec!["measure", "--gyro-sigma", "0.003", &good],
        vec!["plot", "--gyro-sigma", "0.003", &good],
        vec!["convert", "--end", "inf", &good, "-"],
        vec!["no-such-command"],
    ] {
        let run = evtach(&args, b"");
        assert_eq!(run.code, Some(2), "{args:?}: {}", run.stderr);
        assert_eq!(run.stdout, "", "{args:?}");
        let last = run.stderr.trim_end().lines().next_back().unwrap_or_default();
        assert!(last.contains("--help"), "{args:?}: {}", run.stderr);
    }
}

/// A region or a stretch without events is a mistake of the person, not a property of the recording.
#[test]
fn nothing_inside_the_region() {
    let folder = folder();
    let good = write(&folder, "good.raw", &rotor()).display().to_string();
    let run = evtach(&["measure", "--start", "100", &good], b"");
    assert_refused_as_bad(&run, "widen");
}

#[test]
fn a_shuffled_recording_is_refused() {
    let folder = folder();
    let mut events = rotor();
    // As a reader does that sorts by pixel what it reads at once.
    for block in events.chunk_by_mut(|a, b| a.t_us / 4_000 == b.t_us / 4_000) {
        block.sort_by_key(|event| (event.y, event.x, event.t_us));
    }
    let path = write(&folder, "shuffled.npy", &events);
    assert_refused_as_bad(&measure(&path), "not in time order");
    let (path, out) = (path.display().to_string(), folder.path().join("out").display().to_string());
    // Of a part of it no speed is right either.
    assert_refused_as_bad(&evtach(&["measure", "--end", "0.1", &path], b""), "not in time order");
    assert_refused_as_bad(&evtach(&["plot", &path, "--out", &out], b""), "not in time order");
    assert_refused_as_bad(&evtach(&["screen", &path, &out], b""), "not in time order");
}

#[test]
fn a_clock_that_is_set_back_once_leaves_the_rest_as_it_was() {
    let folder = folder();
    let mut events = rotor();
    let end_us = events.last().map_or(0, |event| event.t_us);
    let set_back = |event: &Event| Event { t_us: event.t_us + end_us - end_us / 3, ..*event };
    let again: Vec<Event> = events.iter().map(set_back).collect();
    events.extend(again);
    let run = measure(&write(&folder, "set_back.npy", &events));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("stepped back in time"), "{}", run.stderr);
}

#[cfg(target_os = "linux")]
fn full() -> std::fs::File {
    std::fs::File::options().write(true).open("/dev/full").expect("Linux has it")
}

/// What is said beside the answer is no condition of it.
#[cfg(target_os = "linux")]
#[test]
fn no_room_for_what_is_said() {
    let folder = folder();
    let path = write(&folder, "rotor.raw", &rotor());
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_evtach"))
        .args(["measure", "-v"])
        .arg(&path)
        .stderr(full())
        .output()
        .expect("evtach starts");
    assert_eq!(output.status.code(), Some(0));
    assert_reads_the_rotor(&String::from_utf8_lossy(&output.stdout));
}

#[cfg(target_os = "linux")]
#[test]
fn no_room_for_the_answer() {
    let folder = folder();
    let path = write(&folder, "rotor.raw", &rotor());
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_evtach"))
        .arg("measure")
        .arg(&path)
        .stdout(full())
        .output()
        .expect("evtach starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("standard output: No space left"), "{stderr}");
}

/// As `| head` leaves it.
#[test]
fn nobody_reads_the_answer() {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_evtach"))
        .args(["bench", "trust", "--show", "1"])
        .stdout(writer)
        .output()
        .expect("evtach starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), &*stderr), (Some(0), ""));
}

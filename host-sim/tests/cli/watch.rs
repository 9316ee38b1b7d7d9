//! `evtach watch`: what it refuses, and, in a terminal, what it says beside the view.

use super::{assert_refused_as_bad, evtach, folder, rotor, write};

/// An option that does nothing was meant for another source.
#[test]
fn options_of_the_other_source_are_refused() {
    let folder = folder();
    let file = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let mut cases = vec![(file.as_str(), ["--baud", "9600"])];
    if cfg!(unix) {
        let of_file = [["--speed", "2"], ["--geometry", "20x20"], ["--time-unit", "ms"]];
        cases.extend(of_file.map(|option| ("/dev/null", option)));
    }
    for (from, [option, value]) in cases {
        let run = evtach(&["watch", from, option, value], b"");
        assert_refused_as_bad(&run, &format!("{option} does nothing there"));
    }
    // As far as it comes without a terminal.
    for option in [["--speed", "2"], ["--geometry", "200x160"]] {
        let run = evtach(&[&["watch", &file][..], &option].concat(), b"");
        assert_refused_as_bad(&run, "draws on a terminal");
    }
}

#[cfg(target_os = "linux")]
mod in_a_terminal {
    use std::fs::File;
    use std::io::{Read as _, Write as _};
    use std::os::unix::ffi::OsStrExt as _;
    use std::process::{Command, Stdio};
    use std::sync::mpsc::{self, RecvTimeoutError};
    use std::thread;
    use std::time::{Duration, Instant};

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{Winsize, tcsetwinsize};

    use super::super::{Run, csv, folder, rotor};

    /// Longest wait for what the view is to tell.
    const PATIENCE: Duration = Duration::from_secs(60);

    /// Watches in a terminal of its own, until the view tells `until`; then leaves it.
    fn watch(args: &[&str], until: &str) -> Run {
        let start = Instant::now();
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
        grantpt(&controller).expect("a terminal of ours");
        unlockpt(&controller).expect("a terminal of ours");
        let name = ptsname(&controller, Vec::new()).expect("its name");
        let path = std::ffi::OsStr::from_bytes(name.as_bytes());
        let terminal = File::options().read(true).write(true).open(path).expect("its other end");
        let size = Winsize { ws_row: 24, ws_col: 120, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&terminal, size).expect("a size");
        let end = |file: &File| Stdio::from(file.try_clone().expect("one end more"));
        let mut child = Command::new(env!("CARGO_BIN_EXE_evtach"))
            .arg("watch")
            .args(args)
            .stdin(end(&terminal))
            .stdout(end(&terminal))
            .stderr(Stdio::piped())
            .spawn()
            .expect("evtach starts");
        drop(terminal);
        let mut view = File::from(controller);
        let mut keys = view.try_clone().expect("one end more");
        let (sender, drawn) = mpsc::channel();
        // Read to its end, or the terminal is full and holds up the view.
        let reader = thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count) = view.read(&mut bytes)
                && sender.send(bytes[..count].to_vec()).is_ok()
            {}
        });
        let (mut shown, mut has_left) = (Vec::new(), false);
        loop {
            match drawn.recv_timeout(PATIENCE) {
                Ok(mut bytes) => shown.append(&mut bytes),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            let is_late = start.elapsed() > PATIENCE;
            if !has_left && (is_late || String::from_utf8_lossy(&shown).contains(until)) {
                has_left = true;
                keys.write_all(b"q").expect("a terminal that hears");
            }
        }
        reader.join().expect("all is read");
        let mut stderr = String::new();
        let told = child.stderr.take().expect("a pipe").read_to_string(&mut stderr);
        told.expect("what was told");
        let code = child.wait().expect("an end").code();
        Run { code, stdout: String::from_utf8_lossy(&shown).into_owned(), stderr }
    }

    #[test]
    fn what_was_assumed_and_what_is_to_be_known_is_told() {
        let folder = folder();
        let mut events = rotor();
        let last = events.len() - 1;
        events[last].x = 3000;
        let path = csv(&folder, "rotor.csv", "t,x,y,p\n", &events).display().to_string();
        let run = watch(&[&path, "--speed", "1000", "--geometry", "200x160"], "ended");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        for told in ["200x160 as given by --geometry", "1 events outside the sensor left out"] {
            assert!(run.stderr.contains(&format!("{path}: {told}")), "{told}: {}", run.stderr);
        }
        assert!(run.stderr.contains("time in microseconds, from the first"), "{}", run.stderr);
    }
}

//! The session of `interop/pyvisa_session.py`, and what it must find: a rotor of five blades at 1500 rpm, counterclockwise.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use evtach_core::Direction;
use evtach_host::measure::Capacity;
use evtach_host::recording::{self, OpenOptions};

use crate::{load, measure};

fn interop() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("interop")
}

/// Python with PyVISA, or `None` where it cannot be had.
#[must_use]
pub fn python() -> Option<String> {
    let output = Command::new("bash").arg(interop().join("setup.sh")).arg("visa").output();
    match output {
        Ok(output) if output.status.success() => {
            Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
        }
        Ok(output) => {
            println!("skipped: no PyVISA ({})", String::from_utf8_lossy(&output.stderr).trim());
            None
        }
        Err(error) => {
            println!("skipped: no shell ({error})");
            None
        }
    }
}

/// Starts the session; what it prints is one JSON object.
///
/// # Panics
/// Where Python does not start.
#[must_use]
pub fn session(python: &str, port: &str, out: &Path) -> Child {
    Command::new(python)
        .arg(interop().join("pyvisa_session.py"))
        .arg(port)
        .arg(out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the virtual environment's Python runs")
}

/// Checks what a session printed, from a device of this version, and that the recording it saved is read as
/// `evtach measure` reads it.
///
/// # Panics
/// Where it is not so: the test fails.
pub fn check(client: Child, out: &Path, version: &str) {
    let output = client.wait_with_output().expect("a child");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let number = |name: &str| found[name].as_f64().expect("a number");
    assert_eq!(found["identity"], format!("EV-Tach,EV-Tach,0,{version}"));
    assert_eq!((number("blades"), number("limit_hz")), (5.0, 30.0));
    assert!((number("speed_hz") / 25.0 - 1.0).abs() < 0.01, "{found}");
    assert!((number("speed_rpm") / 1500.0 - 1.0).abs() < 0.01, "{found}");
    assert!(number("sigma_rpm") > 0.0 && number("sigma_rpm") < 15.0, "{found}");
    assert_eq!((&found["direction"], number("alarm")), (&"CCW".into(), 0.0));
    assert!(found["error"].as_str().is_some_and(|error| error.starts_with("-222,\"")), "{found}");
    assert_eq!((number("events"), &found["no_error"]), (16.0, &"0,\"No error\"".into()));
    assert!(found["log"]["rotors"][0]["rpm"].is_number(), "{found}");
    assert_eq!(found["after"], "1");

    let recording = recording::open(out, &OpenOptions::default()).expect("a recording");
    assert_eq!(recording.format, "EV8");
    let recorded = load(out).expect("no damage");
    assert_eq!(recorded.events.len(), 100_000);
    let (_, summary) = measure(&recorded, Capacity::Device);
    let speed = summary.rotors.first().and_then(|rotor| rotor.speed).expect("a speed");
    assert!((f64::from(speed.rpm()) / 1500.0 - 1.0).abs() < 0.01, "{speed:?}");
    assert_eq!(speed.direction(), Direction::Ccw);
}

/// Where a session's recording goes.
#[must_use]
pub fn out(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("evtach-{name}-{}.ev8", std::process::id()))
}

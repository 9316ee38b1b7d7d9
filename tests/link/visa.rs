//! The session of `interop/pyvisa_session.py`, and what it must find: a rotor of five blades at 1500 rpm, counterclockwise.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use evtach_core::{Settings, Speed};
use evtach_host::measure::{Capacity, measure_events};
use evtach_host::recording::{self, OpenOptions};

fn interop() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("interop")
}

/// Python with PyVISA, or `None` where it cannot be had.
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

/// Checks what a session printed and the recording that it saved, from a device of this version.
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

    let mut recording = recording::open(out, &OpenOptions::default()).expect("what was fetched");
    let mut events = Vec::new();
    while recording.read_chunk(&mut events).expect("an undamaged recording") {}
    assert_eq!((recording.format, events.len()), ("EV8", 100_000));
    assert_eq!(recording.side().notes, [""; 0]);
    let settings = Settings::new(recording.geometry);
    let (readings, _) = measure_events(&events, &[], settings, Capacity::Device);
    let speeds = readings.iter().flat_map(|reading| &reading.rotors).filter_map(|r| r.speed);
    let speeds: Vec<f32> = speeds.map(|s| s.omega_rad_s * Speed::RPM_PER_RAD_S).collect();
    assert!(!speeds.is_empty(), "no speed in {} events", events.len());
    assert!(speeds.iter().all(|rpm| (rpm / -1500.0 - 1.0).abs() < 0.01), "{speeds:?}");
}

/// Where a session's recording goes.
pub fn out(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("evtach-{name}-{}.ev8", std::process::id()))
}

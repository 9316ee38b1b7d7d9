//! The session of `interop/pyvisa_session.py`, and what it must find: a rotor of five blades at 1500 rpm, counterclockwise.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

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

/// Checks what a session printed, from a device of this version, and that `evtach measure` reads the recording it saved.
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

    let measured = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--package", "evtach-host", "--", "measure", "--json"])
        .args(["--capacity", "device"])
        .arg(out)
        .output()
        .expect("cargo runs");
    let told = String::from_utf8_lossy(&measured.stderr);
    assert!(measured.status.success(), "evtach measure: {told}");
    let read: serde_json::Value = serde_json::from_slice(&measured.stdout).expect("JSON");
    assert_eq!((&read["format"], &read["events"]), (&"EV8".into(), &100_000.into()), "{told}");
    let rotor = &read["rotors"][0];
    assert!((rotor["rpm"].as_f64().expect("a speed") / 1500.0 - 1.0).abs() < 0.01, "{read}");
    assert_eq!(rotor["direction"], "ccw");
}

/// Where a session's recording goes.
pub fn out(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("evtach-{name}-{}.ev8", std::process::id()))
}

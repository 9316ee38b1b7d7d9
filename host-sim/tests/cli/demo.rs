//! The recording that ships with the project, which the README measures first.

use std::path::Path;

use serde_json::Value;

use super::evtach;

#[test]
fn the_demo_is_small_and_reads_as_its_truth() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../demo");
    let path = folder.join("fan.raw");
    let size = std::fs::metadata(&path).expect("demo/fan.raw").len();
    assert!(size < 1_000_000, "{size} bytes");
    let truth = std::fs::read_to_string(folder.join("fan.truth.json")).expect("its truth");
    let truth: Value = serde_json::from_str(&truth).expect("JSON");
    let truth = &truth["rotors"][0];

    let run = evtach(&["measure", "--json", &path.display().to_string()], b"");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let read: Value = serde_json::from_str(&run.stdout).expect("one JSON document");
    assert_eq!(read["status"], "locked");
    let [rotor] = &read["rotors"].as_array().expect("a list")[..] else { panic!("{read}") };
    let number = |value: &Value| value.as_f64().expect("a number");
    let off = number(&rotor["rpm"]) - number(&truth["rpm_camera_mean_signed"]).abs();
    assert!(off.abs() < 4.0 * number(&rotor["rpm_sigma"]), "off by {off} rpm: {rotor}");
    assert_eq!(rotor["direction"], truth["direction"]);
    assert_eq!(rotor["blades"], truth["blades"]);
}

#[test]
fn the_readme_shows_what_the_demo_reads() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let readme = std::fs::read_to_string(root.join("README.md")).expect("the README");
    let run = evtach(&["measure", &root.join("demo/fan.raw").display().to_string()], b"");
    // Behind the path, which is another where tests run.
    let told = run.stdout.split_once("demo/fan.raw").map(|(_, told)| told).unwrap_or_default();
    assert!(told.lines().count() == 2, "{}", run.stdout);
    let shown = |line: &&str| readme.lines().any(|shown| shown.ends_with(line));
    let missing: Vec<&str> = told.lines().filter(|line| !shown(line)).collect();
    assert!(missing.is_empty(), "not in README.md: {missing:?}");
}

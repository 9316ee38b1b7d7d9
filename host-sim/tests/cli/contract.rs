//! `evtach measure --json`: the names and types that other programs rely on. `"schema"` counts their versions: when
//! a field here goes, or gets another name or type, so has that number. `host-sim/JSON.md` tells people what they mean.

use evtach_core::Reason;
use serde_json::{Map, Value};

use super::{evtach, folder, noise, rotor, write};

/// Type of a value in the contract.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// A whole number, 0 or more.
    Count,
    /// A number.
    Number,
    Text,
    /// One of these words.
    Word(&'static [&'static str]),
    /// A reason for no reading.
    Reason,
    List,
    Object,
}

use Kind::{Count, List, Number, Object, Text, Word};

const STATUS: Kind = Word(&["locked", "coarse", "refused"]);

/// Name, type, and whether null may stand there.
type Field = (&'static str, Kind, bool);

const DOCUMENT: [Field; 15] = [
    ("schema", Count, false),
    ("program", Text, false),
    ("settings", Object, false),
    ("file", Text, false),
    ("format", Text, false),
    ("width_px", Count, false),
    ("height_px", Count, false),
    ("duration_s", Number, false),
    ("events", Count, false),
    ("thinned", Count, false),
    ("lost", Count, false),
    ("status", STATUS, false),
    ("reason", Kind::Reason, true),
    ("rotors", List, false),
    ("readings", List, false),
];

const SETTINGS: [Field; 8] = [
    ("capacity", Word(&["full", "device"]), false),
    ("blades", Count, true),
    ("roi_px", List, true),
    ("window_s", Number, true),
    ("start_s", Number, false),
    ("end_s", Number, true),
    ("clock_ppm", Number, false),
    ("gyro_sigma_rad_s", Number, true),
];

const ROTOR: [Field; 12] = [
    ("id", Text, false),
    ("x_px", Number, false),
    ("y_px", Number, false),
    ("radius_px", Number, false),
    ("rpm", Number, true),
    ("rpm_sigma", Number, true),
    ("direction", Word(&["cw", "ccw"]), true),
    ("blades", Count, true),
    ("accel_rpm_per_s", Number, true),
    ("frame", Word(&["camera", "room"]), true),
    ("status", STATUS, false),
    ("reason", Kind::Reason, true),
];

const READING: [Field; 5] = [
    ("t_s", Number, false),
    ("window_s", Number, false),
    ("status", STATUS, false),
    ("reason", Kind::Reason, true),
    ("rotors", List, false),
];

fn is(kind: Kind, value: &Value) -> bool {
    match kind {
        Count => value.is_u64(),
        Number => value.is_number(),
        Text => value.is_string(),
        Word(words) => value.as_str().is_some_and(|word| words.contains(&word)),
        Kind::Reason => {
            value.as_str().is_some_and(|word| Reason::ALL.iter().any(|r| r.as_str() == word))
        }
        List => value.is_array(),
        Object => value.is_object(),
    }
}

/// Exactly these fields, in this order, of these types.
fn check(value: &Value, fields: &[Field]) -> Map<String, Value> {
    let object = value.as_object().unwrap_or_else(|| panic!("no object: {value}"));
    let mut expected: Vec<&str> = fields.iter().map(|field| field.0).collect();
    let mut names: Vec<&str> = object.keys().map(String::as_str).collect();
    expected.sort_unstable();
    names.sort_unstable();
    assert_eq!(names, expected);
    for (name, kind, nullable) in fields {
        let field = &object[*name];
        assert!(
            is(*kind, field) || (*nullable && field.is_null()),
            "{name} is {field}, not {kind:?}"
        );
    }
    let refused = object.get("status").is_some_and(|status| status == "refused");
    if object.contains_key("status") {
        assert_eq!(refused, !object["reason"].is_null(), "a refusal has a reason, all else none");
    }
    object.clone()
}

fn check_rotors(parent: &Map<String, Value>) -> usize {
    let rotors = parent["rotors"].as_array().expect("checked to be a list");
    for rotor in rotors {
        let rotor = check(rotor, &ROTOR);
        // A speed comes with all that belongs to it, a refusal with nothing of it.
        for name in ["rpm", "rpm_sigma", "direction", "frame"] {
            assert_eq!(rotor[name].is_null(), rotor["status"] == "refused", "{name}: {rotor:?}");
        }
        assert!(rotor["rpm"].as_f64().is_none_or(|rpm| rpm >= 0.0), "rpm is a magnitude");
        assert!(rotor["rpm_sigma"].as_f64().is_none_or(|sigma| sigma > 0.0));
    }
    rotors.len()
}

fn check_document(line: &str) -> Map<String, Value> {
    let value: Value = serde_json::from_str(line).expect("one JSON document on each line");
    let document = check(&value, &DOCUMENT);
    assert_eq!(document["schema"], 1);
    assert_eq!(document["program"], concat!("evtach ", env!("CARGO_PKG_VERSION")));
    check(&document["settings"], &SETTINGS);
    check_rotors(&document);
    let readings = document["readings"].as_array().expect("checked to be a list");
    for reading in readings {
        check_rotors(&check(reading, &READING));
    }
    document
}

#[test]
fn one_document_a_file_with_exactly_these_fields() {
    let folder = folder();
    let with = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let without = write(&folder, "noise.aedat4", &noise()).display().to_string();
    let run = evtach(&["measure", "--json", &with, &without], b"");
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let lines: Vec<&str> = run.stdout.lines().collect();
    let [first, second] = lines[..] else { panic!("two lines: {}", run.stdout) };

    let first = check_document(first);
    assert_eq!(first["file"], with.as_str());
    assert_eq!((&first["width_px"], &first["height_px"]), (&200.into(), &160.into()));
    assert_eq!(first["events"], rotor().len());
    assert_eq!(first["status"], "locked");
    let rotors = first["rotors"].as_array().expect("checked to be a list");
    assert_eq!(rotors.len(), 1);
    assert_eq!(rotors[0]["id"], "A");
    assert_eq!(rotors[0]["direction"], "cw");
    assert_eq!(rotors[0]["blades"], 3);
    assert_eq!(rotors[0]["frame"], "camera");
    let rpm = rotors[0]["rpm"].as_f64().expect("a speed");
    assert!((rpm / 2400.0 - 1.0).abs() < 0.01, "{rpm}");
    let readings = first["readings"].as_array().expect("checked to be a list");
    assert!(!readings.is_empty());
    let duration_s = first["duration_s"].as_f64().expect("a number");
    for reading in readings {
        let (t_s, window_s) = (reading["t_s"].as_f64(), reading["window_s"].as_f64());
        let (t_s, window_s) = (t_s.expect("a number"), window_s.expect("a number"));
        // The middle of the window, which lies within the recording.
        assert!(t_s - window_s / 2.0 > -1e-3 && t_s + window_s / 2.0 < duration_s + 1e-3);
    }

    let second = check_document(second);
    assert_eq!(second["status"], "refused");
    assert_eq!(second["file"], without.as_str());
}

#[test]
fn every_field_is_explained() {
    let manual = include_str!("../../JSON.md");
    for (part, fields) in [
        ("# The file", &DOCUMENT[..]),
        ("# The settings", &SETTINGS),
        ("# A reading", &READING),
        ("# A rotor", &ROTOR),
    ] {
        let rest = manual.split_once(part).map(|(_, rest)| rest).expect("a part for each object");
        let part = rest.split_once("\n## ").map_or(rest, |(part, _)| part);
        let names: Vec<&str> = part
            .lines()
            .filter(|line| line.starts_with("| `"))
            .flat_map(|line| line.split('|').nth(1).unwrap_or("").split('`').skip(1).step_by(2))
            .collect();
        let mut expected: Vec<&str> = fields.iter().map(|field| field.0).collect();
        expected.sort_unstable();
        let mut told = names.clone();
        told.sort_unstable();
        assert_eq!(told, expected);
    }
}

#[test]
fn what_was_stated_is_told() {
    let folder = folder();
    let file = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let settings = |args: &[&str]| {
        let run = evtach(&[&["measure", "--json", &file], args].concat(), b"");
        check_document(run.stdout.trim_end())["settings"].clone()
    };
    let unstated = serde_json::json!({
        "capacity": "full", "blades": null, "roi_px": null, "window_s": null, "start_s": 0.0, "end_s": null, "clock_ppm": 15.0,
        "gyro_sigma_rad_s": null,
    });
    assert_eq!(settings(&[]), unstated);
    let stated = serde_json::json!({
        "capacity": "device", "blades": 3, "roi_px": [1, 2, 190, 150], "window_s": 0.1, "start_s": 0.05, "end_s": 0.2,
        "clock_ppm": 2.5, "gyro_sigma_rad_s": 0.003,
    });
    let args = "--capacity device --blades 3 --roi 1,2,190,150 --window-ms 100 --start 0.05 --end 0.2 --clock-ppm 2.5 --gyro \
                --gyro-sigma 0.003";
    assert_eq!(settings(&args.split_whitespace().collect::<Vec<_>>()), stated);
}

/// Where a part is measured, its readings lie where they lie in the whole.
#[test]
fn times_count_from_the_first_event_of_the_file() {
    let folder = folder();
    let file = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let run = evtach(&["measure", "--json", "--start", "0.05", &file], b"");
    let document = check_document(run.stdout.trim_end());
    let half_s = document["duration_s"].as_f64().expect("a number") / 2.0;
    let last = document["readings"].as_array().and_then(|readings| readings.last());
    let t_s = last.and_then(|reading| reading["t_s"].as_f64()).expect("a reading");
    assert!((t_s - 0.05 - half_s).abs() < 5e-3, "{t_s} s, half of it {half_s} s");
}

#[test]
fn a_file_that_cannot_be_read_has_no_document() {
    let folder = folder();
    let good = write(&folder, "rotor.raw", &rotor()).display().to_string();
    let missing = folder.path().join("missing.raw").display().to_string();
    let run = evtach(&["measure", "--json", &missing, &good], b"");
    assert_eq!(run.code, Some(2));
    assert_eq!(run.stdout.lines().count(), 1, "{}", run.stdout);
    check_document(run.stdout.trim_end());
}

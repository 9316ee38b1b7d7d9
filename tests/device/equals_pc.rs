//! The device and the PC give the same readings for the same events, to the last bit.

use std::env;
use std::path::{Path, PathBuf};

use evtach_core::{Event, Geometry, Reading, Speed};
use evtach_host::device::{self, CallCost, INSTRUCTIONS_PER_TICK, MOST_IN_STEP, Pace};
use evtach_host::recording::{self, OpenOptions};
use evtach_host::synth::scene::Lamp;
use evtach_host::synth::{self, Rotor, Scene};

use super::compare;

/// Plays events to the device and compares; `None` without QEMU.
fn compare(name: &str, geometry: Geometry, events: &[Event]) -> Option<Vec<Reading>> {
    if !compare::qemu_present() {
        return None;
    }
    let image = device::build().expect("the firmware builds");
    let output = device::run(&image, geometry, events, Pace::File).expect("the firmware runs");
    for CallCost { name: stage, longest_ticks, .. } in &output.stages {
        let instructions = longest_ticks * INSTRUCTIONS_PER_TICK;
        assert!(instructions <= MOST_IN_STEP, "{name}: a step of {stage} took {instructions}");
    }
    Some(compare::assert_equal(name, geometry, events, &output))
}

/// A scene in front of a DAVIS346.
fn synthesise(scene: &Scene) -> (Geometry, Vec<Event>) {
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    (geometry, synth::generate(scene).expect("a scene in range").events)
}

/// Every speed lies within 1 % of the truth and there is one: equal bits of nonsense would prove nothing.
fn assert_speed(readings: &[Reading], rpm: f32) {
    let speeds: Vec<f32> = readings
        .iter()
        .flat_map(|reading| &reading.rotors)
        .filter_map(|rotor| rotor.speed)
        .map(|speed| speed.omega_rad_s * Speed::RPM_PER_RAD_S)
        .collect();
    assert!(!speeds.is_empty(), "no speed");
    for speed in speeds {
        assert!((speed / rpm - 1.0).abs() < 0.01, "{speed} rpm instead of {rpm}");
    }
}

#[test]
fn slow_fan() {
    let rotor = Rotor { blades: 3, rpm: 1200.0, ..Rotor::default() };
    let scene = Scene { duration_ms: 400.0, rotors: vec![rotor], ..Scene::default() };
    let (geometry, events) = synthesise(&scene);
    if let Some(readings) = compare("slow fan", geometry, &events) {
        assert_speed(&readings, 1200.0);
    }
}

#[test]
fn fast_propeller() {
    let rotor = Rotor { blades: 2, rpm: -9000.0, ..Rotor::default() };
    let scene = Scene { rotors: vec![rotor], ..Scene::default() };
    let (geometry, events) = synthesise(&scene);
    if let Some(readings) = compare("fast propeller", geometry, &events) {
        assert_speed(&readings, -9000.0);
    }
}

#[test]
fn flicker_is_refused_alike() {
    // A patch of wall that a lamp shines on: the whole sensor would give 44 Mev/s.
    let lamp = Lamp { spot_px: Some([173.0, 130.0, 30.0]), ..Lamp::default() };
    let scene = Scene { rotors: Vec::new(), lamp: Some(lamp), ..Scene::default() };
    let (geometry, events) = synthesise(&scene);
    if let Some(readings) = compare("lamp", geometry, &events) {
        assert!(readings.iter().all(|reading| reading.status.reason().is_some()), "{readings:?}");
    }
}

#[test]
fn real_recordings() {
    let folder = env::var_os("EVTACH_RECORDINGS")
        .map_or_else(
            || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recordings"),
            PathBuf::from,
        )
        .join("real");
    for name in ["spinning-dot.evt2.raw", "person.aedat4", "lamp-100hz.davis346.aedat4"] {
        let path = folder.join(name);
        if !path.exists() {
            println!("skipped: no recordings ({})", path.display());
            continue;
        }
        let mut recording =
            recording::open(&path, &OpenOptions::default()).expect("a known recording");
        let mut events = Vec::new();
        while recording.read_chunk(&mut events).expect("an undamaged recording") {}
        compare(name, recording.geometry, &events);
    }
}

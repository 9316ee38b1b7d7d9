//! What a camera at the port sees, read by the device: the PC's readings to the bit.

use evtach_core::Event;
use evtach_core::decode::Dvxplorer;
use evtach_firmware::sensor::usb::emulated::DvxplorerWords;
use evtach_host::measure::{Capacity, ReadingRow};
use evtach_host::synth::{Rotor, Scene};
use evtach_tests::{Loaded, load, measure, recordings, show};

use crate::board::{Board, Camera};
use crate::{DAVIS346, DVXPLORER, from_zero, one_rotor, synthesise};

/// Seconds that a first reading may take.
const PATIENCE_S: f64 = 8.0;

/// Plays a recording to the device and returns the first line that its link logs.
fn first_reading(board: &mut Board, camera: Camera, sees: &Loaded) -> ReadingRow {
    board.run(0.5);
    board.serial("SYST:LOG ON");
    board.plug_camera(camera, sees);
    let mut said = String::new();
    for _ in 0..(PATIENCE_S * 10.0) as usize {
        board.run(0.1);
        said.push_str(&board.read());
        if said.contains('\n') {
            break;
        }
    }
    let seen = board.camera();
    assert_eq!((&seen["filtered"], &seen["dropped"]), (&0.into(), &0.into()), "{seen}");
    let line = said.lines().next().unwrap_or_default();
    serde_json::from_str(line).unwrap_or_else(|error| unreachable!("{said:?}: {error}; {seen}"))
}

/// The events in the order in which they leave the camera: a DVXplorer sends those of a column and an instant together.
fn as_sent(camera: Camera, sees: &Loaded) -> Loaded {
    if camera == Camera::Davis346 {
        return sees.clone();
    }
    let (mut words, mut said, mut events) = (DvxplorerWords::default(), Vec::new(), Vec::new());
    for event in &sees.events {
        words.event(event, &mut said);
    }
    words.flush(&mut said);
    let mut decoder = Dvxplorer::new();
    for word in said {
        decoder.decode(word, |event| events.push(event));
    }
    Loaded { events, geometry: sees.geometry }
}

/// The device's first reading of these events is that of `evtach measure --capacity device`, to the last digit; both
/// write an f32 with the fewest digits that give it again.
fn assert_reads_as_the_pc(camera: Camera, sees: &Loaded, rotors: usize, status: &str) {
    let Some(mut board) = Board::switch_on() else { return };
    let (readings, _) = measure(&as_sent(camera, sees), Capacity::Device);
    let first = readings.first().expect("a reading on the PC");
    let device = first_reading(&mut board, camera, sees);
    assert_eq!(device, ReadingRow::new(first, first.t_us));
    assert_eq!((device.rotors.len(), &*device.status), (rotors, status), "{device:?}");
    board.assert_sound();
}

#[test]
fn one_rotor_before_a_davis346() {
    assert_reads_as_the_pc(Camera::Davis346, &one_rotor(1500.0, 400.0), 1, "locked");
}

#[test]
fn four_rotors() {
    let at =
        |x_px, y_px, rpm| Rotor { x_px, y_px, rpm, radius_px: 18.0, blades: 2, ..Rotor::default() };
    let rotors = vec![
        at(90.0, 70.0, 1400.0),
        at(250.0, 70.0, -1520.0),
        at(90.0, 190.0, -1460.0),
        at(250.0, 190.0, 1580.0),
    ];
    let sees = synthesise(&Scene { rotors, duration_ms: 400.0, ..Scene::default() });
    let Some(mut board) = Board::switch_on() else { return };
    board.run(0.5);
    board.plug_camera(Camera::Davis346, &sees);
    // The first search for four takes so long that its reading is too old to be shown as the present; what is remembered
    // of each rotor tells it all the same.
    board.wait_for(10.0, "CALC:AVER:COUN?", |answer| answer == "1");
    let (readings, _) = measure(&sees, Capacity::Device);
    let pc = ReadingRow::new(readings.first().expect("a reading on the PC"), 0);
    assert_eq!(pc.rotors.len(), 4);
    for rotor in &pc.rotors {
        let device: f64 =
            board.query(&format!("CONF {};:CALC:AVER:MAX?", rotor.id)).parse().expect("a speed");
        assert_eq!(Some(device), rotor.rpm, "rotor {}", rotor.id);
    }
    board.assert_sound();
}

#[test]
fn a_refusal() {
    // Nothing turns: noise only.
    let mut scene = Scene { rotors: Vec::new(), duration_ms: 1500.0, ..Scene::default() };
    scene.sensor.noise_hz = 3.0;
    assert_reads_as_the_pc(Camera::Davis346, &synthesise(&scene), 0, "refused");
}

#[test]
fn one_rotor_before_a_dvxplorer() {
    let rotor =
        Rotor { rpm: 1200.0, radius_px: 24.0, x_px: 400.0, y_px: 300.0, ..Rotor::default() };
    let scene = Scene {
        width_px: DVXPLORER.width_px,
        height_px: DVXPLORER.height_px,
        rotors: vec![rotor],
        duration_ms: 400.0,
        ..Scene::default()
    };
    assert_reads_as_the_pc(Camera::Dvxplorer, &synthesise(&scene), 1, "locked");
}

#[test]
fn the_real_spinning_dot() {
    let Some(folder) = recordings("real") else { return };
    let dot = load(&folder.join("spinning-dot.evt2.raw")).expect("a recording");
    // Its middle, moved to where the camera's pixels are.
    let half = |wide: u16, narrow: u16| wide.saturating_sub(narrow) / 2;
    let (left, top) = (
        half(dot.geometry.width_px, DAVIS346.width_px),
        half(dot.geometry.height_px, DAVIS346.height_px),
    );
    let events = dot.events.iter().filter_map(|event| {
        let (x, y) = (event.x.checked_sub(left)?, event.y.checked_sub(top)?);
        DAVIS346.contains(x, y).then_some(Event { x, y, ..*event })
    });
    let sees = Loaded { geometry: DAVIS346, events: from_zero(events.collect()) };
    let (readings, _) = measure(&sees, Capacity::Device);
    let Some(first) = readings.first() else {
        show(
            "skipped: the part of the spinning dot that a DAVIS346 would see is too short for a reading",
        );
        return;
    };
    let (rotors, status) = (first.rotors.len(), first.status.as_str());
    assert_reads_as_the_pc(Camera::Davis346, &sees, rotors, status);
}

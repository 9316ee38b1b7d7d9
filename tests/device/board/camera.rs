//! What a camera at the port sees, read by the device: the PC's readings to the bit, and the PC's screen to the pixel.

use evtach_core::decode::{Dvxplorer, Mounting};
use evtach_core::{Event, Geometry, Reading, Settings};
use evtach_firmware::instrument::{Instrument, Picture, Preferences, Sensor, Traffic};
use evtach_firmware::sensor::usb::emulated::DvxplorerWords;
use evtach_host::measure::{Capacity, ReadingRow, drain, measure_events, with_tachometer};
use evtach_host::synth::{Rotor, Scene};
use evtach_tests::{Loaded, load, recordings, show};

use super::boot::{differing, drawn};
use super::rig::{Board, Camera};
use super::{DAVIS346, DVXPLORER, from_zero, one_rotor, synthesise};

/// Seconds that a first reading may take.
const PATIENCE_S: f64 = 8.0;

/// Length of a window that nobody asks for.
const WINDOW_US: u64 = 150_000;

/// A window so long that its reading still tells of the present when a search has found the rotor: for two seconds.
const SECOND: Option<u32> = Some(1000);

/// What goes on behind the first window, in microseconds: enough to end it, and over before it is measured, so that nothing
/// depends on how long that takes.
const BEHIND_US: u64 = 2_000;

/// What the PC makes of what a camera sends.
struct Twin {
    readings: Vec<Reading>,
    /// The instrument, behind the last reading and the last event.
    instrument: Instrument,
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
    let mut decoder = Dvxplorer::new(Mounting::default());
    for word in said {
        decoder.decode(word, |event| events.push(event));
    }
    Loaded { events, geometry: sees.geometry }
}

impl Twin {
    /// Sees what the camera sends of this, measures it, and hears nothing more for so long.
    fn new(camera: Camera, sees: &Loaded, window_us: Option<u32>, silent_us: u64) -> Self {
        let sent = as_sent(camera, sees);
        let settings = Settings { window_us, ..Settings::new(sent.geometry) };
        let lasts_us = sent.events.last().map_or(0, |event| event.t_us);
        let mut instrument = Instrument::new(Preferences::default());
        instrument.set_sensor(Sensor::Present);
        let traffic = Traffic { events: sent.events.len() as u64, lost: 0 };
        instrument.tick(lasts_us, traffic);
        let mut readings = Vec::new();
        with_tachometer(settings, Capacity::Device, |tachometer| {
            tachometer.push(&sent.events);
            drain(tachometer, |reading| readings.push(reading));
            let mut picture = Picture::EMPTY;
            picture.take(tachometer.heat());
            instrument.show_picture(&picture);
        });
        readings.iter().for_each(|reading| instrument.observe(reading));
        instrument.tick(lasts_us + silent_us, traffic);
        let (measured, _) = measure_events(&sent.events, &[], settings, Capacity::Device);
        let row = |reading: &Reading| ReadingRow::new(reading, 0);
        assert_eq!(
            readings.first().map(row),
            measured.first().map(row),
            "as `evtach measure` has it"
        );
        Self { readings, instrument }
    }
}

/// The device reads of these events what `evtach measure --capacity device` reads, to the last digit (both write an f32 with
/// the fewest digits that give it again), and its panel shows what the PC draws, to the last pixel.
fn assert_reads_and_shows_as_the_pc(
    camera: Camera,
    mut sees: Loaded,
    window_ms: Option<u32>,
    wanted: Option<(usize, &str)>,
) {
    let Some(mut board) = Board::switch_on() else { return };
    let window_us = window_ms.map(|ms| ms * 1000);
    let until_us = window_us.map_or(WINDOW_US, u64::from) + BEHIND_US;
    assert!(sees.events.last().is_some_and(|last| last.t_us >= until_us - BEHIND_US), "too short");
    sees.events.retain(|event| event.t_us < until_us);
    // For longer than a rate is told over; a refusal of what ended so early gives way to the silence before it is drawn.
    let silent_us = if wanted.is_some() { 300_000 } else { 1_500_000 };
    let twin = Twin::new(camera, &sees, window_us, silent_us);
    let [reading] = &twin.readings[..] else { unreachable!("{:#?}", twin.readings) };
    let found = (reading.rotors.len(), reading.status.as_str());
    assert_eq!(wanted.unwrap_or(found), found, "{reading:?}");

    board.run(0.5);
    if let Some(ms) = window_ms {
        board.query(&format!("WIND {ms} MS;WIND?"));
    }
    board.serial("SYST:LOG ON");
    board.plug_camera(camera, &sees);
    let shown = drawn(&twin.instrument);
    let (mut said, mut wrong, mut took_s) = (String::new(), usize::MAX, 0.0);
    while (wrong > 0 || !said.contains('\n')) && took_s < PATIENCE_S {
        board.run(0.05);
        took_s += 0.05;
        let before = said.len();
        said.push_str(&board.read());
        if before == 0 && !said.is_empty() {
            let report = board.report();
            let spent = report["instructions"]["UART7"].as_f64().unwrap_or(0.0) * 1e-6;
            let (found, window_s) = (reading.rotors.len(), f64::from(reading.window_us) * 1e-6);
            show(&format!(
                "{found} rotors, window of {window_s:.3} s: told {took_s:.2} s after the plug, measured in {spent:.0} M instructions"
            ));
        }
        if said.contains('\n') {
            wrong = wrong.min(differing(&board.lcd(), &shown));
        }
    }
    let seen = board.camera();
    assert_eq!((&seen["filtered"], &seen["dropped"]), (&0.into(), &0.into()), "{seen}");
    let line = said.lines().next().unwrap_or_default();
    let device: ReadingRow = serde_json::from_str(line)
        .unwrap_or_else(|error| unreachable!("{said:?}: {error}; {seen}"));
    let fate = board.query("SYST:EVEN?");
    assert_eq!(fate, format!("{},0,0,0,0", sees.events.len()), "none was left out");
    assert_eq!(device, ReadingRow::new(reading, reading.t_us));
    if wrong > 0 {
        let folder = std::env::temp_dir();
        for (frame, name) in [(board.lcd(), "device.png"), (shown, "pc.png")] {
            frame.write_png(&folder.join(name)).expect("a file");
        }
    }
    assert_eq!(
        wrong, 0,
        "pixels that differ from the PC's, see device.png and pc.png in the folder for what is temporary"
    );
    board.assert_sound();
}

/// A hand holds the camera, and its gyro is off by as much as gyros are: after some seconds the speed is that in the room.
#[test]
fn a_gyro_tells_the_speed_in_the_room_once_its_offset_is_found() {
    const OFFSET_RAD_S: f64 = 0.02;
    const ROLL_RAD_S: f64 = 0.3;
    const RPM: f64 = 600.0;
    const RPM_PER_RAD_S: f64 = 30.0 / std::f64::consts::PI;
    for (camera, pixels) in [(Camera::Davis346, DAVIS346), (Camera::Dvxplorer, DVXPLORER)] {
        let Some(mut board) = Board::switch_on() else { return };
        let (x_px, y_px) = (f64::from(pixels.width_px) / 2.0, f64::from(pixels.height_px) / 2.0);
        let rotor = Rotor { rpm: RPM, radius_px: 22.0, x_px, y_px, ..Rotor::default() };
        let mut scene = Scene {
            width_px: pixels.width_px,
            height_px: pixels.height_px,
            rotors: vec![rotor],
            duration_ms: 13_500.0,
            ..Scene::default()
        };
        scene.sensor.noise_hz = 0.0;
        // A hand that shifts the picture, and does not turn it: all that the gyro tells is its offset.
        scene.camera.tremor_px = 3.0;
        board.run(0.5);
        board.serial("SYST:LOG ON");
        board.break_(&format!("roll {OFFSET_RAD_S}"));
        board.plug_camera(camera, &synthesise(&scene));
        // How far off, sigma, and relative to what.
        let told = |board: &mut Board, seconds: usize| {
            let mut said = String::new();
            for _ in 0..4 * seconds {
                board.run(0.25);
                said.push_str(&board.read());
            }
            let rows = said.lines().filter_map(|line| serde_json::from_str(line).ok());
            let of = |row: ReadingRow| {
                let rotor = row.rotors.first()?.clone();
                Some((rotor.rpm? - RPM, rotor.rpm_sigma?, rotor.frame?.into_owned()))
            };
            rows.filter_map(of).collect::<Vec<_>>()
        };
        let held = told(&mut board, 11);
        let [first, .., last] = &held[..] else { unreachable!("{camera:?}: {held:?}") };
        show(&format!("{camera:?}: first {first:?}, after eleven seconds {last:?}"));
        assert_eq!((&*first.2, &*last.2), ("camera", "room"), "{camera:?}");
        for (off, sigma, frame) in &held {
            assert!(off.abs() < 4.0 * sigma, "{camera:?}: {off} +/- {sigma} to the {frame}");
        }
        // With the offset in it, that would be 0.19 rpm.
        let end = &held[held.len() - 20..];
        let off = end.iter().map(|(off, ..)| off).sum::<f64>() / end.len() as f64;
        assert!(off.abs() < 0.5 * OFFSET_RAD_S * RPM_PER_RAD_S, "{camera:?}: {off}");
        // Now it says that the camera turns, clockwise in the picture as the rotor does: so that turns more slowly in the room.
        board.break_(&format!("roll {}", OFFSET_RAD_S + ROLL_RAD_S));
        let turned = told(&mut board, 2);
        // The windows of the last half second lie behind the change, whatever is searched for meanwhile; some of it is taken for
        // the gyro's offset by then.
        let end = &turned[turned.len().saturating_sub(5)..];
        let off = end.iter().map(|(off, ..)| off).sum::<f64>() / end.len() as f64;
        let turns = ROLL_RAD_S * RPM_PER_RAD_S;
        assert!((off + turns).abs() < 0.25 * turns, "{camera:?}: {off}: {turned:?}");
        board.assert_sound();
    }
}

#[test]
fn one_rotor_before_a_davis346() {
    assert_reads_and_shows_as_the_pc(
        Camera::Davis346,
        one_rotor(400.0, 1010.0),
        SECOND,
        Some((1, "locked")),
    );
}

/// A scene as a DVXplorer has it in view, quiet enough that nothing is left out.
fn before_a_dvxplorer(mut scene: Scene) -> Loaded {
    scene.sensor.noise_hz = 0.05;
    synthesise(&Scene { width_px: DVXPLORER.width_px, height_px: DVXPLORER.height_px, ..scene })
}

fn four() -> Scene {
    let at =
        |x_px, y_px, rpm| Rotor { x_px, y_px, rpm, radius_px: 16.0, blades: 2, ..Rotor::default() };
    let rotors = vec![
        at(90.0, 70.0, 350.0),
        at(250.0, 70.0, -380.0),
        at(90.0, 190.0, -365.0),
        at(250.0, 190.0, 395.0),
    ];
    let mut scene = Scene { rotors, duration_ms: 2010.0, ..Scene::default() };
    scene.sensor.noise_hz = 0.2;
    scene
}

const FOUR: (Option<u32>, Option<(usize, &str)>) = (Some(2000), Some((4, "locked")));

#[test]
fn four_rotors() {
    assert_reads_and_shows_as_the_pc(Camera::Davis346, synthesise(&four()), FOUR.0, FOUR.1);
}

#[test]
fn four_rotors_before_a_dvxplorer() {
    let sees = before_a_dvxplorer(four());
    assert_reads_and_shows_as_the_pc(Camera::Dvxplorer, sees, FOUR.0, FOUR.1);
}

/// Nothing turns: noise only.
fn nothing() -> Scene {
    let mut scene = Scene { rotors: Vec::new(), duration_ms: 160.0, ..Scene::default() };
    scene.sensor.noise_hz = 3.0;
    scene
}

#[test]
fn a_refusal() {
    let refused = Some((0, "refused"));
    assert_reads_and_shows_as_the_pc(Camera::Davis346, synthesise(&nothing()), None, refused);
}

#[test]
fn a_refusal_before_a_dvxplorer() {
    let sees = before_a_dvxplorer(nothing());
    assert_reads_and_shows_as_the_pc(Camera::Dvxplorer, sees, None, Some((0, "refused")));
}

#[test]
fn one_rotor_before_a_dvxplorer() {
    let rotor = Rotor { rpm: 300.0, radius_px: 24.0, x_px: 400.0, y_px: 300.0, ..Rotor::default() };
    let scene = Scene { rotors: vec![rotor], duration_ms: 1010.0, ..Scene::default() };
    assert_reads_and_shows_as_the_pc(
        Camera::Dvxplorer,
        before_a_dvxplorer(scene),
        SECOND,
        Some((1, "locked")),
    );
}

/// Times as slow as the real dot is played: it lasts 50 ms, nine million events a second, more than a port carries.
const SLOWER: u64 = 20;

/// Most events a second that are all used.
const ALL_USED_EV_S: u64 = 150_000;

/// Where the middle of the real dot's ring is, in pixels.
const RING: (i32, i32) = (314, 202);

/// The real spinning dot in slow motion, its ring moved to the middle of the camera's pixels, and what lies beside these left out.
fn the_real_dot(pixels: Geometry) -> Option<Loaded> {
    let dot = load(&recordings("real")?.join("spinning-dot.evt2.raw")).expect("a recording");
    let (left, top) =
        (RING.0 - i32::from(pixels.width_px / 2), RING.1 - i32::from(pixels.height_px / 2));
    let events = dot.events.iter().filter_map(|event| {
        let x = u16::try_from(i32::from(event.x) - left).ok()?;
        let y = u16::try_from(i32::from(event.y) - top).ok()?;
        pixels.contains(x, y).then_some(Event { x, y, t_us: SLOWER * event.t_us, ..*event })
    });
    let events = from_zero(events.collect());
    // Every so many, as the camera's own skipping would have it.
    let lasts_us = events.last().map_or(1, |event| event.t_us.max(1));
    let per_s = events.len() as u64 * 1_000_000 / lasts_us;
    let every = usize::try_from(per_s.div_ceil(ALL_USED_EV_S)).unwrap_or(usize::MAX);
    Some(Loaded { geometry: pixels, events: events.into_iter().step_by(every).collect() })
}

/// Most of its turn, in milliseconds. That so few of its events are left, and less than a turn, the PC refuses; then so does the
/// device, and both show the silence that follows.
const DOT: Option<u32> = Some(960);

#[test]
fn the_real_spinning_dot() {
    let Some(sees) = the_real_dot(DAVIS346) else { return };
    assert_reads_and_shows_as_the_pc(Camera::Davis346, sees, DOT, None);
}

#[test]
fn the_real_spinning_dot_before_a_dvxplorer() {
    let Some(sees) = the_real_dot(DVXPLORER) else { return };
    assert_reads_and_shows_as_the_pc(Camera::Dvxplorer, sees, DOT, None);
}

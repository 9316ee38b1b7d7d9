//! What a camera at the port sees, read by the device: the PC's readings to the bit, and the PC's screen to the pixel.

use evtach_core::decode::{Davis, Dvxplorer, Mounting};
use evtach_core::{Event, Frame, GyroSample, Reading, Settings};
use evtach_firmware::instrument::{Instrument, Picture, Preferences, Sensor, Traffic};
use evtach_firmware::sensor::usb::emulated::{DavisWords, DvxplorerWords, GyroRange};
use evtach_host::measure::{Capacity, ReadingRow, drain, measure_events, with_tachometer};
use evtach_host::synth::{Rotor, Scene};
use evtach_tests::{Loaded, load, recordings, show};

use crate::board::{Board, Camera};
use crate::boot::{differing, drawn};
use crate::{DAVIS346, DVXPLORER, from_zero, one_rotor, synthesise};

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

/// What the gyro of a camera says that rolls so fast all the while, to the steps that it counts in.
fn rolling(camera: Camera, roll_rad_s: f32, lasts_us: u64) -> Vec<GyroSample> {
    let said = GyroSample { t_us: 0, roll_rad_s };
    let (mut words, mounting) = (Vec::new(), Mounting::default());
    let (every_us, heard) = match camera {
        Camera::Davis346 => {
            DavisWords::default().gyro(&said, GyroRange::davis346(1), &mut words);
            let mut decoder = Davis::new(mounting);
            (1_000, words.iter().find_map(|word| decoder.decode(*word, |_| {})))
        }
        Camera::Dvxplorer => {
            DvxplorerWords::default().gyro(&said, GyroRange::dvxplorer(2), &mut words);
            let mut decoder = Dvxplorer::new(mounting);
            (1_250, words.iter().find_map(|word| decoder.decode(*word, |_| {})))
        }
    };
    let roll_rad_s = heard.expect("a sample").roll_rad_s;
    (0..=lasts_us).step_by(every_us).map(|t_us| GyroSample { t_us, roll_rad_s }).collect()
}

impl Twin {
    /// Sees what the camera sends of this, measures it, and hears nothing more for so long.
    fn new(
        (camera, roll_rad_s): (Camera, f32),
        sees: &Loaded,
        window_us: Option<u32>,
        silent_us: u64,
    ) -> Self {
        let sent = as_sent(camera, sees);
        let settings = Settings { window_us, ..Settings::new(sent.geometry) };
        let lasts_us = sent.events.last().map_or(0, |event| event.t_us);
        let gyro = rolling(camera, roll_rad_s, lasts_us);
        let mut instrument = Instrument::new(Preferences::default());
        instrument.set_sensor(Sensor::Present);
        let traffic = Traffic { events: sent.events.len() as u64, lost: 0 };
        instrument.tick(lasts_us, traffic);
        let mut readings = Vec::new();
        with_tachometer(settings, Capacity::Device, |tachometer| {
            let mut gyro = &gyro[..];
            for stretch in sent.events.chunk_by(|a, b| a.t_us / 1000 == b.t_us / 1000) {
                let reached = gyro.partition_point(|sample| sample.t_us <= stretch[0].t_us);
                gyro[..reached].iter().for_each(|sample| tachometer.gyro(*sample));
                gyro = &gyro[reached..];
                tachometer.push(stretch);
            }
            drain(tachometer, |reading| readings.push(reading));
            let mut picture = Picture::EMPTY;
            picture.take(tachometer.heat());
            instrument.show_picture(&picture);
        });
        readings.iter().for_each(|reading| instrument.observe(reading));
        instrument.tick(lasts_us + silent_us, traffic);
        let (measured, _) = measure_events(&sent.events, &gyro, settings, Capacity::Device);
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
    sees: Loaded,
    window_ms: Option<u32>,
    wanted: Option<(usize, &str)>,
) {
    read_and_shown(camera, 0.0, sees, window_ms, wanted);
}

/// The same from a camera that rolls so fast all the while; returns the reading, where there is a board.
fn read_and_shown(
    camera: Camera,
    roll_rad_s: f32,
    mut sees: Loaded,
    window_ms: Option<u32>,
    wanted: Option<(usize, &str)>,
) -> Option<Reading> {
    let mut board = Board::switch_on()?;
    let window_us = window_ms.map(|ms| ms * 1000);
    let until_us = window_us.map_or(WINDOW_US, u64::from) + BEHIND_US;
    assert!(sees.events.last().is_some_and(|last| last.t_us >= until_us - BEHIND_US), "too short");
    sees.events.retain(|event| event.t_us < until_us);
    // For longer than a rate is told over; a refusal of what ended so early gives way to the silence before it is drawn.
    let silent_us = if wanted.is_some() { 300_000 } else { 1_500_000 };
    let twin = Twin::new((camera, roll_rad_s), &sees, window_us, silent_us);
    let [reading] = &twin.readings[..] else { unreachable!("{:#?}", twin.readings) };
    let found = (reading.rotors.len(), reading.status.as_str());
    assert_eq!(wanted.unwrap_or(found), found, "{reading:?}");

    board.run(0.5);
    if let Some(ms) = window_ms {
        board.query(&format!("WIND {ms} MS;WIND?"));
    }
    board.serial("SYST:LOG ON");
    board.break_(&format!("roll {roll_rad_s}"));
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
    Some(reading.clone())
}

#[test]
fn a_camera_that_rolls_tells_the_speed_in_the_room() {
    const ROLL_RAD_S: f32 = 0.3;
    const RPM: f64 = 600.0;
    for (camera, geometry) in [(Camera::Davis346, DAVIS346), (Camera::Dvxplorer, DVXPLORER)] {
        let (x_px, y_px) =
            (f64::from(geometry.width_px) / 2.0, f64::from(geometry.height_px) / 2.0);
        let rotor = Rotor { rpm: RPM, radius_px: 22.0, blades: 3, x_px, y_px, ..Rotor::default() };
        let mut scene = Scene {
            width_px: geometry.width_px,
            height_px: geometry.height_px,
            rotors: vec![rotor],
            duration_ms: 510.0,
            ..Scene::default()
        };
        // A quick search: the reading is told before the silence behind the window is.
        scene.sensor.noise_hz = 0.0;
        scene.camera.roll_rad_s = ROLL_RAD_S.into();
        // The hand that rolls it moves it as well, so that the gyro is the better witness.
        scene.camera.drift_px_s = [30.0, -10.0];
        let sees = synthesise(&scene);
        let wanted = Some((1, "locked"));
        let Some(reading) = read_and_shown(camera, ROLL_RAD_S, sees, Some(500), wanted) else {
            return;
        };
        let speed = reading.rotors.first().and_then(|rotor| rotor.speed).expect("a speed");
        assert_eq!(speed.frame, Frame::Room, "{camera:?}");
        // The roll is 2.9 rpm.
        assert!((f64::from(speed.rpm()) - RPM).abs() < 0.3, "{camera:?}: {reading:?}");
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
    let events = from_zero(events.collect());
    // Nine million events a second, more than the port carries: every so many, as the camera's own skipping would have it.
    let per_s =
        events.len() as u64 * 1_000_000 / events.last().map_or(1, |event| event.t_us.max(1));
    let every = usize::try_from(per_s.div_ceil(300_000)).unwrap_or(usize::MAX);
    let sees = Loaded { geometry: DAVIS346, events: events.into_iter().step_by(every).collect() };
    // It lasts 50 ms, less than a turn, of which so few events are left that the PC may refuse it; then so does the device.
    assert_reads_and_shows_as_the_pc(Camera::Davis346, sees, Some(40), None);
}

//! The instrument in QEMU: what a person sees on its screen and reads over its serial port, also when it fails.

use std::time::{Duration, Instant};

use embedded_graphics::pixelcolor::IntoStorage as _;
use evtach_core::limits::DEVICE_HEAT_CELLS;
use evtach_core::rotors::HeatMap;
use evtach_core::{Event, Geometry, Poll, Settings};
use evtach_firmware::instrument::{Fault, Instrument, Picture, Preferences, Sensor, Traffic};
use evtach_firmware::intake::BLOCK_EVENTS;
use evtach_firmware::sensor::spi::{Bridge, Kind, Parser, Words};
use evtach_firmware::ui::Screen;
use evtach_host::device::{self, Session};
use evtach_host::frame::Frame;
use evtach_host::measure::{Capacity, with_tachometer};
use evtach_host::synth::{self, Rotor, Scene};
use evtach_tests::{Loaded, load};

use super::compare;

fn stream(Loaded { geometry, events }: &Loaded) -> Vec<u8> {
    let mut bridge = Bridge::new(Kind::Evt2, *geometry, "bridge");
    let mut stream = Vec::new();
    for event in events {
        bridge.push(event, |frame| stream.extend_from_slice(frame));
    }
    bridge.end(|frame| stream.extend_from_slice(frame));
    stream
}

fn synthesise(scene: &Scene) -> Loaded {
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    Loaded { geometry, events: synth::generate(scene).expect("a scene in range").events }
}

/// Pixels as the device hands them out.
fn bytes(frame: &Frame) -> Vec<u8> {
    frame.pixels().iter().flat_map(|pixel| pixel.into_storage().to_le_bytes()).collect()
}

/// The events of each frame of a stream.
fn frames(stream: &[u8]) -> Vec<Vec<Event>> {
    let (mut parser, mut frames) = (Parser::new(), Vec::new());
    for piece in stream.chunks(1000) {
        parser.space()[..piece.len()].copy_from_slice(piece);
        parser.filled(piece.len());
        while let Some(frame) = parser.next_frame() {
            let mut events = Vec::new();
            Words::new(&frame).decode(usize::MAX, |event| events.push(event));
            frames.push(events);
        }
    }
    frames
}

/// The screen after the last reading, drawn after each as the device does on the bench.
fn draw(geometry: Geometry, frames: &[Vec<Event>]) -> (Frame, usize) {
    let (mut frame, mut screen, mut picture) = (Frame::default(), Screen::new(), Picture::EMPTY);
    let mut instrument = Instrument::new(Preferences::default());
    instrument.set_sensor(Sensor::Present);
    let (mut traffic, mut readings) = (Traffic::default(), 0);
    with_tachometer(Settings::new(geometry), Capacity::Device, |tachometer| {
        let mut drain = |tachometer: &mut evtach_core::Tachometer<'_>| loop {
            match tachometer.poll(u32::MAX) {
                Poll::Idle => return,
                Poll::Pending => {}
                Poll::Ready(reading) => {
                    traffic.events += reading.events;
                    traffic.lost += reading.lost;
                    instrument.observe(&reading);
                    instrument.tick(reading.t_us + u64::from(reading.window_us / 2), traffic);
                    picture.take(tachometer.heat());
                    instrument.show_picture(&picture);
                    let Ok(()) = screen.draw(&mut frame, &instrument);
                    readings += 1;
                }
            }
        };
        // In the blocks in which they reach the device's measurement: an event beyond the window is in the picture.
        for frame in frames {
            for block in frame.chunks(BLOCK_EVENTS) {
                tachometer.push(block);
                drain(tachometer);
            }
        }
        tachometer.finish();
        drain(tachometer);
    });
    (frame, readings)
}

#[test]
fn screens_equal_the_pcs_pixel_for_pixel() {
    if !compare::qemu_present() {
        return;
    }
    let image = device::build().expect("the firmware builds");
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../demo/fan.raw");
    let rotor = |x_px, rpm| Rotor { x_px, rpm, radius_px: 40.0, ..Rotor::default() };
    let rotors = vec![rotor(90.0, 3000.0), rotor(255.0, -4100.0)];
    let two = synthesise(&Scene { rotors, duration_ms: 250.0, ..Scene::default() });
    for (name, loaded) in [("demo", load(demo.as_ref()).expect("the demo")), ("two rotors", two)] {
        let stream = stream(&loaded);
        let (output, pixels) = device::run_screen(&image, &stream).expect("the firmware runs");
        let (frame, readings) = draw(loaded.geometry, &frames(&stream));
        assert_eq!(output.readings.len(), readings, "{name}");
        let here = bytes(&frame);
        let differing = here.iter().zip(&pixels).filter(|(here, there)| here != there).count();
        assert_eq!((here.len(), differing), (pixels.len(), 0), "{name}: bytes that differ");
        let lit = here.iter().filter(|&&byte| byte != 0).count();
        assert!(lit > 10_000, "{name}: only {lit} bytes are not black");
    }
}

/// Asks until the answer is as wanted; panics with the last one after 60 s. A question that a restart swallowed is
/// asked again.
fn wait_for(session: &mut Session, query: &str, wanted: impl Fn(&str) -> bool) -> String {
    let start = Instant::now();
    let mut last = String::new();
    while start.elapsed() < Duration::from_secs(60) {
        last = session.query(query).unwrap_or_else(|error| {
            session.clear().expect("a port");
            error.to_string()
        });
        if wanted(&last) {
            return last;
        }
    }
    assert!(wanted(&last), "{query} is still answered {last}");
    last
}

/// The screen that shows a fault with no sensor, as the PC draws it.
fn fault_screen(fault: Fault) -> Vec<u8> {
    let mut instrument = Instrument::new(Preferences::default());
    instrument.fail(fault);
    // The picture of a sensor that has sent nothing, which the measurement hands out before the first event.
    let (mut counts, mut picture) = ([0; DEVICE_HEAT_CELLS], Picture::EMPTY);
    picture.take(&HeatMap::new(&mut counts, Geometry { width_px: 320, height_px: 320 }));
    instrument.show_picture(&picture);
    let mut frame = Frame::default();
    let Ok(()) = Screen::new().draw(&mut frame, &instrument);
    bytes(&frame)
}

/// Lets a fault happen and returns what the device says of it once it has started again.
fn fault(words: &[&str], fault: Fault) -> Option<(Session, String)> {
    if !compare::qemu_present() {
        return None;
    }
    let image = device::build().expect("the firmware builds");
    let mut session = Session::start(&image, None, words).expect("the firmware runs");
    let said = wait_for(&mut session, "SYST:FAULT?", |answer| {
        answer.contains('"') && !answer.contains("none")
    });
    assert_eq!(session.query("FETC:REAS?").expect("an answer"), "\"fault\"");
    assert!(session.query("FETC?").expect("an answer").starts_with("9.91"));
    // The screen is drawn four times a second.
    let drawn = fault_screen(fault);
    let start = Instant::now();
    while session.query_block("HCOP:SDUM:DATA?").expect("the screen") != drawn {
        let waits = start.elapsed() < Duration::from_secs(60);
        assert!(waits, "{words:?}: another screen, and {:?}", session.query("SYST:FAULT?"));
    }
    Some((session, said))
}

#[test]
fn a_panic_in_any_task_is_shown_after_the_restart() {
    for task in ["acquire", "measure", "show", "link"] {
        let injected = format!("panic:{task}");
        let Some((mut session, said)) = fault(&[&injected], Fault::Panic) else { return };
        assert!(said.starts_with("\"panic\"") && said.contains(task), "{said}");
        // Told once: acknowledged, the device goes on, and says what is wrong now.
        session.write("SYST:FAULT:CLE").expect("a port");
        wait_for(&mut session, "FETC:REAS?", |answer| answer == "\"no_sensor\"");
    }
}

#[test]
fn a_task_that_hangs_is_caught_by_the_watchdog() {
    for (task, words) in [("measure", ""), ("show", "")] {
        let injected = format!("hang:{task}");
        let Some((_, said)) = fault(&[&injected], Fault::Watchdog) else { return };
        assert!(said.starts_with("\"watchdog\"") && said.contains(words), "{said}");
    }
}

#[test]
fn damaged_settings_are_told_and_the_defaults_stand() {
    let Some((mut session, said)) = fault(&["preferences"], Fault::Preferences) else { return };
    assert!(said.starts_with("\"preferences\""), "{said}");
    assert_eq!(session.query("UNIT?").expect("an answer"), "RPM");
}

#[test]
fn power_that_goes_while_settings_are_written_leaves_the_old_ones() {
    if !compare::qemu_present() {
        return;
    }
    let image = device::build().expect("the firmware builds");
    let mut session = Session::start(&image, None, &["power"]).expect("the firmware runs");
    // Until the write, at most half a second later, the new unit stands; the reset brings back the old.
    assert_eq!(session.query("UNIT HZ;UNIT?").expect("an answer"), "HZ");
    wait_for(&mut session, "UNIT?", |answer| answer == "RPM");
    assert!(session.query("SYST:FAULT?").expect("an answer").contains("none"));
    // And now with power.
    session.write("UNIT HZ").expect("a port");
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(session.query("UNIT?").expect("an answer"), "HZ");
}

/// The words at the left of the top strip, and how wide they are: the part of it that tells nothing but mode and state.
fn state_words(screen: &[u8], width_px: Option<usize>) -> (Vec<u8>, usize) {
    const ROW_BYTES: usize = 2 * 480;
    /// Rows of the strip, and where its bar of the event rate begins, in pixels.
    const STRIP: (usize, usize) = (28, 250);
    let rows = || screen.chunks(ROW_BYTES).take(STRIP.0).map(|row| &row[..2 * STRIP.1]);
    let drawn =
        |row: &[u8]| row.chunks(2).rposition(|pixel| pixel != &screen[..2]).unwrap_or(0) + 1;
    let width_px = width_px.unwrap_or_else(|| rows().map(drawn).max().unwrap_or(0));
    (rows().flat_map(|row| row[..2 * width_px].to_vec()).collect(), width_px)
}

#[test]
fn a_channel_that_is_full_is_saturation_on_screen_and_link() {
    if !compare::qemu_present() {
        return;
    }
    let rotor = Rotor { rpm: 2400.0, radius_px: 20.0, blades: 2, ..Rotor::default() };
    let loaded =
        synthesise(&Scene { rotors: vec![rotor], duration_ms: 8_000.0, ..Scene::default() });
    let image = device::build().expect("the firmware builds");
    let mut session =
        Session::start(&image, Some(&stream(&loaded)), &["full"]).expect("the firmware runs");
    wait_for(&mut session, "FETC:REAS?", |answer| answer == "\"saturated\"");
    assert!(session.query("FETC?").expect("an answer").starts_with("9.91"));
    // Neither restarted nor hung: no fault, and the sensor is still read.
    assert!(session.query("SYST:FAULT?").expect("an answer").contains("none"));

    let mut instrument = Instrument::new(Preferences::default());
    instrument.set_sensor(Sensor::Present);
    instrument.tick(0, Traffic { events: 1, lost: 0 });
    instrument.tick(200_000, Traffic { events: 1, lost: 100_000 });
    let mut frame = Frame::default();
    let Ok(()) = Screen::new().draw(&mut frame, &instrument);
    let (wanted, width_px) = state_words(&bytes(&frame), None);
    assert!((60..250).contains(&width_px), "{width_px}");
    let shown = |session: &mut Session| {
        let screen = session.query_block("HCOP:SDUM:DATA?").expect("the screen");
        state_words(&screen, Some(width_px)).0
    };
    // The recording goes on for six seconds of the device's time, however long these take us; the screen is drawn four times in each. In a
    // moment in which a busy PC lets fewer events be lost the device may search, so not the first look has to tell.
    while shown(&mut session) != wanted {
        let said = session.query("FETC:REAS?").expect("an answer");
        assert_ne!(
            said, "\"no_sensor\"",
            "the recording went by, and saturation was never on the screen"
        );
    }
}

#[test]
fn a_speed_is_read_live_until_the_sensor_goes() {
    if !compare::qemu_present() {
        return;
    }
    let rotor = Rotor { rpm: 2400.0, radius_px: 20.0, blades: 2, ..Rotor::default() };
    let loaded =
        synthesise(&Scene { rotors: vec![rotor], duration_ms: 3000.0, ..Scene::default() });
    println!("{} events in 3 s", loaded.events.len());
    let image = device::build().expect("the firmware builds");
    let mut session =
        Session::start(&image, Some(&stream(&loaded)), &[]).expect("the firmware runs");
    let answer = wait_for(&mut session, "MEAS?", |answer| !answer.starts_with("9.91"));
    let rpm: f64 = answer.parse().expect("a number");
    assert!((rpm / 2400.0 - 1.0).abs() < 0.01, "{answer}");
    assert_eq!(session.query("FETC:DIR?").expect("an answer"), "CW");
    wait_for(&mut session, "FETC:REAS?", |answer| answer == "\"no_sensor\"");
    assert!(session.query("FETC?").expect("an answer").starts_with("9.91"));
}

//! Events that come to the device through its SPI controller are those that went out on the other side: the same
//! readings as on the PC, to the last bit, and no event unaccounted for.

use evtach_core::{Event, Geometry, Polarity};
use evtach_firmware::sensor::spi::{Bridge, Kind};
use evtach_host::device::{self, Acquired, Output, Pace};
use evtach_host::synth::scene::Lamp;
use evtach_host::synth::{self, Rotor, Scene};
use evtach_tests::{Loaded, load, recordings};

use super::compare;

/// The frames in which a bridge sends events.
fn frames(kind: Kind, geometry: Geometry, events: &[Event]) -> Vec<Vec<u8>> {
    let mut bridge = Bridge::new(kind, geometry, "bridge");
    let mut frames = Vec::new();
    for event in events {
        bridge.push(event, |frame| frames.push(frame.to_vec()));
    }
    bridge.end(|frame| frames.push(frame.to_vec()));
    frames
}

/// Lets the device read a stream; `None` without QEMU.
fn read_over_spi(stream: &[u8], pace: Pace) -> Option<(Output, Acquired)> {
    if !compare::qemu_present() {
        return None;
    }
    let image = device::build().expect("the firmware builds");
    let output = device::run_spi(&image, stream, pace).expect("the firmware runs");
    let acquired = output.acquired.expect("the line about acquisition");
    Some((output, acquired))
}

/// Sends events over SPI, and compares the readings with the PC's.
fn compare_over_spi(name: &str, kind: Kind, Loaded { geometry, events }: &Loaded) {
    let stream = frames(kind, *geometry, events).concat();
    let Some((output, acquired)) = read_over_spi(&stream, Pace::File) else { return };
    let whole = Acquired {
        sent: events.len() as u64,
        received: events.len() as u64,
        thinned: 0,
        overrun: 0,
        bridge: 0,
        damaged: 0,
        missing: 0,
        undecoded: 0,
    };
    assert_eq!(acquired, whole, "{name}");
    assert_eq!(output.events, whole.sent, "{name}");
    compare::assert_equal(name, *geometry, events, &output);
}

fn synthesise(scene: &Scene) -> Loaded {
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    Loaded { geometry, events: synth::generate(scene).expect("a scene in range").events }
}

fn rotor(x_px: f64, blades: u8, rpm: f64) -> Rotor {
    Rotor { x_px, blades, rpm, ..Rotor::default() }
}

fn scene(rotors: Vec<Rotor>) -> Scene {
    Scene { rotors, ..Scene::default() }
}

#[test]
fn rotors() {
    for (name, kind, scene) in [
        ("fan over EVT 2", Kind::Evt2, scene(vec![rotor(173.0, 5, 1180.0)])),
        ("propeller over EVT 3", Kind::Evt3, scene(vec![rotor(173.0, 2, -9000.0)])),
    ] {
        compare_over_spi(name, kind, &synthesise(&scene));
    }
}

#[test]
fn two_rotors_and_a_single_blade() {
    let two = [(90.0, 3, 3000.0), (255.0, 2, -4100.0)]
        .map(|(x_px, blades, rpm)| Rotor { radius_px: 40.0, ..rotor(x_px, blades, rpm) });
    for (name, kind, scene) in [
        ("two rotors over EVT 2", Kind::Evt2, scene(two.into())),
        ("a single blade over EVT 3", Kind::Evt3, scene(vec![rotor(173.0, 1, 5200.0)])),
    ] {
        compare_over_spi(name, kind, &synthesise(&scene));
    }
}

#[test]
fn nothing_that_turns() {
    let lamp = Lamp { spot_px: Some([173.0, 130.0, 30.0]), ..Lamp::default() };
    let lamp = Scene { lamp: Some(lamp), ..scene(vec![]) };
    compare_over_spi("a lamp over EVT 2", Kind::Evt2, &synthesise(&lamp));
}

#[test]
fn the_recording_in_the_tree() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../demo/fan.raw");
    compare_over_spi("demo/fan.raw", Kind::Evt2, &load(path.as_ref()).expect("the demo recording"));
}

#[test]
fn real_recordings() {
    let Some(folder) = recordings("real") else { return };
    for (name, kind) in [
        ("spinning-dot.evt2.raw", Kind::Evt2),
        ("street.evt3.raw", Kind::Evt3),
        ("person.aedat4", Kind::Evt2),
        ("lamp-100hz.davis346.aedat4", Kind::Evt3),
        ("dvs128.aedat2.aedat", Kind::Evt2),
        ("dvs.es", Kind::Evt3),
    ] {
        compare_over_spi(name, kind, &load(&folder.join(name)).expect("a known recording"));
    }
}

/// Events all over the sensor, one a microsecond: 1 Mev/s.
fn storm(count: u64) -> Loaded {
    let mut state = 1_u32;
    let events = (0..count)
        .map(|t_us| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            Event {
                t_us,
                x: (state >> 8) as u16 % 320,
                y: (state >> 17) as u16 % 320,
                polarity: if state >> 31 == 0 { Polarity::Off } else { Polarity::On },
            }
        })
        .collect();
    Loaded { geometry: Geometry { width_px: 320, height_px: 320 }, events }
}

/// The same stream at the rate at which it was sent, every hundredth frame damaged: what does not reach the
/// measurement is known by its cause.
#[test]
fn accounting_closes_over_damaged_frames_at_1_mev_s() {
    let sent = storm(1_000_000);
    let mut frames = frames(Kind::Evt2, sent.geometry, &sent.events);
    let last = frames.len() - 1;
    for frame in frames[1..last].iter_mut().step_by(100) {
        let middle = frame.len() / 2;
        frame[middle] ^= 0x40;
    }
    let Some((output, acquired)) = read_over_spi(&frames.concat(), Pace::Sensor) else { return };
    println!("{acquired:?}, {} measured, {} overrun", output.events, output.overrun);
    let Acquired { received, thinned, overrun, bridge, damaged, missing, undecoded, .. } = acquired;
    assert_eq!(acquired.sent, sent.events.len() as u64);
    assert_eq!(acquired.sent, received + bridge + damaged + missing + undecoded);
    assert_eq!(received, output.events + thinned + overrun);
    assert!((8_000..12_000).contains(&damaged), "{damaged} events in damaged frames");
    assert_eq!((bridge, missing, undecoded), (0, 0, 0));
}

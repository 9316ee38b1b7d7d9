//! Stock PyVISA at the instrument's emulated serial port, while events come over its emulated SPI bus.

use std::time::{Duration, Instant};

use evtach_core::Geometry;
use evtach_firmware::sensor::spi::{Bridge, Kind};
use evtach_host::device::{self, Plugged};
use evtach_host::synth::{self, Rotor, Scene};
use evtach_tests::visa;

use super::compare;

/// Longest session that is not taken for a hang.
const PATIENCE: Duration = Duration::from_secs(300);

/// Few events a second, so that the flash that stands in for the bridge holds the whole session.
fn stream() -> Vec<u8> {
    let (x_px, y_px) = (64.0, 64.0);
    let rotor = Rotor {
        x_px,
        y_px,
        blades: 5,
        rpm: -1500.0,
        radius_px: 20.0,
        contrast: 0.4,
        ..Rotor::default()
    };
    let rotors = vec![rotor];
    let scene =
        Scene { width_px: 128, height_px: 128, duration_ms: 22_000.0, rotors, ..Scene::default() };
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let mut bridge = Bridge::new(Kind::Evt2, geometry, "bridge");
    let mut stream = Vec::new();
    for event in &synth::generate(&scene).expect("a scene in range").events {
        bridge.push(event, |frame| stream.extend_from_slice(frame));
    }
    bridge.end(|frame| stream.extend_from_slice(frame));
    stream
}

#[test]
fn a_session_with_the_device() {
    if !compare::qemu_present() {
        return;
    }
    let Some(python) = visa::python() else { return };
    let image = device::build().expect("the firmware builds");
    let stream = stream();
    println!("{} bytes in the flash", stream.len());
    let device = Plugged::start(&image, &stream).expect("the firmware runs");
    let file = visa::out("device");
    let start = Instant::now();
    let mut client = visa::session(&python, &device.port, &file);
    while client.try_wait().expect("a child").is_none() {
        let late = start.elapsed() > PATIENCE;
        if late {
            client.kill().expect("a child");
        }
        assert!(!late, "the session hangs");
        std::thread::sleep(Duration::from_millis(20));
    }
    println!("{:.1} s", start.elapsed().as_secs_f64());
    visa::check(client, &file, env!("CARGO_PKG_VERSION"));
    std::fs::remove_file(&file).expect("the recording");
}

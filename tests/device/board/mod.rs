//! The image that a user flashes, on an emulated STM32F746G-DISCO: each test reads like a person using the device.

mod boot;
mod camera;
mod faults;
mod flood;
mod minute;
mod replay;
mod rig;
mod walk;

use evtach_core::{Event, Geometry};
use evtach_host::synth::{self, Rotor, Scene};
use evtach_tests::Loaded;

/// Pixels of a DAVIS346.
const DAVIS346: Geometry = Geometry { width_px: 346, height_px: 260 };

/// Pixels of a DVXplorer.
const DVXPLORER: Geometry = Geometry { width_px: 640, height_px: 480 };

fn synthesise(scene: &Scene) -> Loaded {
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    Loaded { geometry, events: from_zero(synth::generate(scene).expect("a scene in range").events) }
}

/// The camera's clock begins with the first event.
fn from_zero(mut events: Vec<Event>) -> Vec<Event> {
    let first_us = events.first().map_or(0, |event| event.t_us);
    for event in &mut events {
        event.t_us -= first_us;
    }
    events
}

/// A rotor that a person would point the device at; so many events a second that none is left out.
fn one_rotor(rpm: f64, duration_ms: f64) -> Loaded {
    let rotor =
        Rotor { rpm, radius_px: 20.0, blades: 3, x_px: 180.0, y_px: 120.0, ..Rotor::default() };
    synthesise(&Scene { rotors: vec![rotor], duration_ms, ..Scene::default() })
}

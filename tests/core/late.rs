//! A window grows when the one before has been measured. When that is depends on how busy the device is, and with it which events
//! are kept: the speed does not.

use evtach_core::{Event, Geometry, PackedEvent, Poll, Reading, Settings, Status};
use evtach_host::measure::{Capacity, with_tachometer};
use evtach_host::synth::{Rotor, Scene, generate};

/// Time between two polls.
const PIECE_US: u64 = 500;

/// What is read where the device takes so many steps in each half millisecond. None counts as all that there are.
fn readings(events: &[Event], settings: Settings, steps: Option<u32>) -> Vec<Reading> {
    let mut readings = Vec::new();
    with_tachometer(settings, Capacity::Device, |tachometer| {
        for piece in events.chunk_by(|a, b| a.t_us / PIECE_US == b.t_us / PIECE_US) {
            let packed: Vec<PackedEvent> = piece.iter().map(PackedEvent::pack).collect();
            tachometer.push_thinned(piece[0].t_us, &packed, 0);
            while let Poll::Ready(reading) = tachometer.poll(steps.unwrap_or(u32::MAX)) {
                readings.push(reading);
            }
        }
    });
    readings
}

#[test]
fn a_window_that_grows_late_tells_the_same_speed() {
    // Three turns take 0.9 to 1.8 s.
    for (seed, rpm, blades) in [(1, 100.0, 2), (2, -140.0, 1), (3, 200.0, 1)] {
        let rotor = Rotor { rpm, blades, ..Rotor::default() };
        let scene = Scene { rotors: vec![rotor], duration_ms: 6_000.0, seed, ..Scene::default() };
        let events = generate(&scene).expect("a scene in range").events;
        let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
        // At once; a search in some 50 ms; in 200 ms.
        for steps in [None, Some(4), Some(1)] {
            let readings = readings(&events, Settings::new(geometry), steps);
            let first = readings.iter().find(|reading| reading.status == Status::Locked);
            let first =
                first.unwrap_or_else(|| unreachable!("{rpm} rpm, {steps:?}: {readings:#?}"));
            for reading in &readings {
                for speed in reading.rotors.iter().filter_map(|rotor| rotor.speed.as_ref()) {
                    let off_rpm = f64::from(speed.rpm()) - rpm.abs();
                    let sigma_rpm = f64::from(speed.rpm_sigma());
                    assert!(
                        off_rpm.abs() < 4.0 * sigma_rpm,
                        "{rpm} rpm, {steps:?}: {off_rpm} of {sigma_rpm}"
                    );
                }
            }
            println!(
                "{rpm} rpm, {steps:?}: {} readings, first locked at {} us, window {} us",
                readings.len(),
                first.t_us,
                first.window_us
            );
        }
    }
}

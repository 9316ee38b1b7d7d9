//! Stretches in which most events were left out, and said so, do not bend a speed.

use evtach_core::{Event, Geometry, PackedEvent, Reading, Settings, Status};
use evtach_host::measure::{Capacity, drain, with_tachometer};
use evtach_host::synth::{Model, Rotor, Scene, generate};

/// How a device thins that is busy for `busy_us` out of every `period_us`: half of its blocks, 2 ms, take every event, and each 2 ms on
/// one event stands for twice as many.
fn weight_log2(t_us: u64, busy_us: u64, period_us: u64) -> u8 {
    let since_us = t_us % period_us;
    if since_us < busy_us { (since_us / 2_000).min(5) as u8 } else { 0 }
}

/// What the device measures first.
fn first_reading(events: &[Event], settings: Settings, weight_log2: impl Fn(u64) -> u8) -> Reading {
    let mut readings = Vec::new();
    let mut number = 0;
    with_tachometer(settings, Capacity::Device, |tachometer| {
        for stretch in events.chunk_by(|a, b| a.t_us / 500 == b.t_us / 500) {
            let weight_log2 = weight_log2(stretch[0].t_us);
            let mut packed = Vec::new();
            for event in stretch {
                if number % (1_u64 << weight_log2) == 0 {
                    packed.push((event.t_us, PackedEvent::pack(event)));
                }
                number += 1;
            }
            let Some((first_us, _)) = packed.first() else { continue };
            let first_us = *first_us;
            let packed: Vec<PackedEvent> = packed.into_iter().map(|(_, event)| event).collect();
            tachometer.push_thinned(first_us, &packed, weight_log2);
            drain(tachometer, |reading| readings.push(reading));
        }
    });
    readings.swap_remove(0)
}

#[test]
fn stretches_that_were_thinned_do_not_bend_a_speed() {
    for (seed, rpm, blades) in [(1, 1250.0, 3), (2, -2750.0, 2), (3, 5210.0, 5), (4, -980.0, 4)] {
        let rotor = Rotor { rpm, blades, ..Rotor::default() };
        let scene = Scene {
            rotors: vec![rotor],
            duration_ms: 190.0,
            seed,
            model: Model::Edge,
            ..Scene::default()
        };
        let events = generate(&scene).expect("a scene in range").events;
        let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
        let settings = Settings::new(geometry);
        let whole = first_reading(&events, settings, |_| 0);
        for (busy_us, period_us) in [(8_000, 30_000), (14_000, 25_000), (30_000, 41_000)] {
            let busy = |t_us| weight_log2(t_us, busy_us, period_us);
            let thinned = first_reading(&events, settings, busy);
            assert!(thinned.events.abs_diff(whole.events) < 2_000, "{} events", thinned.events);
            for reading in [&whole, &thinned] {
                assert_eq!(
                    (reading.status, reading.rotors.len()),
                    (Status::Locked, 1),
                    "{rpm} rpm"
                );
                let rotor = &reading.rotors[0];
                assert_eq!(rotor.blades, Some(blades as u8), "{rpm} rpm");
                let speed = rotor.speed.as_ref().expect("a speed");
                let off_rpm = f64::from(speed.rpm()) - rpm.abs();
                let sigma_rpm = f64::from(speed.rpm_sigma());
                println!(
                    "{rpm} rpm, busy {busy_us} of {period_us} us: off by {off_rpm:.4} +/- {sigma_rpm:.4} rpm"
                );
                assert!(off_rpm.abs() < 3.0 * sigma_rpm, "{rpm} rpm: {off_rpm} of {sigma_rpm}");
                assert!(sigma_rpm < 1e-3 * rpm.abs(), "{rpm} rpm: {sigma_rpm}");
            }
        }
    }
}

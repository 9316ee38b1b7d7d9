//! A sensor that looks only every so often, row by row, column by column or at all at once, and stamps what it finds with the time of the
//! look: what passes faster than half as often as that is told by nothing.

use evtach_core::{Event, Geometry, Settings};
use evtach_host::measure::{Capacity, measure_events};
use evtach_host::synth::{Rotor, Scene, generate};

/// Which pixels are looked at together.
#[derive(Clone, Copy, Debug)]
enum Looks {
    All,
    Rows,
    Columns,
}

/// What such a sensor makes of events, one look at each of its rows every `period_us`.
fn folded(events: &[Event], looks: Looks, period_us: u64, geometry: Geometry) -> Vec<Event> {
    let stamped = |event: &Event| {
        let later_us = match looks {
            Looks::All => 0,
            Looks::Rows => period_us * u64::from(event.y) / u64::from(geometry.height_px),
            Looks::Columns => period_us * u64::from(event.x) / u64::from(geometry.width_px),
        };
        let turn = (event.t_us + period_us - later_us) / period_us;
        Event { t_us: turn * period_us + later_us, ..*event }
    };
    let mut folded: Vec<Event> = events.iter().map(stamped).collect();
    folded.sort_by_key(|event| event.t_us);
    folded
}

fn fan(rpm: f64, blades: u8, duration_ms: f64) -> (Vec<Event>, Geometry) {
    let rotor = Rotor { rpm, blades, ..Rotor::default() };
    let scene = Scene { rotors: vec![rotor], duration_ms, seed: 5, ..Scene::default() };
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    (generate(&scene).expect("a scene in range").events, geometry)
}

/// Every speed that is told, signed.
fn speeds_rpm(events: &[Event], geometry: Geometry, capacity: Capacity) -> Vec<f32> {
    let (readings, _) = measure_events(events, &[], Settings::new(geometry), capacity);
    let speeds = readings.iter().flat_map(|reading| &reading.rotors).filter_map(|r| r.speed);
    speeds.map(|speed| speed.omega_rad_s * evtach_core::Speed::RPM_PER_RAD_S).collect()
}

#[test]
fn what_a_sensor_looks_at_too_seldom_is_not_told() {
    let mut refused = 0;
    for (rpm, blades, looks, period_us) in [
        (1300.0, 4, Looks::All, 2000),
        (900.0, 7, Looks::All, 2500),
        (1700.0, 5, Looks::All, 1300),
        (1300.0, 4, Looks::Rows, 1000),
        (900.0, 7, Looks::Rows, 700),
        (900.0, 7, Looks::Columns, 700),
    ] {
        let (events, geometry) = fan(rpm, blades, 450.0);
        let folded = folded(&events, looks, period_us, geometry);
        for capacity in Capacity::ALL {
            let told = speeds_rpm(&folded, geometry, capacity);
            let is_right = |told: &f32| (f64::from(*told) / rpm - 1.0).abs() < 0.01;
            assert!(
                told.iter().all(is_right),
                "{rpm} rpm, {looks:?} every {period_us} us, {capacity:?}: {told:?}"
            );
            refused += u32::from(told.is_empty());
        }
    }
    evtach_tests::show(&format!("looked at too seldom: {refused} of 12 told nothing"));
}

/// What a link lets through that is open for `open_us` of each `period_us`.
fn gated(events: &[Event], period_us: u64, open_us: u64) -> Vec<Event> {
    events.iter().copied().filter(|event| event.t_us % period_us < open_us).collect()
}

/// A link that lets through bursts, as one look does that lasts long: speeds as high as seven times the true one were told, locked, and as
/// low as a sixteenth.
#[test]
fn what_comes_in_bursts_is_not_told() {
    for (rpm, blades, gates) in [
        (1500.0, 3, &[(8333, 200), (5000, 170), (8200, 400), (4000, 900), (5828, 443)][..]),
        (3000.0, 3, &[(2500, 600), (2500, 500)]),
        (6000.0, 2, &[(4708, 163), (2985, 100), (6621, 296)]),
        (2400.0, 1, &[(10_226, 1020), (16_289, 781)]),
    ] {
        let (events, geometry) = fan(rpm, blades, 400.0);
        for &(period_us, open_us) in gates {
            let bursts = gated(&events, period_us, open_us);
            for capacity in Capacity::ALL {
                let told = speeds_rpm(&bursts, geometry, capacity);
                let gate = format!("{rpm} rpm, {open_us} of {period_us} us, {capacity:?}");
                assert!(told.is_empty(), "{gate}: {told:?}");
            }
        }
    }
}

/// A mark that shows in less than half of its way around comes in bursts, too, but in its own; and a link that is open for most of the time
/// leaves enough.
#[test]
fn what_comes_in_bursts_of_its_own_is_told() {
    let (events, geometry) = fan(1500.0, 1, 400.0);
    let seen_px = geometry.width_px / 2 + 10;
    let seen: Vec<Event> = events.iter().copied().filter(|event| event.x > seen_px).collect();
    let open = gated(&events, 4000, 2800);
    for events in [seen, open] {
        for capacity in Capacity::ALL {
            let told = speeds_rpm(&events, geometry, capacity);
            let is_right = |told: &f32| (told / 1500.0 - 1.0).abs() < 0.01;
            assert!(!told.is_empty() && told.iter().all(is_right), "{capacity:?}: {told:?}");
        }
    }
}

/// Nor is anything taken from what is seen when it happens, however fast it passes.
#[test]
fn what_passes_fast_is_told_where_the_sensor_looks_all_the_time() {
    let (events, geometry) = fan(60_000.0, 2, 200.0);
    for capacity in Capacity::ALL {
        let told = speeds_rpm(&events, geometry, capacity);
        assert!(!told.is_empty() && told.iter().all(|rpm| (rpm / 6e4 - 1.0).abs() < 1e-3));
    }
}

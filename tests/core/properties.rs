//! What must not change a reading does not change it, and what must does.
//!
//! Each property is tried on several rotors. Where pixels fall into the cells of a grid decides which of the events are
//! registered with each other: two readings of the same events may differ as two measurements do, by the square root of
//! two of their error bar on average.
#![allow(clippy::panic)] // A test fails by it.

use evtach_core::{
    Direction, Event, Geometry, Polarity, Poll, Reading, RotorReading, Settings, Speed,
};
use evtach_host::measure::{Capacity, drain, measure_events, summarise, with_tachometer};
use evtach_host::synth::{Model, Rotor, Scene, generate};

const WIDTH_PX: u16 = 240;
const HEIGHT_PX: u16 = 200;

/// Rotors of different speed, sense, blade count and place.
fn recordings() -> Vec<Vec<Event>> {
    let rotor = |x_px, y_px, rpm, blades| Rotor {
        x_px,
        y_px,
        rpm,
        blades,
        radius_px: 45.0,
        ..Rotor::default()
    };
    [
        (rotor(110.0, 95.0, 1430.0, 3), Model::Threshold),
        (rotor(131.0, 103.0, -2750.0, 2), Model::Edge),
        (rotor(104.0, 99.0, 5210.0, 5), Model::Edge),
        (rotor(120.0, 90.0, -980.0, 4), Model::Threshold),
    ]
    .into_iter()
    .enumerate()
    .map(|(seed, (rotor, model))| {
        let scene = Scene {
            width_px: WIDTH_PX,
            height_px: HEIGHT_PX,
            duration_ms: 180.0,
            seed: 60 + seed as u64,
            model,
            rotors: vec![rotor],
            ..Scene::default()
        };
        generate(&scene).expect("a scene in range").events
    })
    .collect()
}

/// Each recording with the memory of the PC, and with that of the device.
fn cases() -> impl Iterator<Item = (Vec<Event>, Capacity)> {
    recordings().into_iter().flat_map(|events| {
        [Capacity::Full, Capacity::Device].map(|capacity| (events.clone(), capacity))
    })
}

fn settings(width_px: u16, height_px: u16) -> Settings {
    Settings::new(Geometry::new(width_px, height_px).expect("a sensor in range"))
}

/// The one rotor of a recording, and its speed.
fn measure_in(
    events: &[Event],
    capacity: Capacity,
    width_px: u16,
    height_px: u16,
) -> (RotorReading, Speed) {
    let settings = settings(width_px, height_px);
    let (readings, _) = measure_events(events, &[], settings, capacity);
    let span_us = events[0].t_us..events[events.len() - 1].t_us;
    let summary = summarise(&readings, &span_us, settings.clock_sigma_ppm);
    let [rotor] = &summary.rotors[..] else { unreachable!("one rotor was expected: {summary:#?}") };
    (rotor.clone(), rotor.speed.expect("a speed"))
}

fn measure(events: &[Event], capacity: Capacity) -> (RotorReading, Speed) {
    measure_in(events, capacity, WIDTH_PX, HEIGHT_PX)
}

/// Both magnitudes agree within `sigmas` of the larger error bar, and blade counts are equal.
fn assert_alike(
    property: &str,
    (before, a): &(RotorReading, Speed),
    (after, b): &(RotorReading, Speed),
    sigmas: f32,
) {
    let sigma = a.rpm_sigma().max(b.rpm_sigma());
    let off = (b.rpm() - a.rpm()).abs() / sigma;
    println!("{property}: {} -> {} rpm, {off:.3} sigma of {sigma}", a.rpm(), b.rpm());
    assert!(off <= sigmas, "{property}: {a:?} became {b:?}, {off} sigma");
    assert_eq!(before.blades, after.blades, "{property}");
}

#[test]
fn a_quarter_turn_of_the_sensor_changes_nothing() {
    for (events, capacity) in cases() {
        // (x, y) -> (height - 1 - y, x): clockwise on the screen, y down.
        let turned: Vec<Event> =
            events.iter().map(|e| Event { x: HEIGHT_PX - 1 - e.y, y: e.x, ..*e }).collect();
        let (before, after) =
            (measure(&events, capacity), measure_in(&turned, capacity, HEIGHT_PX, WIDTH_PX));
        assert_alike("quarter turn", &before, &after, 2.0);
        assert_eq!(before.1.direction(), after.1.direction());
        assert!((after.0.x_px - (f32::from(HEIGHT_PX - 1) - before.0.y_px)).abs() < 1.0);
        assert!((after.0.y_px - before.0.x_px).abs() < 1.0);
    }
}

#[test]
fn a_mirror_turns_the_direction_round() {
    for (events, capacity) in cases() {
        let mirrored: Vec<Event> =
            events.iter().map(|e| Event { x: WIDTH_PX - 1 - e.x, ..*e }).collect();
        let (before, after) = (measure(&events, capacity), measure(&mirrored, capacity));
        assert_alike("mirror", &before, &after, 2.0);
        let expected = match before.1.direction() {
            Direction::Cw => Direction::Ccw,
            Direction::Ccw => Direction::Cw,
        };
        assert_eq!(after.1.direction(), expected);
    }
}

#[test]
fn a_shift_in_the_image_moves_the_centre_alone() {
    for (events, capacity) in cases() {
        let moved: Vec<Event> =
            events.iter().map(|e| Event { x: e.x + 37, y: e.y + 21, ..*e }).collect();
        let (before, after) = (
            measure(&events, capacity),
            measure_in(&moved, capacity, WIDTH_PX + 60, HEIGHT_PX + 60),
        );
        assert_alike("shift", &before, &after, 2.0);
        assert_eq!(before.1.direction(), after.1.direction());
        assert!((after.0.x_px - before.0.x_px - 37.0).abs() < 1.0);
        assert!((after.0.y_px - before.0.y_px - 21.0).abs() < 1.0);
    }
}

/// To the last bit: the core knows differences of time only. 2^32 us is where stored times wrap.
#[test]
fn a_shift_in_time_changes_no_bit() {
    for (events, capacity) in cases() {
        let before = measure(&events, capacity);
        let first_us = events[0].t_us;
        for start_us in
            [12_345, (1 << 32) - 90_000, 1 << 32, (1 << 33) + 7, (1 << 52) + 1, (1 << 62) + 1]
        {
            let shifted: Vec<Event> =
                events.iter().map(|e| Event { t_us: e.t_us - first_us + start_us, ..*e }).collect();
            let after = measure(&shifted, capacity);
            assert_eq!(before, after, "start at {start_us} us");
        }
    }
}

#[test]
fn what_no_speed_needs_changes_no_bit() {
    for (events, capacity) in cases() {
        let settings = settings(WIDTH_PX, HEIGHT_PX);
        let (needed, _) = measure_events(&events, &[], settings, capacity);
        let all = Settings { all_stages: true, ..settings };
        let (mut readings, _) = measure_events(&events, &[], all, capacity);
        let evidence = readings.iter_mut().flat_map(|r| &mut r.rotors).map(|r| &mut r.evidence);
        let further = evidence.filter_map(|evidence| evidence.further_rad_s.take()).count();
        assert!(further > 0, "{capacity:?}");
        assert_eq!(format!("{readings:?}"), format!("{needed:?}"), "{capacity:?}");
    }
}

#[test]
fn half_of_the_events_say_the_same() {
    for (events, capacity) in cases() {
        let half: Vec<Event> = events.iter().copied().step_by(2).collect();
        let (before, after) = (measure(&events, capacity), measure(&half, capacity));
        assert_alike("half", &before, &after, 3.0);
        assert_eq!(before.1.direction(), after.1.direction());
    }
}

#[test]
fn speed_does_not_need_polarity() {
    for (events, capacity) in cases() {
        let all_on: Vec<Event> =
            events.iter().map(|e| Event { polarity: Polarity::On, ..*e }).collect();
        let (before, after) = (measure(&events, capacity), measure(&all_on, capacity));
        assert_alike("all ON", &before, &after, 3.0);
        assert_eq!(before.1.direction(), after.1.direction());
    }
}

#[test]
fn twice_the_time_is_half_the_speed() {
    for (events, capacity) in cases() {
        let slower: Vec<Event> = events.iter().map(|e| Event { t_us: 2 * e.t_us, ..*e }).collect();
        let (before, mut after) = (measure(&events, capacity), measure(&slower, capacity));
        after.1.omega_rad_s *= 2.0;
        after.1.omega_sigma_rad_s *= 2.0;
        // The window holds another part of the recording: two measurements, not one.
        assert_alike("slow motion", &before, &after, 4.0);
        assert_eq!(before.1.direction(), after.1.direction());
        assert!((after.1.rpm() / before.1.rpm() - 1.0).abs() < 1e-3);
    }
}

/// Files keep events of one microsecond in any order. The device's memory keeps every so many of them: of another order, other events.
#[test]
fn the_order_of_simultaneous_events_does_not_matter() {
    for (events, capacity) in cases() {
        let mut sorted = events.clone();
        sorted.sort_by_key(|e| (e.t_us, e.y, e.x, e.polarity));
        let mut other = events;
        other.sort_by_key(|e| (e.t_us, u16::MAX - e.x, e.y, e.polarity));
        assert_ne!(sorted, other, "no two events are simultaneous: nothing was tried");
        let (before, after) = (measure(&sorted, capacity), measure(&other, capacity));
        match capacity {
            Capacity::Full => assert_eq!(before, after),
            Capacity::Device => assert_alike("ties", &before, &after, 2.0),
        }
    }
}

/// A reading is a function of event times and capacities, never of when a task ran.
#[test]
fn the_rhythm_of_pushing_and_polling_changes_no_bit() {
    for events in recordings() {
        let series = |piece_events: usize, steps: u32| {
            with_tachometer(settings(WIDTH_PX, HEIGHT_PX), Capacity::Device, |tachometer| {
                let mut readings = Vec::new();
                for piece in events.chunks(piece_events) {
                    tachometer.push(piece);
                    if let Poll::Ready(reading) = tachometer.poll(steps) {
                        readings.push(reading);
                    }
                }
                drain(tachometer, |reading| readings.push(reading));
                tachometer.finish();
                drain(tachometer, |reading| readings.push(reading));
                assert_eq!(tachometer.ignored().overrun, 0, "this rhythm is too slow to compare");
                readings
            })
        };
        let at_once = series(1, u32::MAX);
        assert!(!at_once.is_empty());
        // Few steps after every few events: a measurement lasts over many of them, as on the device.
        for (piece_events, steps) in
            [(300, u32::MAX), (7, 2), (16, 1), (20, 1), (64, 8), (128, 16), (256, 32)]
        {
            assert_eq!(
                at_once,
                series(piece_events, steps),
                "{piece_events} events, {steps} steps"
            );
        }
    }
}

/// A processor that is too slow looks at fewer events, and misses no stretch of time.
#[test]
fn a_measurement_that_lasts_long_leaves_all_that_came_meanwhile_to_the_next() {
    const RPM: f64 = 1500.0;
    for piece_events in [1_024, 2_048, 4_096] {
        let rotor =
            Rotor { rpm: RPM, x_px: 110.0, y_px: 95.0, radius_px: 45.0, ..Rotor::default() };
        let (width_px, height_px, rotors) = (WIDTH_PX, HEIGHT_PX, vec![rotor]);
        let scene = Scene { width_px, height_px, duration_ms: 3_000.0, rotors, ..Scene::default() };
        let events = generate(&scene).expect("a scene in range").events;
        with_tachometer(settings(WIDTH_PX, HEIGHT_PX), Capacity::Device, |tachometer| {
            let mut readings = Vec::new();
            for piece in events.chunks(piece_events) {
                tachometer.push(piece);
                if let Poll::Ready(reading) = tachometer.poll(1) {
                    readings.push(reading);
                }
            }
            assert_eq!(tachometer.ignored().overrun, 0, "events that are in no window");
            let bounds = |reading: &Reading| {
                let half_us = u64::from(reading.window_us / 2);
                (reading.t_us - half_us, reading.t_us + half_us)
            };
            println!(
                "{:?}",
                readings
                    .iter()
                    .map(|r| (r.t_us, r.window_us, r.events, r.status))
                    .collect::<Vec<_>>()
            );
            let longest = readings.iter().map(|reading| reading.window_us).max();
            assert!(
                longest > Some(200_000),
                "a window of {longest:?} us: nothing was to catch up with"
            );
            assert!(readings.len() > 3, "{} readings", readings.len());
            for pair in readings.windows(2) {
                let [before, next] = pair else { unreachable!() };
                // Half a window is told in whole microseconds.
                let (end_us, start_us) = (bounds(before).1, bounds(next).0);
                assert!(start_us <= end_us + 2, "nothing of {end_us} to {start_us} us");
            }
            for reading in &readings {
                let [rotor] = &reading.rotors[..] else { unreachable!("{reading:#?}") };
                let rpm = rotor.speed.expect("a speed").rpm();
                assert!((f64::from(rpm) / RPM - 1.0).abs() < 1e-3, "{rpm} rpm: {reading:#?}");
            }
        });
    }
}

//! No stream of events, however mad, makes the tachometer panic, hang, or give a speed that is no number.
//!
//! The test profile checks overflow of integers.
#![allow(clippy::panic)] // A test fails by it.

use evtach_core::limits::{DEVICE_EVENTS, DEVICE_HEAT_CELLS, POLAR_EVENTS};
use evtach_core::speed::polar::PolarEvents;
use evtach_core::{
    Event, Geometry, GyroSample, Memory, More, Polarity, Poll, Reading, Roi, Settings, StoredEvent,
    Tachometer, Work,
};
use evtach_host::synth::scene::Camera;
use evtach_host::synth::{Rotor, Scene, generate};
use proptest::collection::vec;
use proptest::prelude::*;

/// What can happen to a tachometer.
#[derive(Clone, Debug)]
enum Input {
    Events(Vec<Event>),
    Lost(u64),
    Gyro(GyroSample),
    Poll(u32),
    Finish,
}

/// Times as broken sensors, files and links give them.
fn time() -> impl Strategy<Value = u64> {
    prop_oneof![
        8 => 0..200_000_u64,
        4 => 0..10_000_000_u64,
        1 => Just(0),
        1 => Just(u64::MAX),
        1 => (0..5_000_000_u64).prop_map(|back| u64::MAX - back),
        2 => (0..4_000_000_u64).prop_map(|off| (1 << 32) - 2_000_000 + off),
        1 => (0..4_000_000_u64).prop_map(|off| (1 << 63) - 2_000_000 + off),
        1 => any::<u64>(),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    (time(), 0..400_u16, 0..400_u16, any::<bool>(), 0..50_u8).prop_map(|(t_us, x, y, on, wild)| {
        let polarity = if on { Polarity::On } else { Polarity::Off };
        // Now and then far outside of any sensor.
        let (x, y) = if wild == 0 { (x.wrapping_mul(977), u16::MAX - y) } else { (x, y) };
        Event { t_us, x, y, polarity }
    })
}

/// A stretch of events in time order, as most sensors give most of the time.
fn stretch() -> impl Strategy<Value = Vec<Event>> {
    (time(), vec((event(), 0..3_000_u64), 0..400), 1..300_u64).prop_map(
        |(start_us, steps, pace)| {
            let mut t_us = start_us;
            steps
                .into_iter()
                .map(|(event, step_us)| {
                    t_us = t_us.saturating_add(step_us / pace);
                    Event { t_us, ..event }
                })
                .collect()
        },
    )
}

/// A stretch of a rotor, so that the measurement gets far before something mad follows.
fn turning() -> impl Strategy<Value = Vec<Event>> {
    (time(), 1.0..3000.0_f64, 1..4_u32, 2.0..80.0_f64, 5..200_u64).prop_map(
        |(start_us, omega_rad_s, blades, radius_px, pace_us)| {
            (0..2_000_u64)
                .map(|i| {
                    let t_us = start_us.saturating_add(i * pace_us);
                    let part = f64::from((i % u64::from(blades)) as u32) / f64::from(blades);
                    let angle =
                        omega_rad_s * (i * pace_us) as f64 * 1e-6 + part * std::f64::consts::TAU;
                    let reach = radius_px * (0.3 + 0.7 * (i * 7 % 10) as f64 / 10.0);
                    Event {
                        t_us,
                        x: (90.0 + reach * angle.cos()) as u16,
                        y: (90.0 + reach * angle.sin()) as u16,
                        polarity: if i % 2 == 0 { Polarity::On } else { Polarity::Off },
                    }
                })
                .collect()
        },
    )
}

fn roll_rate() -> impl Strategy<Value = f32> {
    prop_oneof![-10.0..10.0_f32, Just(f32::NAN), Just(f32::INFINITY), Just(f32::MAX)]
}

fn input() -> impl Strategy<Value = Input> {
    prop_oneof![
        3 => vec(event(), 0..300).prop_map(Input::Events),
        4 => stretch().prop_map(Input::Events),
        4 => turning().prop_map(Input::Events),
        1 => prop_oneof![0..10_000_u64, Just(u64::MAX)].prop_map(Input::Lost),
        1 => (time(), roll_rate())
            .prop_map(|(t_us, roll_rad_s)| Input::Gyro(GyroSample { t_us, roll_rad_s })),
        3 => (0..200_u32).prop_map(Input::Poll),
        1 => Just(Input::Finish),
    ]
}

fn settings() -> impl Strategy<Value = Settings> {
    let side = prop_oneof![1..2_049_u16, Just(180), Just(346), Just(1), Just(2048)];
    let roi = (any::<u16>(), any::<u16>(), any::<u16>(), any::<u16>())
        .prop_map(|(x, y, width_px, height_px)| Roi { x, y, width_px, height_px });
    let window_us = prop_oneof![0..2_000_000_u32, Just(0), Just(u32::MAX)];
    (
        side.clone(),
        side,
        proptest::option::weighted(0.1, roi),
        proptest::option::weighted(0.2, any::<u8>()),
        proptest::option::weighted(0.2, window_us),
    )
        .prop_map(|(width_px, height_px, roi, blades, window_us)| {
            let geometry = Geometry::new(width_px, height_px).expect("sides of 1 to 2048");
            Settings { roi, blades, window_us, ..Settings::new(geometry) }
        })
}

/// Polls until nothing is left to do; bounded, so that a hang is a failure.
fn drain(tachometer: &mut Tachometer<'_>, readings: &mut Vec<Reading>) {
    for _ in 0..100_000 {
        match tachometer.poll(1_000) {
            Poll::Idle => return,
            Poll::Pending => {}
            Poll::Ready(reading) => readings.push(reading),
        }
    }
    unreachable!("the tachometer never comes to rest");
}

fn check(reading: &Reading) {
    for rotor in &reading.rotors {
        assert_eq!(rotor.speed.is_some(), rotor.status.reason().is_none(), "{rotor:?}");
        assert!(rotor.x_px.is_finite() && rotor.y_px.is_finite(), "{rotor:?}");
        assert!(rotor.radius_px.is_finite(), "{rotor:?}");
        let Some(speed) = rotor.speed else { continue };
        assert!(speed.omega_rad_s.is_finite(), "{rotor:?}");
        assert!(speed.omega_sigma_rad_s.is_finite() && speed.omega_sigma_rad_s >= 0.0, "{rotor:?}");
    }
}

/// How much memory is lent.
#[derive(Clone, Copy, Debug)]
struct Room {
    store_events: usize,
    heat_cells: usize,
    /// Times that a search has more room for, where that is lent.
    more_times: Option<usize>,
}

/// The device's.
const USUAL: Room =
    Room { store_events: DEVICE_EVENTS, heat_cells: DEVICE_HEAT_CELLS, more_times: None };

fn room() -> impl Strategy<Value = Room> {
    let store_events = prop_oneof![Just(USUAL.store_events), 0..2_000_usize];
    let heat_cells = prop_oneof![Just(USUAL.heat_cells), 0..500_usize];
    let more_times =
        prop_oneof![Just(None), Just(Some(50_000_usize)), (0..2_000_usize).prop_map(Some)];
    (store_events, heat_cells, more_times).prop_map(|(store_events, heat_cells, more_times)| Room {
        store_events,
        heat_cells,
        more_times,
    })
}

fn play(settings: Settings, inputs: &[Input], room: Room) -> Vec<Reading> {
    let mut events = vec![StoredEvent::default(); room.store_events];
    let (mut heat, mut weights) = (vec![0; room.heat_cells], vec![0; room.heat_cells]);
    let mut work = Box::new(Work::EMPTY);
    let mut times = vec![0; room.more_times.unwrap_or(0)];
    let mut track = Box::new(PolarEvents::<{ 2 * POLAR_EVENTS }>::new());
    let more = room.more_times.map(|_| More { times: &mut times, track: track.as_mut_view() });
    let memory = Memory {
        events: &mut events,
        heat: &mut heat,
        weights: &mut weights,
        work: &mut work,
        more,
    };
    let mut tachometer = Tachometer::new(settings, memory);
    let mut readings = Vec::new();
    for input in inputs {
        match input {
            Input::Events(events) => tachometer.push(events),
            Input::Lost(count) => tachometer.lost(*count),
            Input::Gyro(sample) => tachometer.gyro(*sample),
            Input::Poll(steps) => {
                if let Poll::Ready(reading) = tachometer.poll(*steps) {
                    readings.push(reading);
                }
            }
            Input::Finish => tachometer.finish(),
        }
    }
    drain(&mut tachometer, &mut readings);
    tachometer.finish();
    drain(&mut tachometer, &mut readings);
    readings.iter().for_each(check);
    readings
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2_000,
        max_shrink_iters: 200,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn never_panics(
        settings in settings(),
        inputs in vec(input(), 0..12),
        room in room(),
    ) {
        play(settings, &inputs, room);
    }
}

/// The ends of time, one by one: cheap to name, easy to miss by chance.
#[test]
fn ends_of_time() {
    let settings = Settings::new(Geometry::new(200, 200).expect("a sensor in range"));
    let at = |times: &[u64]| {
        let events: Vec<Event> = times
            .iter()
            .map(|t_us| Event { t_us: *t_us, x: 5, y: 5, polarity: Polarity::On })
            .collect();
        let room = Room { store_events: 4_096, ..USUAL };
        play(settings, &[Input::Events(events), Input::Finish], room);
    };
    at(&[u64::MAX]);
    at(&[0, u64::MAX]);
    at(&[u64::MAX, 0, u64::MAX]);
    at(&[u64::MAX - 1_000_000, u64::MAX - 900_000, u64::MAX - 1, u64::MAX]);
    at(&[(1 << 32) - 1, 1 << 32, (1 << 32) + 100_000]);
    at(&[(1 << 63) - 1, 1 << 63]);
}

/// A gyro that gives no numbers leaves a rotor's speed alone, and that of a camera that moves, which a gyro is asked about.
#[test]
fn a_mad_gyro_is_not_believed() {
    let geometry = Geometry::new(200, 200).expect("a sensor in range");
    // As after a calibration.
    let settings = Settings { gyro_sigma_rad_s: 0.003, ..Settings::new(geometry) };
    let rotor = Rotor { x_px: 85.0, y_px: 100.0, rpm: 1900.0, ..Rotor::default() };
    let scene = Scene {
        width_px: 200,
        height_px: 200,
        rotors: vec![rotor],
        camera: Camera { drift_px_s: [100.0, 0.0], ..Camera::default() },
        duration_ms: 300.0,
        ..Scene::default()
    };
    let events = generate(&scene).expect("a scene in range").events;
    let told = |rolls_rad_s: &[f32]| {
        let mut inputs = Vec::new();
        for part in events.chunk_by(|a, b| a.t_us / 1000 == b.t_us / 1000) {
            let t_us = part[0].t_us;
            inputs.push(Input::Events(part.to_vec()));
            let sample =
                |roll_rad_s: &f32| Input::Gyro(GyroSample { t_us, roll_rad_s: *roll_rad_s });
            inputs.extend(rolls_rad_s.iter().map(sample));
        }
        format!("{:?}", play(settings, &inputs, USUAL))
    };
    let alone = told(&[]);
    assert!(alone.contains("Locked"), "{alone}");
    assert_ne!(told(&[0.05]), alone, "a gyro is heard");
    for roll_rad_s in [f32::NAN, f32::INFINITY, f32::MIN, 101.0] {
        assert_eq!(told(&[roll_rad_s]), alone, "{roll_rad_s}");
    }
}

mod properties;

extern crate std;

use std::string::{String, ToString as _};
use std::vec;
use std::vec::Vec;

use evtach_core::{Evidence, Frame, Reading, Reason, RotorReading, Speed, Status};

use super::*;

const WINDOW_US: u32 = 150_000;

fn rotor(id: u8, rpm: f32, status: Status) -> RotorReading {
    let omega_rad_s = rpm / Speed::RPM_PER_RAD_S;
    let speed = Speed {
        omega_rad_s,
        omega_sigma_rad_s: omega_rad_s.abs() * 5e-4,
        alpha_rad_s2: None,
        frame: Frame::Camera,
    };
    RotorReading {
        id,
        x_px: 100.0 + f32::from(id) * 50.0,
        y_px: 120.0,
        radius_px: 20.0,
        blades: Some(3),
        status,
        speed: status.reason().is_none().then_some(speed),
        evidence: Evidence::default(),
    }
}

/// A reading whose window ends at `end_us`.
fn reading(end_us: u64, status: Status, rotors: &[RotorReading]) -> Reading {
    Reading {
        t_us: end_us - u64::from(WINDOW_US / 2),
        window_us: WINDOW_US,
        events: 100_000,
        thinned: 0,
        lost: 0,
        status,
        rotors: rotors.iter().cloned().collect(),
    }
}

fn locked(end_us: u64, rpm: f32) -> Reading {
    reading(end_us, Status::Locked, &[rotor(0, rpm, Status::Locked)])
}

fn refused(end_us: u64, reason: Reason) -> Reading {
    let status = Status::Refused(reason);
    reading(end_us, status, &[rotor(0, 0.0, status)])
}

/// An instrument with a sensor that sends a million events a second.
fn instrument() -> Instrument {
    let mut instrument = Instrument::new(Preferences::default());
    instrument.set_sensor(Sensor::Present);
    instrument
}

fn tick(instrument: &mut Instrument, now_us: u64) {
    instrument.tick(now_us, Traffic { events: now_us, lost: 0 });
}

/// A reading at the time when its window ends.
fn see(instrument: &mut Instrument, reading: &Reading) {
    tick(instrument, reading.t_us + u64::from(WINDOW_US / 2));
    instrument.observe(reading);
}

fn number(instrument: &Instrument) -> Option<String> {
    instrument.view().speed.map(|speed| speed.value.to_string())
}

#[test]
fn from_nothing_to_a_lock_and_back() {
    let mut it = Instrument::new(Preferences::default());
    let state = |it: &Instrument| it.view().state;
    assert_eq!(state(&it), State::Refused(Reason::NoSensor));
    it.set_sensor(Sensor::Present);
    assert_eq!(state(&it), State::Refused(Reason::NoEvents));
    tick(&mut it, 10_000);
    assert_eq!(state(&it), State::Refused(Reason::Searching));
    for reason in Reason::ALL {
        it.observe(&refused(200_000, reason));
        assert_eq!(state(&it), State::Refused(reason));
        assert_eq!(number(&it), None);
    }
    it.observe(&reading(300_000, Status::Coarse, &[rotor(0, 1180.0, Status::Coarse)]));
    assert_eq!(state(&it), State::Coarse);
    assert_eq!(number(&it).as_deref(), Some("1180.0"));
    it.observe(&locked(400_000, 1181.0));
    assert_eq!((state(&it), number(&it)), (State::Locked, Some("1181.0".into())));
    it.set_sensor(Sensor::Absent);
    assert_eq!((state(&it), number(&it)), (State::Refused(Reason::NoSensor), None));
}

#[test]
fn an_old_reading_turns_grey_then_into_dashes() {
    let mut it = instrument();
    see(&mut it, &locked(1_000_000, 1180.0));
    for (now_us, state, shown) in [
        (1_900_000, State::Locked, true),
        (2_000_000, State::Locked, true),
        (2_000_001, State::Held, true),
        (3_000_000, State::Held, true),
        (3_000_001, State::Refused(Reason::Searching), false),
    ] {
        tick(&mut it, now_us);
        let view = it.view();
        assert_eq!((view.state, view.speed.is_some()), (state, shown), "{now_us}");
        // Events go on, so it is not the sensor that is silent.
        assert_eq!(view.direction.is_some(), shown);
    }
}

#[test]
fn a_refusal_after_a_speed_holds_it_for_a_second_then_tells_why() {
    let mut it = instrument();
    see(&mut it, &locked(1_000_000, 1180.0));
    see(&mut it, &refused(1_050_000, Reason::Ambiguous));
    tick(&mut it, 1_060_000);
    assert_eq!((it.view().state, number(&it)), (State::Held, Some("1180.0".into())));
    see(&mut it, &refused(2_000_001, Reason::Ambiguous));
    let state = State::Refused(Reason::Ambiguous);
    assert_eq!((it.view().state, number(&it)), (state, None));
    see(&mut it, &locked(2_100_000, 1190.0));
    assert_eq!((it.view().state, number(&it)), (State::Locked, Some("1190.0".into())));
}

#[test]
fn a_silent_sensor_is_told_from_one_that_sees_nothing_turn() {
    let mut it = instrument();
    it.tick(0, Traffic::default());
    it.tick(100_000, Traffic { events: 5, lost: 0 });
    it.observe(&refused(100_000, Reason::NoRotation));
    it.tick(600_000, Traffic { events: 5, lost: 0 });
    assert_eq!(it.view().state, State::Refused(Reason::NoRotation));
    it.tick(600_001, Traffic { events: 5, lost: 0 });
    assert_eq!(it.view().state, State::Refused(Reason::NoEvents));
    it.tick(700_000, Traffic { events: 6, lost: 0 });
    assert_eq!(it.view().state, State::Refused(Reason::NoRotation));
}

#[test]
fn a_fault_stands_over_everything_until_it_is_acknowledged() {
    for fault in Fault::ALL {
        let mut it = instrument();
        it.act(Action::Mode(Mode::Max));
        it.fail(fault);
        see(&mut it, &locked(1_000_000, 1180.0));
        assert_eq!((it.view().state, number(&it)), (State::Fault(fault), None));
        assert_eq!(it.view().state.reason(), Some(Reason::Fault));
        it.act(Action::Acknowledge);
        assert_eq!((it.view().state, number(&it)), (State::Locked, Some("1180.0".into())));
    }
}

#[test]
fn hold_freezes_number_picture_trend_and_time_together() {
    let mut it = instrument();
    tick(&mut it, 1_000_000);
    see(&mut it, &locked(1_000_000, 1180.0));
    let mut picture = Picture::EMPTY;
    it.show_picture(&picture);
    it.act(Action::ToggleHold);
    let held = it.view();
    assert_eq!((held.mode, held.state), (Mode::Hold, State::Locked));

    let readings = it.readings();
    tick(&mut it, 9_000_000);
    see(&mut it, &locked(9_000_000, 2000.0));
    // Nobody is told of a new reading, where there is the held one.
    assert_eq!(it.readings(), readings);
    let mut counts = [9; 64];
    let geometry = evtach_core::Geometry { width_px: 32, height_px: 32 };
    let heat = evtach_core::rotors::HeatMap::new(&mut counts, geometry);
    picture.take(&heat);
    it.show_picture(&picture);
    let later = it.view();
    assert_eq!((&later.speed, later.time_tenths), (&held.speed, held.time_tenths));
    assert_eq!((later.state, later.picture, later.trend), (held.state, held.picture, held.trend));
    assert_eq!(later.rotors, held.rotors);
    assert_eq!((it.trend().len(), it.picture()), (1, &Picture::EMPTY));
    // What goes on behind it: extremes.
    let max = later.statistics.and_then(|statistics| statistics.max);
    assert_eq!(max.map(|max| max.value.to_string()).as_deref(), Some("2000"));

    // The unit may change: it is the same reading.
    it.act(Action::Unit(Unit::Hertz));
    assert_eq!(number(&it).as_deref(), Some("19.667"));
    it.act(Action::Unit(Unit::Rpm));
    it.set_sensor(Sensor::Absent);
    assert_eq!(number(&it).as_deref(), Some("1180.0"));
    it.set_sensor(Sensor::Present);
    it.act(Action::ToggleHold);
    assert_eq!(it.view().mode, Mode::Live);
    see(&mut it, &locked(9_100_000, 2010.0));
    assert_eq!(number(&it).as_deref(), Some("2010"));
}

#[test]
fn hold_goes_back_to_the_mode_it_came_from() {
    let mut it = instrument();
    it.act(Action::Mode(Mode::Min));
    it.act(Action::ToggleHold);
    it.act(Action::Mode(Mode::Hold));
    it.act(Action::ToggleHold);
    assert_eq!(it.view().mode, Mode::Min);
    let mut seen = Vec::new();
    for _ in 0..4 {
        it.act(Action::NextMode);
        seen.push(it.view().mode);
    }
    assert_eq!(seen, [Mode::Mean, Mode::Live, Mode::Max, Mode::Min]);
}

#[test]
fn max_min_and_mean_stand_until_reset() {
    let mut it = instrument();
    let modes = [Mode::Max, Mode::Min, Mode::Mean];
    let shown = |it: &mut Instrument| {
        modes.map(|mode| {
            it.act(Action::Mode(mode));
            number(it)
        })
    };
    assert_eq!(shown(&mut it), [None, None, None]);
    for (i, rpm) in [3000.0, 3200.0, 2800.0, 3000.0].into_iter().enumerate() {
        see(&mut it, &locked(1_000_000 + 50_000 * i as u64, rpm));
    }
    let three = ["3200", "2800", "3000"].map(|text| Some(text.into()));
    assert_eq!(shown(&mut it), three);
    see(&mut it, &refused(9_000_000, Reason::NoRotation));
    assert_eq!(shown(&mut it), three);
    it.act(Action::Reset);
    assert_eq!(shown(&mut it), [None, None, None]);
    assert!(it.trend().is_empty());
}

#[test]
fn revolutions_count_while_measured_only() {
    let mut it = instrument();
    let turns = |it: &Instrument| it.view().statistics.map(|s| s.turns_tenths);
    // 600 rpm are ten revolutions a second; the speed rises to 1200 within the second second.
    see(&mut it, &locked(1_000_000, 600.0));
    assert_eq!(turns(&it), Some(0));
    see(&mut it, &locked(2_000_000, 600.0));
    assert_eq!(turns(&it), Some(100));
    see(&mut it, &locked(3_000_000, 1200.0));
    assert_eq!(turns(&it), Some(250));
    // Five seconds that nobody measured.
    see(&mut it, &refused(4_000_000, Reason::Ambiguous));
    see(&mut it, &locked(8_000_000, 1200.0));
    assert_eq!(turns(&it), Some(250));
    see(&mut it, &locked(8_500_000, 1200.0));
    assert_eq!(turns(&it), Some(350));
    // Nothing was to be seen for a while, of which no reading tells.
    see(&mut it, &locked(20_500_000, 1200.0));
    assert_eq!(turns(&it), Some(350));
    it.act(Action::Reset);
    assert_eq!(turns(&it), None);
}

#[test]
fn units_show_the_same_speed() {
    let mut it = instrument();
    see(&mut it, &locked(1_000_000, 1200.0));
    for (unit, text, error) in [
        (Unit::Rpm, "1200.0", "0.60"),
        (Unit::Hertz, "20.00", "0.010"),
        (Unit::RadPerS, "125.66", "0.063"),
        (Unit::MsPerTurn, "50.00", "0.025"),
    ] {
        assert_eq!(it.preferences().unit, unit);
        let speed = it.view().speed.expect("a speed was measured");
        assert_eq!((speed.value.to_string(), speed.error.to_string()), (text.into(), error.into()));
        it.act(Action::NextUnit);
    }
    assert_eq!(it.preferences().unit, Unit::Rpm);
}

#[test]
fn a_fast_clock_makes_the_true_speed_higher() {
    let mut it = instrument();
    it.act(Action::ClockTrim(1000.0));
    see(&mut it, &locked(1_000_000, 3000.0));
    let tenths = it.shown_rpm().map(|rpm| (rpm * 10.0) as u32);
    assert_eq!(tenths, Some(30_030));
    for beyond in [1000.1, -1000.1, f32::NAN] {
        it.act(Action::ClockTrim(beyond));
        assert_eq!(it.preferences().clock_trim_ppm, 1000.0);
    }
    it.act(Action::Step(Setting::ClockTrim, Step::More));
    assert_eq!(it.preferences().clock_trim_ppm, 1000.0);
    it.act(Action::Step(Setting::ClockTrim, Step::Less));
    assert_eq!(it.preferences().clock_trim_ppm, 999.0);
    it.act(Action::Step(Setting::ClockTrim, Step::Off));
    assert_eq!(it.preferences().clock_trim_ppm, 0.0);
}

#[test]
fn the_alarm_is_on_exactly_while_a_measured_speed_is_beyond_a_limit() {
    let mut it = instrument();
    it.act(Action::Alarm(Alarm { low_rpm: Some(1000.0), high_rpm: Some(2000.0) }));
    for (i, (rpm, alarm)) in [
        (1000.0, None),
        (999.9, Some((0, Beyond::Low))),
        (1500.0, None),
        (2000.0, None),
        (2000.1, Some((0, Beyond::High))),
    ]
    .into_iter()
    .enumerate()
    {
        see(&mut it, &locked(1_000_000 + 100_000 * i as u64, rpm));
        assert_eq!(it.view().alarm, alarm, "{rpm}");
    }
    // Hold stops the number, not the alarm.
    it.act(Action::ToggleHold);
    see(&mut it, &locked(1_600_000, 1500.0));
    assert_eq!(it.view().alarm, None);
    see(&mut it, &locked(1_700_000, 2500.0));
    assert_eq!(it.view().alarm, Some((0, Beyond::High)));
    it.act(Action::ToggleHold);
    // What was not measured is beyond no limit.
    tick(&mut it, 2_700_001);
    assert_eq!(it.view().alarm, None);
    // Nor what was measured beyond another.
    see(&mut it, &locked(2_800_000, 2500.0));
    assert_eq!(it.view().alarm, Some((0, Beyond::High)));
    it.act(Action::Alarm(Alarm { low_rpm: Some(1000.0), high_rpm: Some(3000.0) }));
    assert_eq!(it.view().alarm, None);
    let kept = it.preferences().alarm;
    for wrong in [f32::NAN, f32::INFINITY, 0.0, -5.0] {
        it.act(Action::Alarm(Alarm { low_rpm: None, high_rpm: Some(wrong) }));
        assert_eq!(it.preferences().alarm, kept);
    }
}

#[test]
fn blades_double_and_halve_from_what_was_found() {
    let mut it = instrument();
    see(&mut it, &locked(1_000_000, 1200.0));
    assert_eq!((it.view().blades, it.preferences().blades), (Some(3), None));
    it.act(Action::BladesTwice);
    assert_eq!(it.preferences().blades, Some(6));
    for _ in 0..9 {
        it.act(Action::BladesTwice);
    }
    assert_eq!(it.preferences().blades, Some(MAX_BLADES));
    for _ in 0..9 {
        it.act(Action::BladesHalf);
    }
    assert_eq!(it.preferences().blades, Some(1));
    for wrong in [0, MAX_BLADES + 1] {
        it.act(Action::Blades(Some(wrong)));
        assert_eq!(it.preferences().blades, Some(1));
    }
    it.act(Action::Blades(None));
    assert_eq!((it.view().blades, it.preferences().blades), (Some(3), None));
}

#[test]
fn the_number_stays_with_its_rotor() {
    let mut it = instrument();
    let (a, b) = (rotor(0, 1200.0, Status::Locked), rotor(1, 1300.0, Status::Locked));
    let lost_a = rotor(0, 0.0, Status::Refused(Reason::TooFewEvents));
    let both = |end_us| reading(end_us, Status::Locked, &[a.clone(), b.clone()]);
    see(&mut it, &both(1_000_000));
    assert_eq!((it.view().rotor, number(&it)), (Some(0), Some("1200.0".into())));
    // A miss of A is no reason to show B at once, but a second without it is.
    see(&mut it, &reading(1_050_000, Status::Locked, &[lost_a.clone(), b.clone()]));
    assert_eq!((it.view().rotor, it.view().state), (Some(0), State::Held));
    see(&mut it, &reading(2_100_000, Status::Locked, &[lost_a.clone(), b.clone()]));
    assert_eq!((it.view().rotor, number(&it)), (Some(1), Some("1300.0".into())));
    it.act(Action::NextRotor);
    assert_eq!((it.view().rotor, number(&it)), (Some(0), None));
    assert_eq!(it.view().state, State::Refused(Reason::TooFewEvents));
    // Chosen by hand it stays, even when it is gone.
    see(&mut it, &reading(4_000_000, Status::Locked, core::slice::from_ref(&b)));
    assert_eq!(it.view().state, State::Refused(Reason::NoRotation));
    it.act(Action::NextRotor);
    assert_eq!((it.view().rotor, number(&it)), (Some(1), Some("1300.0".into())));
    assert_eq!(it.view().rotors.len(), 1);
}

#[test]
fn rotors_stand_beside_their_mean() {
    let mut it = instrument();
    let rotors = [rotor(0, 990.0, Status::Locked), rotor(1, 1010.0, Status::Locked)];
    see(&mut it, &reading(1_000_000, Status::Locked, &rotors));
    let off: Vec<_> = it.view().rotors.iter().map(|row| row.off_mean_permille).collect();
    assert_eq!(off, [Some(-10), Some(10)]);
    see(&mut it, &locked(1_100_000, 990.0));
    assert_eq!(it.view().rotors[0].off_mean_permille, None);
}

#[test]
fn a_clock_that_begins_anew_takes_nothing_along() {
    let mut it = instrument();
    see(&mut it, &locked(50_000_000, 1200.0));
    see(&mut it, &refused(1_000_000, Reason::Searching));
    assert_eq!((it.view().time_tenths, number(&it)), (Some(0), None));
    assert!(it.trend().is_empty());
}

#[test]
fn rates_are_of_the_last_moments_and_losses_are_never_rounded_away() {
    let mut it = instrument();
    it.tick(1_000_000, Traffic { events: 7, lost: 0 });
    it.tick(1_050_000, Traffic { events: 900_007, lost: 0 });
    assert_eq!(it.view().rate, Rate::default());
    it.tick(1_250_000, Traffic { events: 1_000_007, lost: 1 });
    assert_eq!(it.view().rate, Rate { events_per_s: 4_000_000, lost_permille: 1 });
    it.tick(1_500_000, Traffic { events: 1_000_007, lost: 1 });
    assert_eq!(it.view().rate, Rate::default());
    it.tick(0, Traffic::default());
    assert_eq!(it.view().rate, Rate::default());
}

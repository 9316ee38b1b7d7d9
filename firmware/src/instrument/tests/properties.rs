//! Whatever happens to an instrument.

use proptest::prelude::*;

use super::*;

/// Everything that can happen to an instrument.
#[derive(Clone, Debug)]
enum Input {
    Read(std::boxed::Box<Reading>),
    Tick(u64, u64),
    Sensor(bool),
    Fail(Fault),
    Act(Action),
}

fn any_status() -> impl Strategy<Value = Status> {
    prop_oneof![
        Just(Status::Locked),
        Just(Status::Coarse),
        prop::sample::select(Reason::ALL.to_vec()).prop_map(Status::Refused),
    ]
}

fn any_input() -> impl Strategy<Value = Input> {
    let rotor = (0_u8..4, prop_oneof![1.0_f32..1e5, any::<f32>()], any_status())
        .prop_map(|(id, rpm, status)| rotor(id, rpm, status));
    let read = (75_000_u64..20_000_000, any_status(), prop::collection::vec(rotor, 0..4))
        .prop_map(|(end_us, status, rotors)| Input::Read(reading(end_us, status, &rotors).into()));
    let act = prop_oneof![
        Just(Action::Acknowledge),
        Just(Action::ToggleHold),
        Just(Action::NextMode),
        prop::sample::select(Mode::ALL.to_vec()).prop_map(Action::Mode),
        Just(Action::Reset),
        Just(Action::NextUnit),
        Just(Action::NextRotor),
        prop::option::of(any::<u8>()).prop_map(Action::Rotor),
        prop::option::of(any::<u8>()).prop_map(Action::Blades),
        Just(Action::BladesTwice),
        Just(Action::BladesHalf),
        any::<f32>().prop_map(Action::ClockTrim),
    ];
    prop_oneof![
        4 => read,
        2 => (0_u64..20_000_000, any::<u64>()).prop_map(|(t, events)| Input::Tick(t, events)),
        1 => any::<bool>().prop_map(Input::Sensor),
        1 => prop::sample::select(Fault::ALL.to_vec()).prop_map(Input::Fail),
        3 => act.prop_map(Input::Act),
    ]
}

proptest! {
    /// Whatever happens, in whatever order: a state without a speed shows no digit in live and hold, and max, min and
    /// mean show one only after something has been measured.
    #[test]
    fn no_digit_without_a_measurement(inputs in prop::collection::vec(any_input(), 1..60)) {
        let mut it = instrument();
        let mut measured = false;
        for input in inputs {
            match input {
                Input::Read(reading) => {
                    measured |= reading.rotors.iter().any(|rotor| rotor.speed.is_some());
                    it.observe(&reading);
                }
                Input::Tick(now_us, events) => it.tick(now_us, Traffic { events, lost: 0 }),
                Input::Sensor(true) => it.set_sensor(Sensor::Present),
                Input::Sensor(false) => it.set_sensor(Sensor::Absent),
                Input::Fail(fault) => it.fail(fault),
                Input::Act(action) => {
                    measured &= action != Action::Reset;
                    it.act(action);
                }
            }
            let view = it.view();
            if matches!(view.mode, Mode::Live | Mode::Hold) && !view.state.has_speed() {
                prop_assert_eq!(view.speed, None);
                prop_assert_eq!(view.direction, None);
            }
            if !measured {
                prop_assert_eq!(view.statistics, None);
            }
            if matches!(view.state, State::Fault(_)) {
                prop_assert_eq!(view.speed, None);
            }
        }
    }
}

use std::string::ToString as _;

use embedded_graphics::prelude::*;
use evtach_core::Reason;

use super::text::{MEDIUM, SMALL, width};
use super::*;
use crate::instrument::{
    Action, Fault, Instrument, MAX_BLADES, Page, Preferences, Sensor, Setting, State, Step, Unit,
    View,
};
use crate::sensor::usb::{Model, Module, Register, TROUBLE_BYTES, Trouble};

fn view(page: Page) -> View {
    let mut instrument = Instrument::new(Preferences::default());
    instrument.set_sensor(Sensor::Present);
    instrument.act(Action::Page(page));
    instrument.view()
}

#[test]
fn every_word_fits_where_it_stands() {
    for reason in Reason::ALL {
        let state = State::Refused(reason);
        assert!(width(&SMALL, state.advice()) <= 464, "{}", state.advice());
        // In the list, after the letter.
        assert!(width(&SMALL, state.word()) <= 150, "{}", state.word());
    }
    for fault in Fault::ALL {
        assert!(width(&SMALL, fault.advice()) <= 464, "{}", fault.advice());
    }
    let register = Register { module: Module::Dvs, parameter: u16::MAX };
    let model = Model::Dvxplorer;
    for trouble in [
        Trouble::Foreign { vendor_id: 0xdddd, product_id: 0xdddd },
        Trouble::OldFirmware { model, has: 200, needs: 200 },
        Trouble::OtherLogic { model, version: 88, patch: 88 },
        Trouble::Slow,
        Trouble::NoData,
        Trouble::NoAnswer,
        Trouble::Register(register),
        Trouble::Nonsense(register),
        Trouble::Stalled,
        Trouble::Damaged,
        Trouble::Overcurrent,
    ] {
        let words = trouble.to_string();
        assert!(width(&SMALL, &words) <= 464 && words.len() <= TROUBLE_BYTES, "{words}");
    }
    // Beside the error.
    assert!(width(&SMALL, State::Held.advice()) <= 290);
    for unit in Unit::ALL {
        assert!(width(&MEDIUM, unit.as_str()) <= 70, "{}", unit.as_str());
    }
}

/// The font of values has no other letters.
#[test]
fn values_have_all_their_letters() {
    let units = Unit::ALL.map(Unit::as_str).concat();
    let rotors: std::string::String = (0..=26).map(theme::letter).collect();
    for letter in ["Settings± 0123456789.-", &units, &rotors].concat().chars() {
        assert!(width(&MEDIUM, &letter.to_string()) > 0, "{letter}");
    }
}

#[test]
fn a_text_is_as_wide_as_its_letters() {
    assert_eq!(width(&SMALL, ""), 0);
    assert_eq!(width(&text::HUGE, "11"), 2 * width(&text::HUGE, "8"));
    assert!(width(&SMALL, "iii") < width(&SMALL, "WWW"));
}

#[test]
fn keys_do_what_they_say() {
    let at = |page, x, y| action_at(&view(page), Point::new(x, y));
    for (x, action) in [
        (40, Action::ToggleHold),
        (120, Action::NextMode),
        (200, Action::NextRotor),
        (280, Action::NextUnit),
        (360, Action::Reset),
        (440, Action::Page(Page::Settings)),
    ] {
        assert_eq!(at(Page::Main, x, 254), Some(action), "{x}");
    }
    assert_eq!(at(Page::Main, 60, 190), Some(Action::Page(Page::Aim)));
    assert_eq!(at(Page::Main, 200, 70), None);
    assert_eq!(at(Page::Aim, 60, 254), Some(Action::Page(Page::Main)));
    assert_eq!(at(Page::Settings, 240, 254), Some(Action::Page(Page::Main)));
    let more = Action::Step(Setting::AlarmHigh, Step::More);
    assert_eq!(at(Page::Settings, 440, 134), Some(more));
    assert_eq!(at(Page::Settings, 250, 54), Some(Action::Unit(Unit::Rpm)));
    assert_eq!(at(Page::Settings, 380, 94), Some(Action::BladesHalf));
}

#[test]
fn a_fault_answers_to_ok_alone() {
    let mut instrument = Instrument::new(Preferences::default());
    instrument.fail(Fault::Watchdog);
    for page in [Page::Main, Page::Aim, Page::Settings] {
        instrument.act(Action::Page(page));
        let view = instrument.view();
        assert_eq!(action_at(&view, Point::new(240, 254)), Some(Action::Acknowledge));
        assert_eq!(action_at(&view, Point::new(60, 190)), None);
        for press in [Press::Short, Press::Long] {
            assert_eq!(button(&view, press), Action::Acknowledge);
        }
    }
}

#[test]
fn the_button_holds_steps_and_goes_back() {
    assert_eq!(button(&view(Page::Main), Press::Short), Action::ToggleHold);
    assert_eq!(button(&view(Page::Main), Press::Long), Action::NextMode);
    for page in [Page::Aim, Page::Settings] {
        for press in [Press::Short, Press::Long] {
            assert_eq!(button(&view(page), press), Action::Page(Page::Main));
        }
    }
}

#[test]
fn every_place_of_the_screen_can_be_pressed() {
    for page in [Page::Main, Page::Aim, Page::Settings] {
        let mut instrument = Instrument::new(Preferences::default());
        instrument.set_sensor(Sensor::Present);
        for x in (-5..490).step_by(7) {
            for y in (-5..280).step_by(7) {
                instrument.act(Action::Page(page));
                if let Some(action) = action_at(&instrument.view(), Point::new(x, y)) {
                    instrument.act(action);
                }
                let preferences = instrument.preferences();
                assert!(preferences.alarm.is_valid());
                assert!(preferences.blades.is_none_or(|n| (1..=MAX_BLADES).contains(&n)));
            }
        }
    }
}

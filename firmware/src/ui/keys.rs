//! What can be pressed: keys on the screen, places that answer to a finger, and the button.

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use evtach_core::Reason;
use heapless::Vec;

use super::text::{self, Align, Ink, SMALL};
use super::theme::{self, BACK, PANEL, TEXT, area};
use super::{list, scene, settings};
use crate::instrument::{Action, Mode, Page, State, View};

/// How the one button was pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Press {
    /// Shorter than half a second.
    Short,
    /// Longer.
    Long,
}

/// Keys in the row at the bottom.
const MOST_KEYS: usize = 6;

/// A word to press.
pub(super) struct Key {
    pub area: Rectangle,
    pub word: &'static str,
    pub action: Action,
    /// Whether it is what is chosen now.
    pub chosen: bool,
}

impl Key {
    pub fn draw<D: DrawTarget<Color = Rgb565>>(&self, target: &mut D) -> Result<(), D::Error> {
        let (colour, paper) = if self.chosen { (BACK, theme::ACCENT) } else { (TEXT, PANEL) };
        theme::fill_round(target, self.area, paper)?;
        // Capitals of 11 px, in the middle.
        let at = self.area.center() + Point::new(0, 6);
        text::draw(target, &SMALL, self.word, at, Align::Centre, Ink { colour, paper })
    }
}

/// The words and actions at the bottom of a page.
fn words(view: &View) -> Vec<(&'static str, Action, bool), MOST_KEYS> {
    let main = |word, action| (word, action, false);
    let back = main("BACK", Action::Page(Page::Main));
    let hold = ("HOLD", Action::ToggleHold, view.mode == Mode::Hold);
    let mut keys = Vec::new();
    let all: &[_] = match (view.page, view.state) {
        (_, State::Fault(_)) => &[main("OK", Action::Acknowledge)],
        (Page::Settings, _) => &[back],
        (Page::Aim, _) => {
            &[back, hold, main("ROTOR", Action::NextRotor), main("UNIT", Action::NextUnit)]
        }
        (Page::Main, State::Refused(Reason::Ambiguous)) => &[
            main("BLADES ÷2", Action::BladesHalf),
            main("BLADES ×2", Action::BladesTwice),
            ("FIND", Action::Blades(None), view.preferences.blades.is_none()),
            main("SETUP", Action::Page(Page::Settings)),
        ],
        (Page::Main, _) => &[
            hold,
            main("MODE", Action::NextMode),
            main("ROTOR", Action::NextRotor),
            main("UNIT", Action::NextUnit),
            main("RESET", Action::Reset),
            main("SETUP", Action::Page(Page::Settings)),
        ],
    };
    keys.extend_from_slice(all).ok();
    keys
}

/// The row at the bottom.
fn row(view: &View) -> impl Iterator<Item = Key> {
    const GAP: u32 = 6;
    let words = words(view);
    let count = words.len() as u32;
    let wide = (464 + GAP) / count.max(1) - GAP;
    words.into_iter().enumerate().map(move |(i, (word, action, chosen))| {
        let x = 8 + i as i32 * (wide + GAP) as i32;
        Key { area: area(x, 239, wide, 29), word, action, chosen }
    })
}

pub fn changed(a: &View, b: &View) -> bool {
    words(a) != words(b)
}

pub fn draw<D: DrawTarget<Color = Rgb565>>(target: &mut D, view: &View) -> Result<(), D::Error> {
    target.fill_solid(&area(0, 236, 480, 36), BACK)?;
    for key in row(view) {
        key.draw(target)?;
    }
    Ok(())
}

/// What a finger at a place of the screen asks for.
#[must_use]
pub fn action_at(view: &View, at: Point) -> Option<Action> {
    // A finger is wider than the gaps between keys.
    if let Some(key) = row(view).find(|key| key.area.offset(3).contains(at)) {
        return Some(key.action);
    }
    match view.page {
        _ if matches!(view.state, State::Fault(_)) => None,
        Page::Settings => {
            settings::keys(view).find(|key| key.area.contains(at)).map(|key| key.action)
        }
        Page::Aim => None,
        Page::Main if scene::THUMBNAIL.contains(at) => Some(Action::Page(Page::Aim)),
        Page::Main => list::rotor_at(view, at).map(|id| Action::Rotor(Some(id))),
    }
}

/// What the button asks for: whoever has no hand free for the screen holds and steps through the modes.
#[must_use]
pub const fn button(view: &View, press: Press) -> Action {
    match (view.state, view.page, press) {
        (State::Fault(_), ..) => Action::Acknowledge,
        (_, Page::Aim | Page::Settings, _) => Action::Page(Page::Main),
        (_, Page::Main, Press::Short) => Action::ToggleHold,
        (_, Page::Main, Press::Long) => Action::NextMode,
    }
}

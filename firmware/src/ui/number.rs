//! The big number with its unit, and the line below it: error, direction, blades, or what to do.

use core::fmt::Write as _;

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use evtach_core::Direction;
use heapless::String;

use super::text::{self, Align, Font, HUGE, Ink, MEDIUM, SMALL, width};
use super::theme::{self, BACK, BAD, DIM, FAINT, TEXT, area};
use crate::instrument::{Mode, Number, State, View};
use crate::sensor::usb::TROUBLE_BYTES;

/// Where the number ends.
const RIGHT: i32 = 396;
const BASELINE: i32 = 107;
const DETAILS_BASELINE: i32 = 134;
/// Where the unit begins.
const UNIT: i32 = 406;
const DASHES: &str = "-----";

pub fn changed(a: &View, b: &View) -> bool {
    let of = |v: &View| {
        (v.speed.map(|s| s.value), v.state, v.mode, v.rotor, alarmed(v), v.preferences.unit)
    };
    of(a) != of(b)
}

/// Whether the big number is beyond a limit.
fn alarmed(view: &View) -> bool {
    view.mode == Mode::Live && view.alarm.is_some_and(|(id, _)| Some(id) == view.rotor)
}

pub fn draw<D: DrawTarget<Color = Rgb565>>(target: &mut D, view: &View) -> Result<(), D::Error> {
    target.fill_solid(&area(0, 28, 480, 86), BACK)?;
    let end = Point::new(RIGHT, BASELINE);
    if let Some(speed) = view.speed {
        let old = view.mode == Mode::Live && view.state == State::Held;
        let colour = match () {
            () if alarmed(view) => BAD,
            () if old => DIM,
            () => TEXT,
        };
        write(target, &HUGE, end, speed.value, Ink { colour, paper: BACK })?;
    } else {
        let faint = Ink { colour: FAINT, paper: BACK };
        text::draw(target, &HUGE, DASHES, end, Align::Right, faint)?;
    }
    let ink = Ink { colour: DIM, paper: BACK };
    let at = Point::new(UNIT, BASELINE);
    text::draw(target, &MEDIUM, view.preferences.unit.as_str(), at, Align::Left, ink)?;
    if let Some(id) = view.rotor.filter(|_| view.speed.is_some()) {
        let ink = Ink { colour: theme::of_rotor(id), paper: BACK };
        let at = Point::new(UNIT, BASELINE - 57);
        text::draw(target, &MEDIUM, theme::letter(id), at, Align::Left, ink)?;
    }
    Ok(())
}

/// A number that ends at `right`, the zeros that only hold a place faint.
pub fn write<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    font: &Font,
    right: Point,
    number: Number,
    ink: Ink,
) -> Result<(), D::Error> {
    let mut digits = String::<12>::new();
    write!(digits, "{number}").ok();
    // What may panic for a text prints it: 5 KB of flash.
    let said = digits.len().saturating_sub(number.filled());
    let (said, filled) = digits.split_at_checked(said).unwrap_or((&digits, ""));
    let faint = Ink { colour: FAINT, ..ink };
    text::draw(target, font, filled, right, Align::Right, faint)?;
    let right = right - Point::new(width(font, filled), 0);
    text::draw(target, font, said, right, Align::Right, ink)
}

pub fn details_changed(a: &View, b: &View) -> bool {
    let of = |v: &View| {
        let found = (v.speed, v.state, v.trouble, v.direction, v.blades);
        (found, v.preferences.blades, v.preferences.unit)
    };
    of(a) != of(b)
}

pub fn draw_details<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    view: &View,
) -> Result<(), D::Error> {
    target.fill_solid(&area(0, 114, 480, 28), BACK)?;
    let left = Point::new(8, DETAILS_BASELINE);
    let ink = Ink { colour: DIM, paper: BACK };
    let advice = view.state.advice();
    if !advice.is_empty() {
        let ink = Ink { colour: TEXT, paper: BACK };
        let mut words = String::<TROUBLE_BYTES>::new();
        match view.trouble {
            Some(trouble) => write!(words, "{trouble}").ok(),
            None => words.push_str(advice).ok(),
        };
        text::draw(target, &SMALL, &words, left, Align::Left, ink)?;
    } else if let Some(direction) = view.direction {
        draw_turning(target, left, direction, view)?;
    }
    if let Some(speed) = view.speed.filter(|_| view.state.has_speed()) {
        let mut error = String::<16>::new();
        write!(error, "± {}", speed.error).ok();
        let right = Point::new(RIGHT, DETAILS_BASELINE);
        text::draw(target, &MEDIUM, &error, right, Align::Right, ink)?;
    }
    Ok(())
}

/// Direction and blades.
fn draw_turning<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    left: Point,
    direction: Direction,
    view: &View,
) -> Result<(), D::Error> {
    theme::draw_sense(target, left + Point::new(6, -6), 6, direction, DIM)?;
    let mut words = String::<48>::new();
    words.push_str(in_words(direction)).ok();
    if let Some(blades) = view.blades {
        let plural = if blades == 1 { "" } else { "s" };
        let set = if view.preferences.blades.is_some() { " set" } else { "" };
        write!(words, "  ·  {blades} blade{plural}{set}").ok();
    }
    let at = left + Point::new(20, 0);
    text::draw(target, &SMALL, &words, at, Align::Left, Ink { colour: DIM, paper: BACK })
}

const fn in_words(direction: Direction) -> &'static str {
    match direction {
        Direction::Cw => "clockwise",
        Direction::Ccw => "counter-clockwise",
    }
}

//! The settings page: what is kept over power cycles.

use core::fmt::Write as _;

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use heapless::String;

use super::keys::Key;
use super::text::{self, Align, Ink, MEDIUM, SMALL};
use super::theme::{BACK, DIM, PANEL, TEXT, area};
use crate::instrument::{Action, Setting, Step, Unit, View};

/// Top edge of the first row, and height of a row.
const TOP: i32 = 38;
const ROW: i32 = 40;
/// Width of a key, and from one to the next.
const KEY: u32 = 58;
const NEXT: i32 = 64;
/// Left edge of the first of three keys.
const THREE: i32 = 286;

type Value = String<24>;

pub fn changed(a: &View, b: &View) -> bool {
    (a.preferences, a.blades) != (b.preferences, b.blades)
}

pub fn draw<D: DrawTarget<Color = Rgb565>>(target: &mut D, view: &View) -> Result<(), D::Error> {
    target.fill_solid(&area(0, 0, 480, 236), BACK)?;
    let ink = Ink { colour: TEXT, paper: BACK };
    text::draw(target, &MEDIUM, "Settings", Point::new(8, 26), Align::Left, ink)?;
    for (i, (name, value)) in rows(view).into_iter().enumerate() {
        let top = TOP + i as i32 * ROW;
        target.fill_solid(&area(8, top - 4, 464, 1), PANEL)?;
        let baseline = top + 22;
        let dim = Ink { colour: DIM, paper: BACK };
        text::draw(target, &SMALL, name, Point::new(8, baseline), Align::Left, dim)?;
        text::draw(target, &SMALL, &value, Point::new(132, baseline), Align::Left, ink)?;
    }
    for key in keys(view) {
        key.draw(target)?;
    }
    Ok(())
}

/// Name and value of each row, from the top.
fn rows(view: &View) -> [(&'static str, Value); 5] {
    let limit = |rpm: Option<f32>| {
        let mut value = Value::new();
        match rpm {
            Some(rpm) => write!(value, "{} rpm", (rpm + 0.5) as u32).ok(),
            None => value.push_str("off").ok(),
        };
        value
    };
    let mut blades = Value::new();
    match (view.preferences.blades, view.blades) {
        (Some(set), _) => write!(blades, "{set} set").ok(),
        (None, Some(found)) => write!(blades, "found: {found}").ok(),
        (None, None) => blades.push_str("found").ok(),
    };
    let mut trim = Value::new();
    write_tenths(&mut trim, view.preferences.clock_trim_ppm);
    trim.push_str(" ppm").ok();
    [
        ("Unit", Value::new()),
        ("Blades", blades),
        ("Alarm above", limit(view.preferences.alarm.high_rpm)),
        ("Alarm below", limit(view.preferences.alarm.low_rpm)),
        ("Clock fast by", trim),
    ]
}

/// With a sign and one decimal.
fn write_tenths(words: &mut Value, value: f32) {
    let half = if value < 0.0 { -0.5 } else { 0.5 };
    let tenths = (value * 10.0 + half) as i32;
    let sign = match tenths {
        0 => "",
        1.. => "+",
        _ => "-",
    };
    let size = tenths.unsigned_abs();
    write!(words, "{sign}{}.{}", size / 10, size % 10).ok();
}

/// Everything that can be pressed above the row at the bottom.
pub fn keys(view: &View) -> impl Iterator<Item = Key> {
    let key = |row: i32, x: i32, word, action, chosen| Key {
        area: area(x, TOP + row * ROW, KEY, 32),
        word,
        action,
        chosen,
    };
    let unit = view.preferences.unit;
    let units = Unit::ALL.into_iter().zip(0..).map(move |(one, i)| {
        key(0, THREE + (i - 1) * NEXT, one.as_str(), Action::Unit(one), one == unit)
    });
    let found = view.preferences.blades.is_none();
    let blades = [
        ("FIND", Action::Blades(None), found),
        ("÷2", Action::BladesHalf, false),
        ("×2", Action::BladesTwice, false),
    ];
    let alarm = view.preferences.alarm;
    let steps = [
        (2, Setting::AlarmHigh, "OFF", alarm.high_rpm.is_none()),
        (3, Setting::AlarmLow, "OFF", alarm.low_rpm.is_none()),
        (4, Setting::ClockTrim, "ZERO", view.preferences.clock_trim_ppm == 0.0),
    ];
    let blades = blades
        .into_iter()
        .zip(0..)
        .map(move |((word, action, chosen), i)| key(1, THREE + i * NEXT, word, action, chosen));
    let steps = steps.into_iter().flat_map(move |(row, setting, off, is_off)| {
        let step = |step| Action::Step(setting, step);
        [
            key(row, THREE, off, step(Step::Off), is_off),
            key(row, THREE + NEXT, "–", step(Step::Less), false),
            key(row, THREE + 2 * NEXT, "+", step(Step::More), false),
        ]
    });
    units.chain(blades).chain(steps)
}

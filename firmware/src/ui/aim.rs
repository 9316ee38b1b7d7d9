//! Beside the large picture: state, speeds, and how many events arrive.

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use heapless::String;

use super::number;
use super::text::{self, Align, Ink, MEDIUM, SMALL};
use super::theme::{self, BACK, DIM, FAINT, TEXT, area};
use crate::instrument::View;

const LEFT: i32 = 322;
const RIGHT: i32 = 472;

pub fn changed(a: &View, b: &View) -> bool {
    (a.state, &a.rotors, a.rate, a.preferences.unit)
        != (b.state, &b.rotors, b.rate, b.preferences.unit)
}

pub fn draw<D: DrawTarget<Color = Rgb565>>(target: &mut D, view: &View) -> Result<(), D::Error> {
    target.fill_solid(&area(LEFT - 4, 0, 162, 236), BACK)?;
    let ink = Ink { colour: theme::of_state(view.state), paper: BACK };
    text::draw(target, &SMALL, view.state.word(), Point::new(LEFT, 20), Align::Left, ink)?;
    for (i, row) in view.rotors.iter().take(6).enumerate() {
        let baseline = 52 + 26 * i as i32;
        let ink = Ink { colour: theme::of_rotor(row.id), paper: BACK };
        text::draw(
            target,
            &MEDIUM,
            theme::letter(row.id),
            Point::new(LEFT, baseline),
            Align::Left,
            ink,
        )?;
        let right = Point::new(RIGHT, baseline);
        if let Some(speed) = row.speed {
            number::write(target, &MEDIUM, right, speed.value, Ink { colour: TEXT, paper: BACK })?;
        } else {
            let ink = Ink { colour: FAINT, paper: BACK };
            text::draw(target, &MEDIUM, "---", right, Align::Right, ink)?;
        }
    }
    let mut words = String::<24>::new();
    super::strip::write_rate(&mut words, view.rate.events_per_s);
    let ink = Ink { colour: DIM, paper: BACK };
    text::draw(target, &SMALL, &words, Point::new(LEFT, 228), Align::Left, ink)?;
    let unit = view.preferences.unit.as_str();
    text::draw(target, &SMALL, unit, Point::new(RIGHT, 228), Align::Right, ink)
}

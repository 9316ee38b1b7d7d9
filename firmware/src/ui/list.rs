//! The rotors with their letters, and what is remembered of the one shown.

use core::fmt::Write as _;

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use heapless::String;

use super::number;
use super::text::{self, Align, Ink, SMALL};
use super::theme::{self, BACK, BAD, DIM, FAINT, RAISED, TEXT, area};
use crate::instrument::{Row, State, Statistics, View};

/// Left edge, top edge, and height of a row.
pub const LEFT: i32 = 138;
pub const TOP: i32 = 142;
pub const ROW: i32 = 15;
/// Width of the list.
pub const WIDE: u32 = 168;
/// Where values end, from the left edge.
const VALUE: i32 = 98;
/// Rows that there is room for.
pub const ROWS: usize = 6;

pub fn changed(a: &View, b: &View) -> bool {
    (&a.rotors, a.rotor, a.statistics, a.state, a.preferences.blades)
        != (&b.rotors, b.rotor, b.statistics, b.state, b.preferences.blades)
}

pub fn draw<D: DrawTarget<Color = Rgb565>>(target: &mut D, view: &View) -> Result<(), D::Error> {
    target.fill_solid(&area(LEFT - 4, TOP, WIDE + 8, 94), BACK)?;
    for (i, row) in view.rotors.iter().take(ROWS).enumerate() {
        let top = TOP + i as i32 * ROW;
        let chosen = view.rotors.len() > 1 && view.rotor == Some(row.id);
        let paper = if chosen { RAISED } else { BACK };
        if chosen {
            target.fill_solid(&area(LEFT - 4, top, WIDE + 8, ROW as u32), paper)?;
        }
        draw_row(target, top + 13, row, paper)?;
    }
    if view.rotors.len() > ROWS - 3 {
        return Ok(());
    }
    if let Some(blades) = view.preferences.blades.filter(|_| !view.state.has_speed()) {
        let mut words = String::<16>::new();
        write!(words, "{blades} blades set").ok();
        let at = Point::new(LEFT, TOP + 2 * ROW + 13);
        text::draw(target, &SMALL, &words, at, Align::Left, Ink { colour: DIM, paper: BACK })?;
    }
    view.statistics.map_or(Ok(()), |statistics| draw_statistics(target, &statistics))
}

fn draw_row<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    baseline: i32,
    row: &Row,
    paper: Rgb565,
) -> Result<(), D::Error> {
    let at = |x: i32| Point::new(LEFT + x, baseline);
    let letter = Ink { colour: theme::of_rotor(row.id), paper };
    text::draw(target, &SMALL, theme::letter(row.id), at(0), Align::Left, letter)?;
    let Some(speed) = row.speed else {
        let ink = Ink { colour: FAINT, paper };
        let word = State::from(row.status).word();
        return text::draw(target, &SMALL, word, at(18), Align::Left, ink);
    };
    let colour = if row.beyond.is_some() { BAD } else { TEXT };
    number::write(target, &SMALL, at(VALUE), speed.value, Ink { colour, paper })?;
    let dim = Ink { colour: DIM, paper };
    if let Some(direction) = row.direction {
        theme::draw_sense(target, at(VALUE + 11) - Point::new(0, 5), 4, direction, DIM)?;
    }
    if let Some(permille) = row.off_mean_permille {
        let mut off = String::<12>::new();
        let (sign, size) = (if permille < 0 { '-' } else { '+' }, permille.unsigned_abs());
        write!(off, "{sign}{}.{}%", size / 10, size % 10).ok();
        text::draw(target, &SMALL, &off, at(WIDE as i32), Align::Right, dim)?;
    }
    Ok(())
}

fn draw_statistics<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    statistics: &Statistics,
) -> Result<(), D::Error> {
    let lines = [("max", statistics.max), ("mean", statistics.mean), ("min", statistics.min)];
    for (i, (name, value)) in lines.into_iter().enumerate() {
        let baseline = TOP + (ROWS - 3 + i) as i32 * ROW + 14;
        let ink = Ink { colour: DIM, paper: BACK };
        text::draw(target, &SMALL, name, Point::new(LEFT, baseline), Align::Left, ink)?;
        if let Some(value) = value {
            let right = Point::new(LEFT + VALUE, baseline);
            number::write(target, &SMALL, right, value.value, Ink { colour: TEXT, paper: BACK })?;
        }
    }
    Ok(())
}

/// The rotor whose row a finger is on.
pub fn rotor_at(view: &View, at: Point) -> Option<u8> {
    let list = area(LEFT - 4, TOP, WIDE + 8, 94);
    let row = usize::try_from((at.y - TOP) / ROW).ok()?;
    view.rotors.get(row).filter(|_| list.contains(at) && row < ROWS).map(|row| row.id)
}

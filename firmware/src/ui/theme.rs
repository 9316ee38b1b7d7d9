//! Colours, measures, and the few shapes that everything is made of.

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Circle, PrimitiveStyle, Rectangle, StyledDrawable as _};
use evtach_core::Direction;

use crate::instrument::State;

/// Size of the screen in pixels.
pub const SIZE: Size = Size::new(480, 272);

/// From eight bits a channel.
const fn rgb(red: u8, green: u8, blue: u8) -> Rgb565 {
    Rgb565::new(red >> 3, green >> 2, blue >> 3)
}

/// What everything stands on.
pub const BACK: Rgb565 = rgb(10, 13, 18);
/// Keys, and places where something is to come.
pub const PANEL: Rgb565 = rgb(28, 34, 44);
/// What is chosen, or pressed.
pub const RAISED: Rgb565 = rgb(52, 64, 82);
/// Numbers.
pub const TEXT: Rgb565 = rgb(244, 247, 250);
/// Labels, and numbers of the past.
pub const DIM: Rgb565 = rgb(142, 154, 170);
/// Dashes, and zeros that only hold a place.
pub const FAINT: Rgb565 = rgb(78, 89, 105);
/// All is well.
pub const GOOD: Rgb565 = rgb(64, 220, 150);
/// Look at it.
pub const WARN: Rgb565 = rgb(255, 184, 76);
/// Act.
pub const BAD: Rgb565 = rgb(255, 96, 96);
/// A zone to keep out of.
pub const BAD_ZONE: Rgb565 = rgb(96, 32, 36);
/// What is neither good nor bad.
pub const ACCENT: Rgb565 = rgb(92, 190, 255);
/// The error about a reading of the trend.
pub const ACCENT_ZONE: Rgb565 = rgb(28, 66, 96);

/// Colours of the letters, in their order.
const LETTERS: [Rgb565; 8] = [
    rgb(92, 190, 255),
    rgb(255, 184, 76),
    rgb(64, 220, 150),
    rgb(255, 128, 200),
    rgb(190, 160, 255),
    rgb(240, 230, 90),
    rgb(255, 140, 110),
    rgb(120, 230, 230),
];

/// Colour of a rotor.
pub fn of_rotor(id: u8) -> Rgb565 {
    LETTERS[usize::from(id) % LETTERS.len()]
}

/// Colour of a state's word.
pub const fn of_state(state: State) -> Rgb565 {
    use evtach_core::Reason;
    match state {
        State::Locked => GOOD,
        State::Coarse => WARN,
        State::Held => DIM,
        State::Refused(Reason::Searching) => ACCENT,
        State::Refused(Reason::NoSensor | Reason::Saturated | Reason::Fault) | State::Fault(_) => {
            BAD
        }
        State::Refused(_) => WARN,
    }
}

/// A letter as text: A to Z, beyond that a question mark.
pub fn letter(id: u8) -> &'static str {
    const ALPHABET: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZ";
    let at = usize::from(id);
    ALPHABET.get(at..at + 1).unwrap_or("?")
}

/// A rectangle by its edges.
pub const fn area(x: i32, y: i32, width: u32, height: u32) -> Rectangle {
    Rectangle::new(Point::new(x, y), Size::new(width, height))
}

/// Fills a rectangle with rounded corners: by rows, because embedded-graphics' own takes 6 KB of flash.
///
/// # Errors
///
/// Whatever the target reports.
pub fn fill_round<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    area: Rectangle,
    colour: Rgb565,
) -> Result<(), D::Error> {
    /// Pixels left out at either end of the first rows and the last.
    const INSETS: [u32; 4] = [4, 2, 1, 1];
    let Rectangle { top_left, size } = area;
    for (y, inset) in INSETS.into_iter().enumerate() {
        let row = Size::new(size.width.saturating_sub(2 * inset), 1);
        for y in [y as i32, size.height as i32 - 1 - y as i32] {
            let left = top_left + Point::new(inset as i32, y);
            target.fill_solid(&Rectangle::new(left, row), colour)?;
        }
    }
    let rows = INSETS.len() as u32;
    let middle = Size::new(size.width, size.height.saturating_sub(2 * rows));
    target.fill_solid(&Rectangle::new(top_left + Point::new(0, rows as i32), middle), colour)
}

/// A circle with an arrow: down on its right side is clockwise.
///
/// # Errors
///
/// Whatever the target reports.
pub fn draw_sense<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    centre: Point,
    radius: i32,
    direction: Direction,
    colour: Rgb565,
) -> Result<(), D::Error> {
    let circle = Circle::with_center(centre, 2 * radius as u32);
    circle.draw_styled(&PrimitiveStyle::with_stroke(colour, 1), target)?;
    let down = if direction == Direction::Cw { 1 } else { -1 };
    // The arrow's head, by rows as well.
    for (y, half) in [(-1, 3), (0, 2), (1, 1), (2, 0)] {
        let left = centre + Point::new(radius - 1 - half, y * down);
        target.fill_solid(&Rectangle::new(left, Size::new(2 * half as u32 + 1, 1)), colour)?;
    }
    Ok(())
}

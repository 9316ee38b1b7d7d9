//! What the camera sees, with the rotors that were found: small on the main page, large for aiming.

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Circle, PrimitiveStyle, Rectangle, StyledDrawable as _};

use super::text::{self, Align, Ink, SMALL};
use super::theme::{self, PANEL, area};
use crate::instrument::{BRIGHTEST, Picture, View};

/// Room for the small picture; beside it, what the list begins with.
pub const THUMBNAIL: Rectangle = area(8, 143, 122, 92);
/// Room for the large one.
const LARGE: Rectangle = area(8, 6, 304, 228);

pub fn changed(a: &View, b: &View) -> bool {
    (a.picture, &a.rotors, a.rotor) != (b.picture, &b.rotors, b.rotor)
}

pub fn draw_thumbnail<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    picture: &Picture,
    view: &View,
) -> Result<(), D::Error> {
    draw(target, THUMBNAIL, picture, view)
}

pub fn draw_large<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    picture: &Picture,
    view: &View,
) -> Result<(), D::Error> {
    draw(target, LARGE, picture, view)?;
    let Point { x, y } = LARGE.center();
    // A mark to aim by.
    target.fill_solid(&area(x - 8, y, 17, 1), theme::DIM)?;
    target.fill_solid(&area(x, y - 8, 1, 17), theme::DIM)
}

fn draw<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    room: Rectangle,
    picture: &Picture,
    view: &View,
) -> Result<(), D::Error> {
    let shown = fit(room, picture);
    if shown.size != room.size || picture.columns() == 0 {
        target.fill_solid(&room, PANEL)?;
    }
    if picture.columns() == 0 {
        return Ok(());
    }
    let Size { width, height } = shown.size;
    let (wide, high) = (width as usize, height as usize);
    let (columns, rows) = (picture.columns(), picture.rows());
    // Where a cell begins in pixels.
    let edge = |cell: usize, cells: usize, pixels: usize| (cell * pixels).div_ceil(cells) as i32;
    for row in 0..rows {
        let (top, bottom) = (edge(row, rows, high), edge(row + 1, rows, high));
        let mut column = 0;
        // Neighbours of one level at once: a picture is mostly dark.
        while column < columns {
            let level = picture.level(column, row);
            let left = edge(column, columns, wide);
            while column < columns && picture.level(column, row) == level {
                column += 1;
            }
            let size =
                Size::new((edge(column, columns, wide) - left) as u32, (bottom - top) as u32);
            let run = Rectangle::new(shown.top_left + Point::new(left, top), size);
            target.fill_solid(&run, LEVELS[usize::from(level)])?;
        }
    }
    // Nothing of a rotor beyond the picture's edge.
    let mut inside = target.clipped(&shown);
    let sensor_px = columns as f32 * f32::from(picture.cell_px());
    let scale = width as f32 / sensor_px;
    for row in &view.rotors {
        let at = |px: f32| (px * scale) as i32;
        let centre = shown.top_left + Point::new(at(row.x_px), at(row.y_px));
        let radius = at(row.radius_px).clamp(2, 1_000);
        let colour = theme::of_rotor(row.id);
        let stroke = if view.rotor == Some(row.id) { 2 } else { 1 };
        Circle::with_center(centre, 2 * radius as u32 + 1)
            .draw_styled(&PrimitiveStyle::with_stroke(colour, stroke), &mut inside)?;
        let below = Point::new(0, 5);
        let ink = Ink { colour, paper: LEVELS[4] };
        text::draw(&mut inside, &SMALL, theme::letter(row.id), centre + below, Align::Centre, ink)?;
    }
    Ok(())
}

/// The largest place within `room` that has the picture's shape; all of it without a picture.
fn fit(room: Rectangle, picture: &Picture) -> Rectangle {
    let (columns, rows) = (picture.columns() as u32, picture.rows() as u32);
    if columns == 0 || rows == 0 {
        return room;
    }
    let Size { width, height } = room.size;
    let size = if columns * height > rows * width {
        Size::new(width, (rows * width / columns).max(1))
    } else {
        Size::new((columns * height / rows).max(1), height)
    };
    let margin = room.size - size;
    Rectangle::new(
        room.top_left + Point::new(margin.width as i32 / 2, margin.height as i32 / 2),
        size,
    )
}

/// From dark to bright, bluish so that the rotors' colours stand out.
const LEVELS: [Rgb565; BRIGHTEST as usize + 1] = {
    let mut levels = [PANEL; BRIGHTEST as usize + 1];
    let mut i = 0;
    while i <= BRIGHTEST {
        levels[i as usize] = Rgb565::new(1 + i, 3 + 3 * i, 4 + i * 9 / 5);
        i += 1;
    }
    levels
};

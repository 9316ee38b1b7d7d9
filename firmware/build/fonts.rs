//! Packs the fonts: as the macro lays them out they take 40 KB of flash, packed 13 KB.

use std::error::Error;
use std::fmt::Write as _;

use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use mplusfonts::image::Colors as _;

#[path = "../src/ui/fonts.rs"]
mod mplus;

use mplus::{FONTS, Source};

/// All fonts as constants of the type that `src/ui/text.rs` reads.
pub fn packed() -> Result<String, Box<dyn Error>> {
    let mut code = String::new();
    for font in FONTS {
        write(&mut code, &font)?;
    }
    Ok(code)
}

fn write(code: &mut String, source: &Source) -> Result<(), Box<dyn Error>> {
    let Source { name, about, font, row, others } = source;
    let mut runs = Vec::new();
    let mut glyphs = String::new();
    for letter in row.clone().chain(others.chars()) {
        let key = letter.to_string();
        let entry = font.charmap.get(&key);
        if entry.key != key {
            // A gap in the row.
            writeln!(glyphs, "        Glyph::NONE,")?;
            continue;
        }
        let advance_px = (entry.advance_width_to)("");
        for next in row.clone().chain(others.chars()) {
            let next_key = font.charmap.get(&next.to_string()).key;
            if (entry.advance_width_to)(next_key) != advance_px || entry.glyph.next.is_some() {
                return Err(
                    format!("the device can neither kern {letter}{next} nor compose").into()
                );
            }
        }
        // 26.6 fixed point.
        let advance = (64.0 * advance_px).round() as u16;
        let image = entry.glyph.images.get(0).mul_offset(1, -1);
        let Rectangle { top_left, size } = image.bounding_box();
        let at = u16::try_from(runs.len())?;
        pack(image.colors().into_iter().map(|level| level.luma()), &mut runs);
        let (x, y) = (i8::try_from(top_left.x)?, i8::try_from(top_left.y)?);
        let (width, height) = (u8::try_from(size.width)?, u8::try_from(size.height)?);
        writeln!(
            glyphs,
            "        Glyph {{ advance: {advance}, at: {at}, x: {x}, y: {y}, width: {width}, height: {height} }},"
        )?;
    }
    let (first, last) = (row.start(), row.end());
    write!(
        code,
        "/// {about}\npub static {name}: Font = Font {{\n    row: ({first:?}, {last:?}),\n    others: {others:?},\n    \
         glyphs: &[\n{glyphs}    ],\n    runs: &{runs:?},\n}};\n"
    )?;
    Ok(())
}

/// Writes pixels as runs of a level: four bits each, two of level and two of length, which is 1 to 3, or 4 and what the next
/// four bits add; after 15, those behind them add too.
fn pack(levels: impl Iterator<Item = u8>, packed: &mut Vec<u8>) {
    let mut runs: Vec<(u8, usize)> = Vec::new();
    for level in levels {
        match runs.last_mut() {
            Some((last, length)) if *last == level => *length += 1,
            _ => runs.push((level, 1)),
        }
    }
    let mut nibbles = Vec::new();
    for (level, length) in runs {
        nibbles.push((level << 2) | (length.min(4) as u8 - 1));
        if let Some(mut more) = length.checked_sub(4) {
            while more >= 15 {
                nibbles.push(15);
                more -= 15;
            }
            nibbles.push(more as u8);
        }
    }
    packed.extend(nibbles.chunks(2).map(|pair| (pair[0] << 4) | pair.get(1).unwrap_or(&0)));
}

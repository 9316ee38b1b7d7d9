//! Lettering: fonts that the build script has packed, and how a line of text is set in them.

use core::iter;

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;

/// Widths are told as TrueType tells them, in 26.6 fixed point.
const UNITS_A_PX: i32 = 64;

/// A font with the characters that the screen uses.
pub struct Font {
    /// The first and the last of the characters that follow each other.
    row: (char, char),
    /// And others.
    others: &'static str,
    /// In this order.
    glyphs: &'static [Glyph],
    /// The pixels of all of them: runs of a level, four bits each. See `build/fonts.rs`.
    runs: &'static [u8],
}

/// A letter.
struct Glyph {
    /// From it to the next one, in [`UNITS_A_PX`]ths of a pixel.
    advance: u16,
    /// Where its pixels begin in the font's.
    at: u16,
    /// Its corner, from the point where it stands on the baseline.
    x: i8,
    y: i8,
    width: u8,
    height: u8,
}

include!(concat!(env!("OUT_DIR"), "/fonts.rs"));

impl Glyph {
    /// What stands for a character that the font does not have.
    const NONE: Self = Self { advance: 0, at: 0, x: 0, y: 0, width: 0, height: 0 };
}

impl Font {
    fn glyph(&self, letter: char) -> &Glyph {
        let (first, last) = self.row;
        let index = if (first..=last).contains(&letter) {
            letter as usize - first as usize
        } else {
            let others = last as usize - first as usize + 1;
            match self.others.chars().position(|other| other == letter) {
                Some(index) => others + index,
                None => return &Glyph::NONE,
            }
        };
        self.glyphs.get(index).unwrap_or(&Glyph::NONE)
    }

    /// The letters of a text with how far in pixels each is from the start.
    fn set<'t>(&self, text: &'t str) -> impl Iterator<Item = (i32, &Glyph)> + use<'_, 't> {
        text.chars().scan(0, |x, letter| {
            let glyph = self.glyph(letter);
            let at_px = *x / UNITS_A_PX;
            *x += i32::from(glyph.advance);
            Some((at_px, glyph))
        })
    }

    /// The runs of one level of a glyph's pixels, row by row: the level, 0 to 3, and the length.
    fn runs(&self, glyph: &Glyph) -> impl Iterator<Item = (u8, i32)> + use<'_> {
        let packed = self.runs.get(usize::from(glyph.at)..).unwrap_or_default();
        let mut nibbles = packed.iter().flat_map(|pair| [pair >> 4, pair & 15]);
        iter::from_fn(move || {
            let head = nibbles.next()?;
            let mut length = i32::from(head & 3) + 1;
            while length >= 4 {
                let more = nibbles.next()?;
                length += i32::from(more);
                if more < 15 {
                    break;
                }
            }
            Some((head >> 2, length))
        })
    }
}

/// Where a text stands relative to its point, which is on the baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Begins there.
    Left,
    /// Is centred there.
    Centre,
    /// Ends there.
    Right,
}

/// Ink on paper: the paper's colour is needed for the edges of the letters.
#[derive(Clone, Copy, Debug)]
pub struct Ink {
    /// Colour of the letters.
    pub colour: Rgb565,
    /// Colour of what they stand on.
    pub paper: Rgb565,
}

impl Ink {
    /// The colour of a level, 0 to 3: paper, ink, and two between.
    fn level(self, level: u8) -> Rgb565 {
        let mix = |paper: u8, ink: u8| {
            let (paper, ink) = (i32::from(paper), i32::from(ink));
            // To the nearest.
            ((6 * paper + 2 * (ink - paper) * i32::from(level) + 3) / 6) as u8
        };
        let Self { colour, paper } = self;
        let red = mix(paper.r(), colour.r());
        Rgb565::new(red, mix(paper.g(), colour.g()), mix(paper.b(), colour.b()))
    }
}

/// Width of a text in pixels.
#[must_use]
pub fn width(font: &Font, text: &str) -> i32 {
    let advances = text.chars().map(|letter| i32::from(font.glyph(letter).advance));
    advances.sum::<i32>() / UNITS_A_PX
}

/// Draws one line of text. Characters that the font does not have leave nothing.
///
/// # Errors
///
/// Whatever the target reports.
pub fn draw<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    font: &Font,
    text: &str,
    at: Point,
    align: Align,
    ink: Ink,
) -> Result<(), D::Error> {
    let left = match align {
        Align::Left => at.x,
        Align::Centre => at.x - width(font, text) / 2,
        Align::Right => at.x - width(font, text),
    };
    let colours = [0, 1, 2, 3].map(|level| ink.level(level));
    for (x, glyph) in font.set(text) {
        let corner = Point::new(left + x + i32::from(glyph.x), at.y + i32::from(glyph.y));
        let (width, height) = (i32::from(glyph.width), i32::from(glyph.height));
        let mut place = Point::zero();
        for (level, mut length) in font.runs(glyph) {
            while length > 0 && place.y < height {
                let here = length.min(width - place.x);
                // Only the ink: boxes of neighbours may overlap.
                if level > 0 {
                    let run = Rectangle::new(corner + place, Size::new(here as u32, 1));
                    target.fill_solid(&run, colours[usize::from(level)])?;
                }
                length -= here;
                place.x += here;
                if place.x == width {
                    place = Point::new(0, place.y + 1);
                }
            }
            if place.y == height {
                break;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::string::ToString as _;
    use std::vec::Vec;

    use mplusfonts::image::Colors as _;

    use super::super::fonts::FONTS;
    use super::*;

    #[test]
    fn every_letter_is_the_one_that_was_packed() {
        for (source, packed) in FONTS.iter().zip([&SMALL, &MEDIUM, &HUGE]) {
            assert!(!source.about.is_empty());
            let mut letters = 0;
            for letter in source.row.clone().chain(source.others.chars()) {
                let key = letter.to_string();
                let entry = source.font.charmap.get(&key);
                let glyph = packed.set(&key).next().map(|(_, glyph)| glyph);
                let glyph = glyph.expect(&key);
                if entry.key != key {
                    assert_eq!((glyph.width, glyph.advance), (0, 0), "a gap in the row");
                    continue;
                }
                let image = entry.glyph.images.get(0).mul_offset(1, -1);
                let levels: Vec<u8> =
                    image.colors().into_iter().map(|level| level.luma()).collect();
                let runs = packed
                    .runs(glyph)
                    .flat_map(|(level, length)| iter::repeat_n(level, length as usize));
                let unpacked: Vec<u8> = runs.take(levels.len()).collect();
                assert_eq!(unpacked, levels, "{} {letter}", source.name);
                let corner = Point::new(glyph.x.into(), glyph.y.into());
                let size = Size::new(glyph.width.into(), glyph.height.into());
                assert_eq!(Rectangle::new(corner, size), image.bounding_box(), "{letter}");
                let advance_px = f32::from(glyph.advance) / UNITS_A_PX as f32;
                let off_px = advance_px - (entry.advance_width_to)("");
                assert!(off_px.abs() <= 0.5 / UNITS_A_PX as f32, "{letter} is {off_px} px off");
                letters += 1;
            }
            assert!(letters >= 12, "{} has {letters}", source.name);
        }
    }

    #[test]
    fn what_a_font_lacks_takes_no_room() {
        for letter in ["/", "a", "°", "–"] {
            assert_eq!(width(&HUGE, letter), 0, "{letter}");
        }
        assert_eq!(width(&SMALL, "1°2"), width(&SMALL, "12"));
    }
}

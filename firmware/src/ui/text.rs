//! Lettering: M+ FONTS by Coji Morishita (SIL Open Font License), rasterised at compile time to four grey levels.

use embedded_graphics::pixelcolor::{Gray2, Rgb565};
use embedded_graphics::prelude::*;
use mplusfonts::color::{Colormap, Linear as _};
use mplusfonts::image::Colors as _;
use mplusfonts::{BitmapFont, mplus};

/// A font with the characters that the screen uses.
pub type Font = BitmapFont<'static, Gray2, 1>;

/// Labels: capitals of 11 px.
pub static SMALL: Font = mplus!(1, 500, 15, true, 1, 2, ' '..='~', ["±", "×", "÷", "·", "–"]);

/// Values: capitals of 16 px.
pub static MEDIUM: Font = mplus!(1, 600, 22, true, 1, 2, ' '..='~', ["±", "×", "÷", "·", "–"]);

/// The number: digits of 73 px, all equally wide.
pub static HUGE: Font = mplus!(1, 600, 100, true, 1, 2, '0'..='9', [".", "-"]);

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

/// Width of a text in pixels.
#[must_use]
pub fn width(font: &Font, text: &str) -> i32 {
    let mut glyphs = Glyphs::new(font, text);
    while glyphs.next().is_some() {}
    glyphs.x as i32
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
    let colours: Colormap<Rgb565, 4> = Colormap::linear(ink.paper, ink.colour);
    let paper = Gray2::new(0);
    for (x, entry) in Glyphs::new(font, text) {
        let image = entry.glyph.images.get(0).mul_offset(1, -1).add_offset(left + x, at.y);
        let levels = image.colors().into_iter();
        // Only the ink: boxes of neighbours may overlap.
        let pixels = image.bounding_box().points().zip(levels);
        let inked = pixels.filter(|(_, level)| *level != paper);
        target.draw_iter(inked.map(|(point, level)| Pixel(point, colours.get(level))))?;
    }
    Ok(())
}

/// The characters of a text with their places.
struct Glyphs<'t> {
    font: &'t Font,
    rest: &'t str,
    before: Option<&'t Entry>,
    x: f32,
}

type Entry = mplusfonts::CharmapEntry<'static, Gray2, 1>;

impl<'t> Glyphs<'t> {
    const fn new(font: &'t Font, text: &'t str) -> Self {
        Self { font, rest: text, before: None, x: 0.0 }
    }
}

impl<'t> Iterator for Glyphs<'t> {
    type Item = (i32, &'t Entry);

    fn next(&mut self) -> Option<Self::Item> {
        let entry = self.font.charmap.get(self.rest);
        let key = if self.rest.is_empty() { "" } else { entry.key };
        if let Some(before) = self.before.take() {
            self.x += (before.advance_width_to)(key);
        }
        let mut chars = self.rest.chars();
        chars.next()?;
        self.rest = chars.as_str();
        self.before = Some(entry);
        Some((self.x as i32, entry))
    }
}

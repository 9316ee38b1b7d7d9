//! Lettering: M+ FONTS by Coji Morishita (SIL Open Font License), rasterised at compile time to four grey levels.
//!
//! The build script packs what is here, and a test compares.

use core::ops::RangeInclusive;

use embedded_graphics::pixelcolor::Gray2;
use mplusfonts::{BitmapFont, mplus};

/// A font with the characters that the screen uses.
pub struct Source {
    /// What the device calls it.
    pub name: &'static str,
    /// What it is for.
    pub about: &'static str,
    /// The font.
    pub font: BitmapFont<'static, Gray2, 1>,
    /// Characters, of which it may lack some.
    pub row: RangeInclusive<char>,
    /// And others.
    pub others: &'static str,
}

/// All fonts.
pub const FONTS: [Source; 3] = [
    Source {
        name: "SMALL",
        about: "Labels: capitals of 11 px.",
        font: mplus!(
            1,
            500,
            15,
            true,
            1,
            2,
            '\''..=')',
            '+'..=';',
            'A'..='Z',
            'a'..='z',
            [" ", "%", "=", "?", "±", "×", "÷", "·", "–"]
        ),
        row: ' '..='z',
        others: "±×÷·–",
    },
    Source {
        name: "MEDIUM",
        about: "Values, letters of rotors and units: capitals of 16 px.",
        font: mplus!(
            1,
            600,
            22,
            true,
            1,
            2,
            '-'..='Z',
            [" ", "±", "a", "d", "e", "g", "i", "m", "n", "p", "r", "s", "t", "z"]
        ),
        row: '-'..='Z',
        others: " ±adegimnprstz",
    },
    Source {
        name: "HUGE",
        about: "The number: digits of 73 px, all equally wide.",
        font: mplus!(1, 600, 100, true, 1, 2, '0'..='9', [".", "-"]),
        row: '-'..='9',
        others: "",
    },
];

//! A measured value as decimal digits, no more of them than its error supports.

use core::fmt;

/// Digits shown at most: an f32 holds seven, and the last of them is noise. With a point there is room for one less.
const MOST_DIGITS: u32 = 6;

/// Decimals shown at most.
const MOST_DECIMALS: u8 = 3;

/// A decimal number, held as a whole one so that no float has to be written out on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Number {
    scaled: u32,
    decimals: u8,
    filled: u8,
}

impl Number {
    /// The digits of `value` down to the place of the first digit of `sigma`, which is its standard error.
    ///
    /// `None` for what has no digit to show: not a number, negative, beyond six digits, or smaller than its error.
    #[must_use]
    pub fn supported(value: f32, sigma: f32) -> Option<Self> {
        let believed = value.is_finite() && sigma.is_finite() && sigma >= 0.0 && value > 0.0;
        if !believed || value > 999_999.0 || sigma >= value {
            return None;
        }
        let coarsest = (0..MOST_DIGITS as u8).rev().find(|place| power(*place) <= sigma);
        if let Some(filled) = coarsest {
            let scaled = rounded(value / power(filled)) * 10_u32.pow(u32::from(filled));
            return Some(Self { scaled, decimals: 0, filled });
        }
        let by_error = (1..MOST_DECIMALS).find(|d| 1.0 / power(*d) <= sigma);
        // As many as when it is rounded up.
        let whole_digits = (1..MOST_DIGITS as u8).find(|digits| value + 0.5 < power(*digits));
        let by_digits = (MOST_DIGITS as u8 - 1).saturating_sub(whole_digits.unwrap_or(u8::MAX));
        let decimals = by_error.unwrap_or(MOST_DECIMALS).min(by_digits);
        Some(Self { scaled: rounded(value * power(decimals)), decimals, filled: 0 })
    }

    /// Two digits of a standard error, never less than it by more than rounding, and never zero.
    #[must_use]
    pub fn of_error(sigma: f32) -> Option<Self> {
        if !(0.0..=99_999.0).contains(&sigma) {
            return None;
        }
        let tens = (1..5).rev().find(|place| power(place + 1) <= sigma);
        if let Some(filled) = tens {
            let scaled = rounded(sigma / power(filled)) * 10_u32.pow(u32::from(filled));
            return Some(Self { scaled, decimals: 0, filled });
        }
        let decimals = (0..MOST_DECIMALS).find(|d| sigma * power(*d) >= 10.0);
        let decimals = decimals.unwrap_or(MOST_DECIMALS);
        Some(Self { scaled: rounded(sigma * power(decimals)).max(1), decimals, filled: 0 })
    }

    /// A count of `scaled` steps of 10^-`decimals`.
    #[must_use]
    pub const fn exact(scaled: u32, decimals: u8) -> Self {
        Self { scaled, decimals, filled: 0 }
    }

    /// How many of the last digits are zeros that only hold their place: the error does not support a digit there.
    #[must_use]
    pub const fn filled(self) -> usize {
        self.filled as usize
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one = 10_u32.pow(u32::from(self.decimals));
        let whole = self.scaled.checked_div(one).unwrap_or(0);
        write!(f, "{whole}")?;
        match self.decimals {
            0 => Ok(()),
            decimals => {
                write!(f, ".{:0>1$}", self.scaled - whole * one, usize::from(decimals))
            }
        }
    }
}

/// 10^`exponent`, for exponents below 7: exact in f32.
fn power(exponent: u8) -> f32 {
    10_u32.pow(u32::from(exponent)) as f32
}

fn rounded(value: f32) -> u32 {
    (value + 0.5) as u32
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString as _;

    use super::*;

    fn shown(value: f32, sigma: f32) -> Option<(std::string::String, usize)> {
        Number::supported(value, sigma).map(|number| (number.to_string(), number.filled()))
    }

    #[test]
    fn digits_end_where_the_error_begins() {
        for (value, sigma, text, filled) in [
            (1180.27, 0.63, "1180.3", 0),
            (1180.27, 0.063, "1180.3", 0),
            (180.27, 0.063, "180.27", 0),
            (1180.27, 6.3, "1180", 0),
            (1184.0, 12.0, "1180", 1),
            (1161.0, 163.0, "1200", 2),
            (59_999.96, 0.5, "60000", 0),
            (9_999.97, 0.001, "10000", 0),
            (9_998.97, 0.001, "9999.0", 0),
            (99_999.7, 0.001, "100000", 0),
            (299_999.0, 0.001, "299999", 0),
            (0.5, 0.01, "0.50", 0),
            (9.999_9, 0.001, "10.000", 0),
            (19.671, 0.0, "19.671", 0),
            (104.719, 0.000_1, "104.72", 0),
        ] {
            assert_eq!(shown(value, sigma), Some((text.into(), filled)), "{value} ± {sigma}");
        }
    }

    #[test]
    fn what_cannot_be_shown_has_no_digits() {
        for (value, sigma) in [
            (f32::NAN, 1.0),
            (1.0, f32::NAN),
            (f32::INFINITY, 1.0),
            (-1.0, 0.1),
            (0.0, 0.1),
            (5.0, 5.0),
            (5.0, 80.0),
            (1.0e6, 1.0),
            (10.0, -1.0),
        ] {
            assert_eq!(shown(value, sigma), None, "{value} ± {sigma}");
        }
    }

    #[test]
    fn errors_have_two_digits_and_are_never_zero() {
        for (sigma, text) in [
            (0.63, "0.63"),
            (6.3, "6.3"),
            (63.4, "63"),
            (634.0, "630"),
            (6_340.0, "6300"),
            (0.063, "0.063"),
            (0.0, "0.001"),
            (0.000_01, "0.001"),
            (9.99, "10.0"),
        ] {
            let number = Number::of_error(sigma).map(|number| number.to_string());
            assert_eq!(number.as_deref(), Some(text), "{sigma}");
        }
        assert_eq!(Number::of_error(f32::NAN), None);
        assert_eq!(Number::of_error(f32::INFINITY), None);
        assert_eq!(Number::of_error(-0.1), None);
    }
}

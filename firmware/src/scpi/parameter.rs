//! Lines taken apart: commands between `;`, and behind a header its parameters.

use super::error::{ErrorCode, ScpiError};
use super::header::is_word;

/// White space of IEEE 488.2: every control character but the end of the line, and the blank.
const fn is_white(byte: u8) -> bool {
    byte <= b' '
}

fn trim(mut bytes: &[u8]) -> &[u8] {
    while let [first, rest @ ..] = bytes
        && is_white(*first)
    {
        bytes = rest;
    }
    while let [rest @ .., last] = bytes
        && is_white(*last)
    {
        bytes = rest;
    }
    bytes
}

/// The part of `bytes` before a separator that stands outside of quotes.
fn until(bytes: &[u8], separator: u8) -> &[u8] {
    let mut quote = None;
    for (index, &byte) in bytes.iter().enumerate() {
        match quote {
            Some(open) if byte == open => quote = None,
            Some(_) => {}
            None if byte == separator => return &bytes[..index],
            None if byte == b'"' || byte == b'\'' => quote = Some(byte),
            None => {}
        }
    }
    bytes
}

/// One command of a line.
#[derive(Clone, Copy, Debug)]
pub struct Unit<'l> {
    /// The header, with its query mark.
    pub header: &'l [u8],
    /// Where it begins in the line.
    pub at: usize,
    /// What stands behind it.
    pub parameters: Parameters<'l>,
}

impl<'l> Unit<'l> {
    /// The command that begins at byte `at` of the line, or behind it; `at` moves to where the next may begin.
    /// `None` at the end of the line.
    pub fn next(line: &'l [u8], at: &mut usize) -> Option<Result<Self, ScpiError>> {
        while let Some(rest) = line.get(*at..)
            && !rest.is_empty()
        {
            let whole = until(rest, b';');
            let start = *at + whole.iter().take_while(|&&byte| is_white(byte)).count();
            *at += whole.len() + 1;
            let text = trim(whole);
            if !text.is_empty() {
                return Some(Self::split(text, start));
            }
        }
        None
    }

    fn split(text: &'l [u8], at: usize) -> Result<Self, ScpiError> {
        let named = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b':' | b'*');
        let mut length = text.iter().take_while(|&&byte| named(byte)).count();
        if text.get(length) == Some(&b'?') {
            length += 1;
        }
        let (header, rest) = text.split_at(length);
        match rest.first() {
            None => {}
            Some(&byte) if is_white(byte) => {}
            Some(byte) if byte.is_ascii_graphic() => {
                return Err(ScpiError::at(ErrorCode::Syntax, at + length));
            }
            Some(_) => return Err(ScpiError::at(ErrorCode::InvalidCharacter, at + length)),
        }
        let blank = trim(rest).is_empty();
        let parameters =
            Parameters { rest: if blank { None } else { Some(rest) }, at: at + length };
        Ok(Self { header, at, parameters })
    }
}

/// The parameters of a command that have not been taken yet.
#[derive(Clone, Copy, Debug)]
pub struct Parameters<'l> {
    rest: Option<&'l [u8]>,
    at: usize,
}

/// One parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Parameter<'l> {
    /// A number and its unit, empty where none was given.
    Number(f32, &'l [u8]),
    /// A word.
    Word(&'l [u8]),
}

impl<'l> Parameters<'l> {
    /// The next parameter and its place, where there is one.
    ///
    /// # Errors
    /// When it is neither number nor word.
    pub fn next(&mut self) -> Result<Option<(Parameter<'l>, usize)>, ScpiError> {
        let Some(rest) = self.rest else { return Ok(None) };
        let whole = until(rest, b',');
        let white = whole.iter().take_while(|&&byte| is_white(byte)).count();
        let place = self.at + white;
        self.rest = rest.get(whole.len() + 1..);
        self.at += whole.len() + usize::from(self.rest.is_some());
        parse(trim(whole))
            .map(|parameter| Some((parameter, place)))
            .map_err(|code| ScpiError::at(code, place))
    }

    /// The next parameter, which must be there.
    ///
    /// # Errors
    /// When there is none, or it is neither number nor word.
    pub fn required(&mut self) -> Result<(Parameter<'l>, usize), ScpiError> {
        let end = self.at;
        self.next()?.ok_or(ScpiError::at(ErrorCode::MissingParameter, end))
    }

    /// Makes sure that nothing is left.
    ///
    /// # Errors
    /// When something is.
    pub const fn end(&self) -> Result<(), ScpiError> {
        match self.rest {
            None => Ok(()),
            Some(_) => Err(ScpiError {
                code: ErrorCode::ParameterNotAllowed,
                byte: Some(self.at as u16 + 1),
            }),
        }
    }

    /// A whole number from 0 to `largest`.
    ///
    /// # Errors
    /// When it is missing, no number, has a unit or lies beyond.
    pub fn integer(&mut self, largest: u16) -> Result<u16, ScpiError> {
        let (parameter, place) = self.required()?;
        let code = match parameter {
            Parameter::Number(_, [_, ..]) => ErrorCode::InvalidSuffix,
            Parameter::Word(_) => ErrorCode::DataType,
            Parameter::Number(value, []) => {
                // IEEE 488.2 rounds what is not whole.
                let rounded = value + 0.5;
                if rounded >= 0.0 && rounded < f32::from(largest) + 1.0 {
                    return Ok(rounded as u16);
                }
                ErrorCode::DataOutOfRange
            }
        };
        Err(ScpiError::at(code, place))
    }

    /// ON, OFF, or a number of which only zero is off.
    ///
    /// # Errors
    /// When it is missing or another word.
    pub fn switch(&mut self) -> Result<bool, ScpiError> {
        let (parameter, place) = self.required()?;
        match parameter {
            Parameter::Number(value, []) => Ok(!(-0.5..0.5).contains(&value)),
            Parameter::Word(word) if is_word(word, "ON") => Ok(true),
            Parameter::Word(word) if is_word(word, "OFF") => Ok(false),
            Parameter::Word(_) => Err(ScpiError::at(ErrorCode::InvalidCharacterData, place)),
            Parameter::Number(..) => Err(ScpiError::at(ErrorCode::InvalidSuffix, place)),
        }
    }
}

fn parse(text: &[u8]) -> Result<Parameter<'_>, ErrorCode> {
    match text {
        [] => Err(ErrorCode::Syntax),
        [b'"' | b'\'', ..] => {
            // No command takes one; still, tell a wrong type from a missing quote.
            let closed = text.len() > 1 && text.first() == text.last();
            Err(if closed { ErrorCode::DataType } else { ErrorCode::InvalidString })
        }
        [b'#', kind, digits @ ..] => match kind.to_ascii_uppercase() {
            b'H' => radix(digits, 16),
            b'Q' => radix(digits, 8),
            b'B' => radix(digits, 2),
            b'0'..=b'9' => Err(ErrorCode::BlockNotAllowed),
            _ => Err(ErrorCode::NumericData),
        },
        [b'0'..=b'9' | b'+' | b'-' | b'.', ..] => number(text),
        [b'A'..=b'Z' | b'a'..=b'z', ..] => {
            if text.iter().all(|&byte| byte.is_ascii_alphanumeric() || byte == b'_') {
                Ok(Parameter::Word(text))
            } else {
                Err(ErrorCode::InvalidCharacterData)
            }
        }
        [first, ..] if first.is_ascii_graphic() => Err(ErrorCode::Syntax),
        _ => Err(ErrorCode::InvalidCharacter),
    }
}

fn radix(digits: &[u8], radix: u32) -> Result<Parameter<'_>, ErrorCode> {
    let text = core::str::from_utf8(digits).map_err(|_| ErrorCode::NumericData)?;
    // A sign is not part of such a number.
    if text.starts_with('+') {
        return Err(ErrorCode::NumericData);
    }
    let value = u32::from_str_radix(text, radix).map_err(|_| ErrorCode::NumericData)?;
    Ok(Parameter::Number(value as f32, &[]))
}

/// A decimal number, in which blanks may stand before the unit.
fn number(text: &[u8]) -> Result<Parameter<'_>, ErrorCode> {
    let digits =
        |from: usize| from + text[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mut end = digits(usize::from(matches!(text.first(), Some(b'+' | b'-'))));
    if text.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if let Some(b'e' | b'E') = text.get(end) {
        let sign = usize::from(matches!(text.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        // Without digits it is the beginning of a unit.
        if exponent > end + 1 + sign {
            end = exponent;
        }
    }
    let (value, unit) = text.split_at(end);
    let unit = trim(unit);
    if !unit.iter().all(|&byte| byte.is_ascii_alphanumeric() || byte == b'/') {
        return Err(ErrorCode::InvalidSuffix);
    }
    let value = decimal(value).ok_or(ErrorCode::NumericData)?;
    if value.is_finite() {
        Ok(Parameter::Number(value, unit))
    } else {
        Err(ErrorCode::DataOutOfRange)
    }
}

/// The value of sign, digits, point and exponent; `None` without a digit. Exact up to seven digits and 1e10 (Clinger's
/// fast path), else within a few units of the last place: `core`'s parser is exact everywhere, for 14 KB of flash.
fn decimal(text: &[u8]) -> Option<f32> {
    /// All of these are exact in f32.
    const TENS: [f32; 11] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];
    /// More digits do not fit; f32 does not see them either.
    const MOST: u64 = 100_000_000_000_000_000;
    let (mut digits, mut mantissa, mut exponent, mut point) = (0, 0_u64, 0_i32, false);
    let mut bytes = text.iter();
    for byte in bytes.by_ref() {
        match byte {
            b'0'..=b'9' => {
                digits += 1;
                if mantissa < MOST {
                    mantissa = mantissa * 10 + u64::from(byte - b'0');
                    exponent -= i32::from(point);
                } else {
                    exponent += i32::from(!point);
                }
            }
            b'.' => point = true,
            b'e' | b'E' => break,
            _ => {}
        }
    }
    let rest = bytes.as_slice();
    let mut typed = 0_i32;
    for digit in rest.iter().filter(|byte| byte.is_ascii_digit()) {
        typed = (typed * 10 + i32::from(digit - b'0')).min(1_000);
    }
    exponent += if rest.first() == Some(&b'-') { -typed } else { typed };
    // 1500.000 is not longer than 1500.
    while exponent < 0 && mantissa.is_multiple_of(10) && mantissa > 0 {
        mantissa /= 10;
        exponent += 1;
    }
    let mut value = mantissa as f32;
    while exponent != 0 && value != 0.0 && value.is_finite() {
        let step = exponent.clamp(-10, 10);
        let ten = TENS[step.unsigned_abs() as usize];
        value = if step > 0 { value * ten } else { value / ten };
        exponent -= step;
    }
    (digits > 0).then_some(if text.first() == Some(&b'-') { -value } else { value })
}

#[cfg(test)]
#[path = "parameter_tests.rs"]
mod tests;

//! Answers: numbers, words and strings with commas between.

use core::fmt::{self, Write};

use heapless::Vec;

/// Room for one answer or one log line. The longest is the line of a reading with eight rotors, below 2 200 bytes.
pub const RESPONSE_BYTES: usize = 2_304;

/// What SCPI answers for "not a number" (SCPI-99, 7.2.1.5).
pub const NOT_A_NUMBER: &str = "9.91E+37";

/// An answer as it grows.
#[derive(Clone, Debug, Default)]
pub struct Response {
    bytes: Vec<u8, RESPONSE_BYTES>,
    sent: usize,
    overflowed: bool,
    follows: bool,
}

impl Response {
    /// Nothing to say.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: Vec::new(), sent: 0, overflowed: false, follows: false }
    }

    /// What has not been sent.
    #[must_use]
    pub fn rest(&self) -> &[u8] {
        self.bytes.get(self.sent..).unwrap_or_default()
    }

    /// So many bytes have been sent.
    pub fn sent(&mut self, count: usize) {
        self.sent += count;
        if self.sent >= self.bytes.len() {
            self.clear();
        }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        // Field by field: a new one would be built on the stack first.
        self.bytes.clear();
        (self.sent, self.overflowed, self.follows) = (0, false, false);
    }

    /// Whether something did not fit.
    #[must_use]
    pub const fn overflowed(&self) -> bool {
        self.overflowed
    }

    /// Raw text.
    pub fn raw(&mut self, text: &str) {
        self.overflowed |= self.bytes.extend_from_slice(text.as_bytes()).is_err();
    }

    fn raw_byte(&mut self, byte: u8) {
        self.overflowed |= self.bytes.push(byte).is_err();
    }

    fn separate(&mut self) {
        if self.follows {
            self.raw(",");
        }
        self.follows = true;
    }

    /// Anything that prints as plain data: a whole number, a word.
    pub fn plain(&mut self, value: impl fmt::Display) {
        self.separate();
        // Cannot fail but for room, which is noted.
        write!(self, "{value}").ok();
    }

    /// A number; 9.91E+37 where there is none.
    pub fn number(&mut self, value: Option<f32>) {
        match value.filter(|value| value.is_finite()) {
            Some(value) => {
                self.separate();
                for byte in ryu::Buffer::new().format_finite(value).bytes() {
                    // SCPI's exponent is a capital letter.
                    self.raw_byte(byte.to_ascii_uppercase());
                }
            }
            None => self.plain(NOT_A_NUMBER),
        }
    }

    /// A string in quotes; what is not printable ASCII becomes a question mark.
    pub fn text(&mut self, text: &str) {
        self.separate();
        self.raw("\"");
        for character in text.chars() {
            match character {
                '"' => self.raw("\"\""),
                ' '..='~' => self.raw_byte(character as u8),
                _ => self.raw_byte(b'?'),
            }
        }
        self.raw("\"");
    }

    /// The head of a block of so many bytes, which are sent behind it.
    pub fn block(&mut self, length: u32) {
        let digits = length.checked_ilog10().map_or(1, |log| log + 1);
        self.plain(format_args!("#{digits}{length}"));
    }
}

impl Write for Response {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.raw(text);
        if self.overflowed { Err(fmt::Error) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_is_separated_and_escaped() {
        let mut response = Response::new();
        response.number(Some(1180.25));
        response.number(Some(1500.0));
        response.number(Some(-2.5e-7));
        response.number(Some(f32::NAN));
        response.plain(7_u8);
        response.text("a \"b\"\n\u{e4}");
        response.block(0);
        response.block(1024);
        let expected: &[u8] = b"1180.25,1500.0,-2.5E-7,9.91E+37,7,\"a \"\"b\"\"??\",#10,#41024";
        assert_eq!(response.rest(), expected);
        response.sent(5);
        assert!(response.rest().starts_with(b"25,"));
        response.sent(1000);
        assert!(response.rest().is_empty());
    }

    #[test]
    fn what_does_not_fit_is_noted() {
        let mut response = Response::new();
        for _ in 0..RESPONSE_BYTES {
            response.raw("ab");
        }
        assert!(response.overflowed() && response.rest().len() <= RESPONSE_BYTES);
    }
}

//! Command headers: patterns as the manual writes them, short and long forms, and the path that goes on behind `;`.

use heapless::Vec;

use super::error::ErrorCode;

/// The longest header, path included.
pub const HEADER_BYTES: usize = 80;

/// One keyword of a pattern such as `[SENSe:]BLADes`.
#[derive(Clone, Copy)]
struct Keyword<'p> {
    name: &'p [u8],
    optional: bool,
}

/// The keywords of a pattern from a byte on.
#[derive(Clone, Copy)]
struct Keywords<'p> {
    rest: &'p [u8],
    optional: bool,
}

impl<'p> Iterator for Keywords<'p> {
    type Item = Keyword<'p>;

    fn next(&mut self) -> Option<Keyword<'p>> {
        while let Some((&first, rest)) = self.rest.split_first() {
            if is_name(first) || first == b'*' {
                let length = 1 + rest.iter().take_while(|&&byte| is_name(byte)).count();
                let (name, rest) = self.rest.split_at(length);
                self.rest = rest;
                return Some(Keyword { name, optional: self.optional });
            }
            match first {
                b'[' => self.optional = true,
                b']' => self.optional = false,
                _ => {}
            }
            self.rest = rest;
        }
        None
    }
}

const fn is_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

/// Whether a typed keyword is this one, in its short or its long form.
fn is_keyword(typed: &[u8], name: &[u8]) -> bool {
    let short = name.iter().take_while(|byte| !byte.is_ascii_lowercase()).count();
    typed.eq_ignore_ascii_case(name) || typed.eq_ignore_ascii_case(&name[..short])
}

/// What a typed keyword counts, as in `LIMit1`: without it, 1.
fn without_suffix(typed: &[u8]) -> (&[u8], bool) {
    let digits = typed.iter().rev().take_while(|byte| byte.is_ascii_digit()).count();
    let (name, suffix) = typed.split_at(typed.len() - digits);
    (name, suffix.is_empty() || suffix == b"1")
}

/// How a header compares with a pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fit {
    No,
    /// But for a number behind a keyword.
    Suffix,
    Yes,
}

fn fit(mut pattern: Keywords<'_>, typed: &[u8]) -> Fit {
    let Some(keyword) = pattern.next() else {
        return if typed.is_empty() { Fit::Yes } else { Fit::No };
    };
    let end = typed.iter().position(|&byte| byte == b':').unwrap_or(typed.len());
    let (name, one) = without_suffix(&typed[..end]);
    if is_keyword(name, keyword.name) {
        let rest = fit(pattern, typed.get(end + 1..).unwrap_or_default());
        if rest != Fit::No {
            return if one { rest } else { Fit::Suffix };
        }
    }
    if keyword.optional { fit(pattern, typed) } else { Fit::No }
}

/// Finds the command of a header, query mark included.
pub fn find<C: Copy>(table: &[(&str, C)], header: &[u8]) -> Result<C, ErrorCode> {
    let (typed, query) = match header.strip_suffix(b"?") {
        Some(typed) => (typed, true),
        None => (header, false),
    };
    // "A:" is not A; to `fit`, both are.
    if typed.is_empty() || typed.ends_with(b":") || typed.starts_with(b":") {
        return Err(ErrorCode::UndefinedHeader);
    }
    let mut error = ErrorCode::UndefinedHeader;
    for &(pattern, command) in table {
        if pattern.ends_with('?') == query {
            match fit(Keywords { rest: pattern.as_bytes(), optional: false }, typed) {
                Fit::Yes => return Ok(command),
                Fit::Suffix => error = ErrorCode::HeaderSuffix,
                Fit::No => {}
            }
        }
    }
    Err(error)
}

/// Where the next command of a line continues: all keywords of the one before but its last.
#[derive(Clone, Debug, Default)]
pub struct Path(Vec<u8, HEADER_BYTES>);

impl Path {
    /// The root: a line begins there.
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Back to the root.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// The whole header of what was typed, and moves the path along.
    pub fn follow(&mut self, typed: &[u8]) -> Result<Vec<u8, HEADER_BYTES>, ErrorCode> {
        let mut header = Vec::new();
        let too_long = |_| ErrorCode::MnemonicTooLong;
        if typed.starts_with(b"*") {
            header.extend_from_slice(typed).map_err(too_long)?;
            return Ok(header);
        }
        if let Some(absolute) = typed.strip_prefix(b":") {
            header.extend_from_slice(absolute).map_err(too_long)?;
        } else {
            header.extend_from_slice(&self.0).map_err(too_long)?;
            header.extend_from_slice(typed).map_err(too_long)?;
        }
        let kept = header.iter().rposition(|&byte| byte == b':').map_or(0, |colon| colon + 1);
        self.0.clear();
        // Not longer than the header.
        self.0.extend_from_slice(&header[..kept]).map_err(too_long)?;
        Ok(header)
    }
}

/// The name of a keyword as typed in full or short, for words among the parameters.
pub fn is_word(typed: &[u8], name: &str) -> bool {
    is_keyword(typed, name.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &[(&str, u8)] =
        &[("*IDN?", 0), ("MEASure[:SPEed]?", 1), ("[SENSe:]BLADes", 2), ("[SENSe:]BLADes?", 3)];

    fn found(header: &str) -> Result<u8, ErrorCode> {
        find(TABLE, header.as_bytes())
    }

    #[test]
    fn short_and_long_forms_in_any_case() {
        for header in ["MEAS?", "measure?", "MEAS:SPE?", "meas:speed?", "Measure1:Spe1?"] {
            assert_eq!(found(header), Ok(1), "{header}");
        }
        for header in ["BLAD", "sense:blades", "SENS:BLAD1"] {
            assert_eq!(found(header), Ok(2), "{header}");
        }
        assert_eq!(found("*idn?"), Ok(0));
        assert_eq!(found("SENS:BLAD?"), Ok(3));
    }

    #[test]
    fn nothing_between_short_and_long() {
        for header in [
            "MEASU?",
            "MEA?",
            "MEAS",
            "MEAS:?",
            ":MEAS?",
            "MEAS::SPE?",
            "?",
            "",
            "SENS",
            "BLADES:X",
            "*IDN",
        ] {
            assert_eq!(found(header), Err(ErrorCode::UndefinedHeader), "{header}");
        }
        assert_eq!(found("MEAS2?"), Err(ErrorCode::HeaderSuffix));
    }

    #[test]
    fn the_path_goes_on_behind_a_semicolon() {
        let mut path = Path::new();
        for (typed, header) in [
            ("CALC:LIM:UPP", "CALC:LIM:UPP"),
            ("LOW", "CALC:LIM:LOW"),
            ("*OPC", "*OPC"),
            ("LOW:STAT", "CALC:LIM:LOW:STAT"),
            (":UNIT", "UNIT"),
            ("UNIT", "UNIT"),
        ] {
            assert_eq!(path.follow(typed.as_bytes()).as_deref(), Ok(header.as_bytes()));
        }
        let long = [b'A'; HEADER_BYTES + 1];
        assert_eq!(path.follow(&long), Err(ErrorCode::MnemonicTooLong));
    }
}

//! The `#` lines in front of AEDAT 1.0, 2.0 and 3.x.

use crate::recording::error::RecordingError;
use crate::recording::input::Input;

/// Longest header that is read: jAER copies its preferences into it.
const MAX_HEADER_BYTES: usize = 16 << 20;

/// Header lines without their `#`, in file order.
#[derive(Debug, Default)]
pub struct Header {
    pub lines: Vec<String>,
}

impl Header {
    /// Reads and consumes the header.
    pub fn read(input: &mut Input) -> Result<Self, RecordingError> {
        let mut lines = Vec::new();
        let mut total = 0;
        while let Some(line) = peek_line(input)? {
            input.consume(line.len());
            total += line.len();
            let text = String::from_utf8_lossy(&line);
            let text = text.trim_start_matches('#').trim().to_owned();
            let last = text == "!END-HEADER" || text.eq_ignore_ascii_case("End Of ASCII Header");
            lines.push(text);
            if last || total > MAX_HEADER_BYTES {
                break;
            }
        }
        Ok(Self { lines })
    }

    /// What follows `key` in the last line that begins with it.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.lines.iter().rev().find_map(|line| line.strip_prefix(key)).map(str::trim)
    }
}

/// The next line if it is a header line: `#`, then text. An address may begin with the byte of `#` too.
fn peek_line(input: &mut Input) -> Result<Option<Vec<u8>>, RecordingError> {
    let mut want = 4096;
    loop {
        let bytes = input.peek(want)?;
        if bytes.first() != Some(&b'#') {
            return Ok(None);
        }
        let is_text =
            |byte: &u8| *byte >= 0x20 && *byte != 0x7f || matches!(*byte, b'\t' | b'\r' | b'\n');
        match memchr::memchr(b'\n', bytes) {
            Some(end) => {
                let line = &bytes[..=end];
                return Ok(line.iter().all(is_text).then(|| line.to_vec()));
            }
            None if bytes.len() < want || want > MAX_HEADER_BYTES || !bytes.iter().all(is_text) => {
                return Ok(None);
            }
            None => want *= 2,
        }
    }
}

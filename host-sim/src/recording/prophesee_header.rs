//! The `% key value` text header in front of Prophesee's RAW and DAT files.

use evtach_core::Geometry;

use super::error::RecordingError;
use super::geometry::{self, KnownSize};
use super::input::Input;

/// Longest header that is read: real ones reach some hundred kilobytes when software dumps its settings into them.
const MAX_HEADER_BYTES: usize = 16 << 20;

/// Header lines in file order.
#[derive(Debug, Default)]
pub struct Header {
    /// Key as written and value, both trimmed.
    pub fields: Vec<(String, String)>,
    /// Bytes up to the data.
    pub length: usize,
    /// Whether `% end` closed it.
    pub closed: bool,
}

impl Header {
    /// Reads the header at the start of the input without consuming it.
    pub fn peek(input: &mut Input) -> Result<Self, RecordingError> {
        let mut header = Self::default();
        while let Some(line) = peek_line(input, header.length)? {
            header.length += line.len();
            // The line is UTF-8 or it would not have been taken for one.
            let text = String::from_utf8_lossy(&line);
            let text = text.trim_start_matches('%').trim();
            if text == "end" {
                header.closed = true;
                break;
            }
            let (key, value) = text.split_once([' ', ':']).unwrap_or((text, ""));
            header.fields.push((key.trim().to_owned(), value.trim().to_owned()));
        }
        Ok(header)
    }

    /// Value of the first line with this key, whatever its case.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.fields
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(key))
            .map(|(_, value)| value.as_str())
    }

    /// Name (`EVT3`) of a line such as `format EVT3;height=720;width=1280`.
    pub fn format(&self) -> Option<&str> {
        self.get("format").and_then(|value| value.split(';').next()).map(str::trim)
    }

    /// Option of the `format` line, for example `endianness`.
    pub fn format_option(&self, option: &str) -> Option<&str> {
        self.get("format")?
            .split(';')
            .skip(1)
            .filter_map(|pair| pair.split_once('='))
            .find(|(name, _)| name.trim().eq_ignore_ascii_case(option))
            .map(|(_, value)| value.trim())
    }

    /// Size of the sensor.
    pub fn geometry(&self) -> Option<KnownSize> {
        let sides = |width: Option<&str>, height: Option<&str>| {
            Geometry::new(width?.parse().ok()?, height?.parse().ok()?)
        };
        let found =
            |size, line: String| KnownSize::new(size, format!("from the header line {line}"));
        if let Some(value) = self.get("geometry")
            && let Some(size) = geometry::parse(value)
        {
            return Some(found(size, format!("\"geometry {value}\"")));
        }
        if let Some(size) = sides(self.format_option("width"), self.format_option("height")) {
            return Some(found(size, format!("\"format {}\"", self.get("format").unwrap_or(""))));
        }
        if let Some(size) = sides(self.get("width"), self.get("height")) {
            return Some(found(size, "\"width\" and \"height\"".to_owned()));
        }
        for key in ["sensor_name", "sensor", "plugin_name", "system", "camera_name"] {
            if let Some(value) = self.get(key)
                && let Some(size) = geometry::of_sensor(value)
            {
                return Some(found(
                    size,
                    format!("\"{key} {value}\" (the file does not say its size)"),
                ));
            }
        }
        for key in ["generation", "sensor_generation"] {
            if let Some(value) = self.get(key)
                && let Some(size) = geometry::of_sensor(&format!("gen{}", value.replace('.', "")))
            {
                return Some(found(
                    size,
                    format!("\"{key} {value}\" (the file does not say its size)"),
                ));
            }
        }
        let id = self.get("system_ID")?;
        let size = geometry::of_system_id(id.parse().ok()?)?;
        Some(found(size, format!("\"system_ID {id}\" (the file does not say its size)")))
    }
}

/// Where a further header begins in the midst of data, as in recordings that were put behind each other: two lines of
/// text at least, each with its `% `.
pub fn find_further(bytes: &[u8]) -> Option<usize> {
    const LONGEST_LINE: usize = 1024;
    memchr::memmem::find_iter(bytes, b"\n% ").find_map(|newline| {
        let before = &bytes[newline.saturating_sub(LONGEST_LINE)..newline];
        let text = before.iter().rev().take_while(|byte| (0x20..0x7f).contains(*byte)).count();
        let line = &before[before.len() - text..];
        let start = memchr::memmem::rfind(line, b"% ")?;
        let is_key = line.get(start + 2).is_some_and(u8::is_ascii_alphabetic);
        let next_is_key = bytes.get(newline + 3).is_some_and(u8::is_ascii_alphabetic);
        (is_key && next_is_key).then(|| newline - line.len() + start)
    })
}

/// The header line at `from`, newline included; `None` where the data begins.
fn peek_line(input: &mut Input, from: usize) -> Result<Option<Vec<u8>>, RecordingError> {
    let mut want = from + 4096;
    loop {
        let bytes = input.peek(want)?;
        let complete = bytes.len() < want;
        let rest = bytes.get(from..).unwrap_or_default();
        if rest.first() != Some(&b'%') {
            return Ok(None);
        }
        // A word of data may begin with '%' too: a header line is text up to its newline.
        let is_text =
            |byte: &u8| *byte >= 0x20 && *byte != 0x7f || matches!(*byte, b'\t' | b'\r' | b'\n');
        match memchr::memchr(b'\n', rest) {
            Some(end) => {
                let line = &rest[..=end];
                let text = line.iter().all(is_text) && std::str::from_utf8(line).is_ok();
                return Ok(text.then(|| line.to_vec()));
            }
            None if complete || want > MAX_HEADER_BYTES || !rest.iter().all(is_text) => {
                return Ok(None);
            }
            None => want += want.max(4096),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn further_headers_are_found_in_data() {
        let data =
            [&[0x25, 0x20, 0x0a, 0x80, 0x61][..], b"% evt 3.0\n% geometry 4x4\n% end\n", &[1, 2]]
                .concat();
        assert_eq!(find_further(&data), Some(5));
        assert_eq!(find_further(b"\n% \x00\x01% a\x01\n% b"), None);
        assert_eq!(find_further(b""), None);
    }
}

//! Reading text. Runs of blanks separate as well as commas do, which the CSV crates do not do; no field is ever quoted.

use evtach_core::{Event, Polarity};

use super::layout::{self, Layout};
use crate::recording::error::{Place, RecordingError};
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

/// Bytes looked at to find the layout.
const LAYOUT_BYTES: usize = 64 * 1024;
/// Bytes decoded in one go, and the longest line.
const CHUNK_BYTES: usize = 256 * 1024;

/// Whether bytes look like text.
pub(crate) fn is_text(bytes: &[u8]) -> bool {
    !bytes.is_empty()
        && bytes
            .iter()
            .all(|&byte| byte >= 0x20 && byte != 0x7f || matches!(byte, b'\t' | b'\r' | b'\n'))
        && match std::str::from_utf8(bytes) {
            Ok(_) => true,
            // The look-ahead may end inside a character.
            Err(error) => error.error_len().is_none(),
        }
}

/// Opens a text recording.
pub(crate) fn open(mut input: Input) -> Result<Opened, RecordingError> {
    let head = input.peek(LAYOUT_BYTES)?;
    let layout = layout::find(&String::from_utf8_lossy(head))?;
    let (geometry, assumed) = (layout.geometry, layout.assumed.clone());
    let source = Box::new(Text { input, layout, line: 0 });
    Ok(Opened { format: "CSV", geometry, assumed, about: Vec::new(), source })
}

struct Text {
    input: Input,
    layout: Layout,
    /// Lines consumed so far.
    line: u64,
}

impl Source for Text {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let bytes = self.input.peek(CHUNK_BYTES)?;
        let last = bytes.len() < CHUNK_BYTES;
        if bytes.is_empty() {
            return Ok(false);
        }
        let whole = match memchr::memrchr(b'\n', bytes) {
            Some(end) => end + 1,
            None if last => bytes.len(),
            None => {
                return Err(RecordingError::Damaged {
                    format: "CSV",
                    place: Place::Line(self.line + 1),
                    what: format!("a line longer than {CHUNK_BYTES} bytes"),
                });
            }
        };
        let mut failure = None;
        let mut start = 0;
        while start < whole {
            let end = memchr::memchr(b'\n', &bytes[start..whole]).map_or(whole, |at| start + at);
            let line = &bytes[start..end];
            start = end + 1;
            self.line += 1;
            if self.line <= self.layout.skip_lines {
                continue;
            }
            match event(line, &self.layout) {
                Ok(event) => events.extend(event),
                // The names again: another recording was put behind the one before.
                Err(_) if layout::names_columns(line) => {
                    side.notes.push(format!("another recording begins at line {}", self.line));
                }
                // The last line of a cut file.
                Err(_) if end == bytes.len() && last => {
                    side.notes.push(format!(
                        "the file ends inside line {}, which was left out",
                        self.line
                    ));
                }
                Err(what) => {
                    failure = Some(RecordingError::Damaged {
                        format: "CSV",
                        place: Place::Line(self.line),
                        what,
                    });
                    break;
                }
            }
        }
        self.input.consume(whole);
        failure.map_or(Ok(true), Err)
    }
}

/// The event in a line; `None` for an empty line or a comment.
fn event(line: &[u8], layout: &Layout) -> Result<Option<Event>, String> {
    let line = line.trim_ascii();
    if line.is_empty() || line[0] == b'#' || line[0] == b'%' {
        return Ok(None);
    }
    let text = std::str::from_utf8(line).map_err(|_| "not text".to_owned())?;
    let mut found: [Option<&str>; 4] = [None; 4];
    for (index, field) in layout::fields(text).enumerate() {
        if let Some(place) = layout.columns.iter().position(|&column| column == index) {
            found[place] = Some(field);
        }
    }
    let [Some(t), Some(x), Some(y), Some(p)] = found else {
        return Err("fewer columns than the lines before".to_owned());
    };
    let bad = |name: &str, field: &str| {
        let shown: String = field.chars().take(20).collect();
        format!("{name} is \"{shown}\"")
    };
    Ok(Some(Event {
        t_us: microseconds(t, layout.unit.exponent()).ok_or_else(|| bad("the time", t))?,
        x: pixel(x).ok_or_else(|| bad("x", x))?,
        y: pixel(y).ok_or_else(|| bad("y", y))?,
        polarity: polarity(p).ok_or_else(|| bad("the polarity", p))?,
    }))
}

/// A pixel coordinate; one off the sensor's address range becomes `u16::MAX`, which is counted as out of bounds.
fn pixel(field: &str) -> Option<u16> {
    if let Ok(value) = field.parse::<u16>() {
        return Some(value);
    }
    let value: f64 = field.parse().ok()?;
    if !value.is_finite() {
        return None;
    }
    let whole = value.round();
    Some(if (0.0..f64::from(u16::MAX)).contains(&whole) { whole as u16 } else { u16::MAX })
}

/// Brighter or darker from 0/1, -1/1 and words.
pub(super) fn polarity(field: &str) -> Option<Polarity> {
    match field {
        "1" | "+1" | "true" | "True" | "TRUE" | "on" | "ON" => return Some(Polarity::On),
        "0" | "-1" | "false" | "False" | "FALSE" | "off" | "OFF" => return Some(Polarity::Off),
        _ => {}
    }
    let value: f64 = field.parse().ok()?;
    if value == 1.0 {
        Some(Polarity::On)
    } else if value == 0.0 || value == -1.0 {
        Some(Polarity::Off)
    } else {
        None
    }
}

/// A time in microseconds, exact for plain decimals and rounded to the nearest microsecond.
fn microseconds(field: &str, exponent: i32) -> Option<u64> {
    if exponent == 0
        && let Ok(value) = field.parse::<u64>()
    {
        return Some(value);
    }
    let (whole, fraction) = field.split_once('.').unwrap_or((field, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if exponent >= 0 && !whole.is_empty() && digits(whole) && digits(fraction) {
        let exponent = exponent.unsigned_abs() as usize;
        let mut value: u64 = whole.parse().ok()?;
        let mut rest = fraction.bytes();
        for _ in 0..exponent {
            let digit = rest.next().map_or(0, |byte| byte - b'0');
            value = value.checked_mul(10)?.checked_add(u64::from(digit))?;
        }
        let up = rest.next().is_some_and(|byte| byte >= b'5');
        return value.checked_add(u64::from(up));
    }
    let value = field.parse::<f64>().ok()? * 10f64.powi(exponent);
    (0.0..9e18).contains(&value).then(|| value.round() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_become_microseconds_exactly() {
        assert_eq!(microseconds("1468941032.229165", 6), Some(1_468_941_032_229_165));
        assert_eq!(microseconds("0.0000015", 6), Some(2));
        assert_eq!(microseconds("3", 6), Some(3_000_000));
        assert_eq!(microseconds("1.5e-3", 6), Some(1500));
        assert_eq!(microseconds("1500", -3), Some(2));
        assert_eq!(microseconds("1.304124000000000000e+06", 0), Some(1_304_124));
        for text in ["", "-1", "nan", "inf", "1e99", "abc", "99999999999999999999"] {
            assert_eq!(microseconds(text, 6), None, "{text}");
        }
    }

    #[test]
    fn pixels_off_any_sensor_stay_off_it() {
        assert_eq!(pixel("12"), Some(12));
        assert_eq!(pixel("12.0"), Some(12));
        assert_eq!(pixel("-1"), Some(u16::MAX));
        assert_eq!(pixel("1e9"), Some(u16::MAX));
        assert_eq!(pixel("nan"), None);
    }
}

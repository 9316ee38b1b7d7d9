//! Reading text. Runs of blanks separate as well as commas do, which the CSV crates do not do; no field is ever quoted.

use evtach_core::{Event, Polarity};

use super::layout::{self, Layout};
use crate::recording::error::{Place, RecordingError};
use crate::recording::geometry::KnownSize;
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source, TimeUnit};

/// Bytes looked at to find the layout.
const LAYOUT_BYTES: usize = 64 * 1024;
/// Bytes decoded in one go, and the longest line.
const CHUNK_BYTES: usize = 256 * 1024;

/// What some programs begin a text with.
const BYTE_ORDER_MARK: [u8; 3] = [0xef, 0xbb, 0xbf];

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
pub(crate) fn open(
    mut input: Input,
    time_unit: Option<TimeUnit>,
) -> Result<Opened, RecordingError> {
    let head = input.peek(LAYOUT_BYTES)?;
    let mut layout = layout::find(&String::from_utf8_lossy(head), time_unit)?;
    let geometry = layout.geometry.map(|size| KnownSize::new(size, "from the first lines"));
    let assumed = std::mem::take(&mut layout.assumed);
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
        let mut whole = match memchr::memrchr(b'\n', bytes) {
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
            // Also in the midst, where another text was put behind the one before.
            let line = line.strip_prefix(&BYTE_ORDER_MARK).unwrap_or(line);
            if self.line <= self.layout.skip_lines {
                continue;
            }
            match event(line, &self.layout) {
                Ok(event) => events.extend(event),
                // The names again: another recording was put behind the one before.
                Err(_) if layout::names_columns(line) => {
                    side.notes.push(format!("another recording begins at line {}", self.line));
                    side.starts_anew = true;
                    whole = start;
                    break;
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
    let mut found: [&[u8]; 4] = [&[]; 4];
    let mut rest = line;
    for index in 0.. {
        let start = rest.iter().position(|&byte| !layout::separates(byte)).unwrap_or(rest.len());
        rest = &rest[start..];
        if rest.is_empty() {
            break;
        }
        let end = rest.iter().position(|&byte| layout::separates(byte)).unwrap_or(rest.len());
        if let Some(place) = layout.columns.iter().position(|&column| column == index) {
            found[place] = &rest[..end];
        }
        rest = &rest[end..];
    }
    let [t, x, y, p] = found;
    if found.iter().any(|field| field.is_empty()) {
        return Err("fewer columns than the lines before".to_owned());
    }
    let bad = |name: &str, field: &[u8]| {
        let shown: String = String::from_utf8_lossy(field).chars().take(20).collect();
        format!("{name} is \"{shown}\"")
    };
    Ok(Some(Event {
        t_us: microseconds(t, layout.unit.exponent()).ok_or_else(|| bad("the time", t))?,
        x: pixel(x).ok_or_else(|| bad("x", x))?,
        y: pixel(y).ok_or_else(|| bad("y", y))?,
        polarity: polarity(p).ok_or_else(|| bad("the polarity", p))?,
    }))
}

/// A number of digits only.
fn digits(field: &[u8]) -> Option<u64> {
    if field.is_empty() || field.len() > 19 {
        return None;
    }
    field.iter().try_fold(0_u64, |value, byte| {
        let digit = byte.wrapping_sub(b'0');
        (digit < 10).then(|| value * 10 + u64::from(digit))
    })
}

fn float(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// A pixel coordinate; one off the sensor's address range becomes `u16::MAX`, which is counted as out of bounds.
fn pixel(field: &[u8]) -> Option<u16> {
    if let Some(value) = digits(field) {
        return Some(u16::try_from(value).unwrap_or(u16::MAX));
    }
    let value = float(field)?;
    if !value.is_finite() {
        return None;
    }
    let whole = value.round();
    Some(if (0.0..f64::from(u16::MAX)).contains(&whole) { whole as u16 } else { u16::MAX })
}

/// Brighter or darker from 0/1, -1/1 and words.
pub(super) fn polarity(field: &[u8]) -> Option<Polarity> {
    match field {
        b"1" | b"+1" | b"true" | b"True" | b"TRUE" | b"on" | b"ON" => return Some(Polarity::On),
        b"0" | b"-1" | b"false" | b"False" | b"FALSE" | b"off" | b"OFF" => {
            return Some(Polarity::Off);
        }
        _ => {}
    }
    let value = float(field)?;
    if value == 1.0 {
        Some(Polarity::On)
    } else if value == 0.0 || value == -1.0 {
        Some(Polarity::Off)
    } else {
        None
    }
}

/// A time in microseconds, exact for plain decimals and rounded to the nearest microsecond.
fn microseconds(field: &[u8], exponent: i32) -> Option<u64> {
    if exponent == 0
        && let Some(value) = digits(field)
    {
        return Some(value);
    }
    let point = memchr::memchr(b'.', field).unwrap_or(field.len());
    let (whole, fraction) = (&field[..point], field.get(point + 1..).unwrap_or_default());
    if exponent >= 0
        && let Some(mut value) = digits(whole)
        && fraction.iter().all(u8::is_ascii_digit)
    {
        let mut rest = fraction.iter();
        for _ in 0..exponent {
            let digit = rest.next().map_or(0, |byte| byte - b'0');
            value = value.checked_mul(10)?.checked_add(u64::from(digit))?;
        }
        let up = rest.next().is_some_and(|&byte| byte >= b'5');
        return value.checked_add(u64::from(up));
    }
    let value = float(field)? * 10f64.powi(exponent);
    (0.0..9e18).contains(&value).then(|| value.round() as u64)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test")]
mod tests {
    use super::*;

    /// The times of all events in a text.
    fn times(text: &'static str) -> Vec<u64> {
        let mut source = open(Input::new(Box::new(text.as_bytes())), None).unwrap().source;
        let mut events = Vec::new();
        while source.read(&mut events, &mut Side::default()).unwrap() {}
        events.iter().map(|event| event.t_us).collect()
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_a_line() {
        assert_eq!(times("\u{feff}0,1,2,1\n7,1,2,0\n"), [0, 7]);
        assert_eq!(times("\u{feff}t,x,y,p\n0,1,2,1\n\u{feff}t,x,y,p\n7,1,2,0\n"), [0, 7]);
    }

    #[test]
    fn a_column_without_a_name_means_nothing() {
        assert_eq!(times(",t,x,y,p\n0,500,1,2,1\n1,700,1,2,0\n"), [500, 700]);
    }

    #[test]
    fn columns_without_a_row_are_no_events() {
        assert!(times("t,x,y,p\n").is_empty());
    }

    #[test]
    fn seconds_become_microseconds_exactly() {
        assert_eq!(microseconds(b"1468941032.229165", 6), Some(1_468_941_032_229_165));
        assert_eq!(microseconds(b"0.0000015", 6), Some(2));
        assert_eq!(microseconds(b"3", 6), Some(3_000_000));
        assert_eq!(microseconds(b"1.5e-3", 6), Some(1500));
        assert_eq!(microseconds(b"1500", -3), Some(2));
        assert_eq!(microseconds(b"1.304124000000000000e+06", 0), Some(1_304_124));
        for text in ["", "-1", "nan", "inf", "1e99", "abc", "99999999999999999999"] {
            assert_eq!(microseconds(text.as_bytes(), 6), None, "{text}");
        }
    }

    #[test]
    fn pixels_off_any_sensor_stay_off_it() {
        assert_eq!(pixel(b"12"), Some(12));
        assert_eq!(pixel(b"12.0"), Some(12));
        assert_eq!(pixel(b"-1"), Some(u16::MAX));
        assert_eq!(pixel(b"1e9"), Some(u16::MAX));
        assert_eq!(pixel(b"nan"), None);
    }
}

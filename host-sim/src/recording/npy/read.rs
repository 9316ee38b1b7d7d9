//! Reading arrays of events.

use evtach_core::{Event, Polarity};

use super::header::{ArrayHeader, Elements, Kind, Number};
use crate::recording::TimeUnit;
use crate::recording::csv::unit_of_name;
use crate::recording::error::{Place, RecordingError};
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

/// Events decoded in one go.
const CHUNK_EVENTS: usize = 16 * 1024;

/// One array that is read along.
pub struct Array {
    pub input: Input,
    /// Bytes of one event's share.
    pub stride: usize,
}

/// Where one quantity of an event lies.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    pub array: usize,
    pub offset: usize,
    pub kind: Kind,
}

/// Names that each quantity goes by, in the order t, x, y, polarity.
pub const NAMES: [&[&str]; 4] = [
    &["t", "ts", "time", "timestamp", "timestamps"],
    &["x"],
    &["y"],
    &["p", "on", "pol", "polarity", "polarities"],
];

/// Opens a single array.
pub(crate) fn open(
    mut input: Input,
    time_unit: Option<TimeUnit>,
) -> Result<Opened, RecordingError> {
    let header = ArrayHeader::read(&mut input)?;
    let unsupported = |what: &str| RecordingError::Unsupported {
        what: what.to_owned(),
        advice: "save it as a structured array with the fields t, x, y, p".to_owned(),
    };
    let count = header.shape.first().copied().unwrap_or(1);
    let mut assumed = Vec::new();
    let (fields, stride, told) = match &header.elements {
        Elements::Records(named) => {
            let mut told = None;
            let mut fields = Vec::new();
            for (place, wanted) in NAMES.iter().enumerate() {
                let found = named.iter().find_map(|(names, kind, offset)| {
                    names.iter().find_map(|name| {
                        let (stem, unit) = unit_of_name(&name.to_ascii_lowercase());
                        wanted.contains(&stem.as_str()).then_some((*kind, *offset, unit))
                    })
                });
                let (kind, offset, unit) = found.ok_or_else(|| {
                    unsupported(&format!("an array without a field \"{}\"", wanted[0]))
                })?;
                if place == 0 {
                    told = unit;
                }
                fields.push(Field { array: 0, offset, kind });
            }
            (fields, header.element_bytes, told)
        }
        Elements::Plain(kind) => {
            if header.shape.len() != 2 || header.shape[1] < 4 || header.shape[1] > 64 {
                return Err(unsupported("an array that has not four columns"));
            }
            let columns = header.shape[1] as usize;
            let order = plain_order(&mut input, *kind, columns)?;
            assumed.push(order.1);
            let fields =
                order.0.map(|column| Field { array: 0, offset: column * kind.bytes, kind: *kind });
            (fields.to_vec(), kind.bytes * columns, None)
        }
    };
    let fields: [Field; 4] =
        fields.try_into().map_err(|_| unsupported("an array without the four fields"))?;
    let mut source = Arrays {
        arrays: vec![Array { input, stride }],
        fields,
        unit: TimeUnit::Microseconds,
        left: count,
        record: 0,
    };
    assumed.push(source.find_unit(time_unit, told)?);
    Ok(Opened {
        format: "NPY",
        geometry: None,
        assumed,
        about: Vec::new(),
        source: Box::new(source),
    })
}

/// Order of the columns of a plain table, from its first rows.
fn plain_order(
    input: &mut Input,
    kind: Kind,
    columns: usize,
) -> Result<([usize; 4], String), RecordingError> {
    let row_bytes = kind.bytes * columns;
    let rows: Vec<Vec<f64>> = input
        .peek(row_bytes * 256)?
        .chunks_exact(row_bytes)
        .take(256)
        .map(|row| row.chunks_exact(kind.bytes).map(|bytes| kind.read(bytes).as_f64()).collect())
        .collect();
    Ok(crate::recording::csv::order_from_numbers(&rows))
}

/// The events of one or several arrays read along each other.
pub struct Arrays {
    pub arrays: Vec<Array>,
    pub fields: [Field; 4],
    pub unit: TimeUnit,
    /// Events that the header promises and that have not come yet.
    pub left: u64,
    pub record: u64,
}

impl Arrays {
    /// Settles the unit of time, and says how: as stated, else as told by the field's name, else from the first numbers.
    pub fn find_unit(
        &mut self,
        stated: Option<TimeUnit>,
        told: Option<TimeUnit>,
    ) -> Result<String, RecordingError> {
        let Field { array, offset, kind } = self.fields[0];
        let stride = self.arrays[array].stride;
        let times: Vec<f64> = self.arrays[array]
            .input
            .peek(stride * 256)?
            .chunks_exact(stride)
            .take(256)
            .map(|record| kind.read(&record[offset..]).as_f64())
            .collect();
        let is_single = kind.is_float() && kind.bytes <= size_of::<f32>();
        let epsilon = if is_single { f32::EPSILON.into() } else { f64::EPSILON };
        let seen = TimeUnit::from_times(&times, epsilon);
        let (unit, sentence) = TimeUnit::settle(stated, told, "field", seen)?;
        self.unit = unit;
        Ok(sentence)
    }

    /// Says that there is more behind the events that the header counts, as in files that were put behind each other.
    fn note_rest(&mut self, side: &mut Side) -> Result<(), RecordingError> {
        for array in &mut self.arrays {
            let offset = array.input.offset();
            if !array.input.peek(1)?.is_empty() {
                side.notes.push(format!(
                    "the header counts no more events: what follows at byte {offset} is left out"
                ));
                break;
            }
        }
        Ok(())
    }

    fn event(&self, index: usize) -> Result<Event, String> {
        let number = |place: usize| {
            let Field { array, offset, kind } = self.fields[place];
            let array = &self.arrays[array];
            let at = index * array.stride + offset;
            kind.read(array.input.buffered().get(at..).unwrap_or_default())
        };
        let t = number(0);
        Ok(Event {
            t_us: microseconds(t, self.unit).ok_or_else(|| format!("the time is {t}"))?,
            x: pixel(number(1)),
            y: pixel(number(2)),
            polarity: if number(3).as_f64() > 0.0 { Polarity::On } else { Polarity::Off },
        })
    }
}

/// A coordinate; one off any sensor becomes `u16::MAX`, which is counted as out of bounds.
fn pixel(number: Number) -> u16 {
    if let Number::Unsigned(value) = number {
        return u16::try_from(value).unwrap_or(u16::MAX);
    }
    let value = number.as_f64();
    if (0.0..65535.0).contains(&value) { value as u16 } else { u16::MAX }
}

fn microseconds(number: Number, unit: TimeUnit) -> Option<u64> {
    let exponent = unit.exponent();
    match number {
        Number::Unsigned(value) if exponent == 0 => Some(value),
        Number::Unsigned(value) if exponent > 0 => {
            value.checked_mul(10_u64.pow(exponent.unsigned_abs()))
        }
        Number::Unsigned(value) => Some(value / 10_u64.pow(exponent.unsigned_abs())),
        Number::Signed(value) => microseconds(Number::Unsigned(value.try_into().ok()?), unit),
        Number::Float(value) => {
            let value = value * 10_f64.powi(exponent);
            (0.0..9e18).contains(&value).then(|| value.round() as u64)
        }
    }
}

impl Source for Arrays {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let mut count = CHUNK_EVENTS.min(usize::try_from(self.left).unwrap_or(usize::MAX));
        for array in &mut self.arrays {
            let available = array.input.peek(array.stride * CHUNK_EVENTS)?.len();
            count = count.min(available / array.stride);
        }
        if count == 0 {
            if self.left > 0 {
                side.notes.push(format!("the file ends {} events early", self.left));
            } else {
                self.note_rest(side)?;
            }
            return Ok(false);
        }
        events.reserve(count);
        for index in 0..count {
            let event = self.event(index).map_err(|what| RecordingError::Damaged {
                format: "NPY",
                place: Place::Record(self.record + index as u64),
                what,
            })?;
            events.push(event);
        }
        for array in &mut self.arrays {
            array.input.consume(array.stride * count);
        }
        self.left -= count as u64;
        self.record += count as u64;
        // What follows is noted when nothing more is read.
        Ok(true)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test")]
mod tests {
    use super::*;
    use crate::recording::npy::MAGIC;

    /// An array file with one event at (1, 2).
    fn file(time_kind: &str, time: [u8; 8]) -> Vec<u8> {
        let header = format!(
            "{{'descr': [('t', '{time_kind}'), ('x', '<u2'), ('y', '<u2'), ('p', '?')], 'fortran_order': False, 'shape': (1,)}}"
        );
        let length = (header.len() as u16).to_le_bytes();
        [MAGIC, &[1, 0], &length, header.as_bytes(), &time, &[1, 0, 2, 0, 1]].concat()
    }

    fn event(time_kind: &str, time: [u8; 8]) -> Result<Event, RecordingError> {
        let bytes = std::io::Cursor::new(file(time_kind, time));
        let mut source = open(Input::new(Box::new(bytes)), None)?.source;
        let mut events = Vec::new();
        source.read(&mut events, &mut Side::default())?;
        Ok(events[0])
    }

    #[test]
    fn a_time_that_is_none_is_told_as_a_number() {
        let told = |kind, time| event(kind, time).unwrap_err().to_string();
        let negative = told("<i8", (-500_i64).to_le_bytes());
        assert!(negative.starts_with("NPY, record 0: the time is -500\n"), "{negative}");
        let fraction = told("<f8", (-0.25_f64).to_le_bytes());
        assert!(fraction.starts_with("NPY, record 0: the time is -0.25\n"), "{fraction}");
        assert_eq!(event("<i8", 500_i64.to_le_bytes()).unwrap().t_us, 500);
    }

    /// Robots' recorders write them so: taken for microseconds, a rotor would turn a thousand times slower than it does.
    #[test]
    fn whole_times_are_nanoseconds_where_they_are_as_large_as_those_since_1970() {
        let (ns, us) = (1_700_000_000_123_456_789_u64, 1_700_000_000_123_456);
        for kind in ["<i8", "<u8"] {
            assert_eq!(event(kind, ns.to_le_bytes()).unwrap().t_us, us, "{kind}");
            // A thousand times smaller they are microseconds since then.
            assert_eq!(event(kind, us.to_le_bytes()).unwrap().t_us, us, "{kind}");
        }
    }
}

//! The header of an array: which number lies where.

use std::fmt;

use super::MAGIC;
use super::literal::Value;
use crate::recording::error::{Place, RecordingError};
use crate::recording::input::Input;

/// Longest header that is read.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// Type of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    class: Class,
    pub bytes: usize,
    big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Unsigned,
    Signed,
    Float,
}

/// A number as read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    Unsigned(u64),
    Signed(i64),
    Float(f64),
}

impl Number {
    pub const fn as_f64(self) -> f64 {
        match self {
            Self::Unsigned(value) => value as f64,
            Self::Signed(value) => value as f64,
            Self::Float(value) => value,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsigned(value) => write!(f, "{value}"),
            Self::Signed(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
        }
    }
}

impl Kind {
    /// Parses a type string such as "<u8", "|b1", "?", ">f4".
    pub fn parse(text: &str) -> Option<Self> {
        let (big_endian, rest) = match text.as_bytes().first()? {
            b'>' => (true, &text[1..]),
            b'<' | b'=' | b'|' => (false, &text[1..]),
            _ => (false, text),
        };
        let (class, bytes) = match rest {
            "?" | "b1" | "u1" => (Class::Unsigned, 1),
            "i1" => (Class::Signed, 1),
            "u2" => (Class::Unsigned, 2),
            "i2" => (Class::Signed, 2),
            "u4" => (Class::Unsigned, 4),
            "i4" => (Class::Signed, 4),
            "u8" => (Class::Unsigned, 8),
            "i8" => (Class::Signed, 8),
            "f4" => (Class::Float, 4),
            "f8" => (Class::Float, 8),
            _ => return None,
        };
        Some(Self { class, bytes, big_endian })
    }

    /// Whether numbers of this type may have fractions.
    pub fn is_float(self) -> bool {
        self.class == Class::Float
    }

    /// The number at the start of `bytes`; missing bytes count as zero.
    #[inline]
    pub fn read(self, bytes: &[u8]) -> Number {
        let part = |length: usize| {
            let mut all = [0; 8];
            let bytes = &bytes[..bytes.len().min(length)];
            all[..bytes.len()].copy_from_slice(bytes);
            u64::from_le_bytes(all)
        };
        // Lengths known to the compiler make plain loads of these.
        let little = match self.bytes {
            1 => part(1),
            2 => part(2),
            4 => part(4),
            _ => part(8),
        };
        let value = if self.big_endian {
            little.swap_bytes() >> (64 - 8 * self.bytes as u32)
        } else {
            little
        };
        let unused = 64 - 8 * self.bytes as u32;
        match self.class {
            Class::Unsigned => Number::Unsigned(value),
            Class::Signed => Number::Signed((value << unused).cast_signed() >> unused),
            Class::Float if self.bytes == 4 => {
                Number::Float(f64::from(f32::from_bits((value & 0xffff_ffff) as u32)))
            }
            Class::Float => Number::Float(f64::from_bits(value)),
        }
    }
}

/// What an array consists of.
#[derive(Clone, Debug, PartialEq)]
pub enum Elements {
    /// Records with named fields: names (name and title), type, offset.
    Records(Vec<(Vec<String>, Kind, usize)>),
    /// Plain numbers of one type.
    Plain(Kind),
}

/// Header of an array.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayHeader {
    pub elements: Elements,
    /// Bytes of one element.
    pub element_bytes: usize,
    pub shape: Vec<u64>,
}

impl ArrayHeader {
    /// Reads and consumes the header.
    pub fn read(input: &mut Input) -> Result<Self, RecordingError> {
        let offset = input.offset();
        let damaged = |what: String| RecordingError::Damaged {
            format: "NPY",
            place: Place::Byte(offset),
            what,
        };
        let cut = || damaged("the file ends inside the array's header".to_owned());
        let fixed = input.peek(12)?;
        if !fixed.starts_with(MAGIC) {
            return Err(damaged("no NumPy array".to_owned()));
        }
        let &[major, _, l0, l1, l2, l3] =
            fixed.get(6..12).and_then(|rest| rest.first_chunk()).ok_or_else(cut)?;
        let (start, length) = match major {
            1 => (10, usize::from(u16::from_le_bytes([l0, l1]))),
            _ => (12, u32::from_le_bytes([l0, l1, l2, l3]) as usize),
        };
        if length > MAX_HEADER_BYTES {
            return Err(damaged(format!("an array header of {length} bytes")));
        }
        let text = input.peek(start + length)?.get(start..start + length).ok_or_else(cut)?;
        let header = std::str::from_utf8(text)
            .ok()
            .and_then(Value::parse)
            .and_then(|value| Self::from_literal(&value))
            .ok_or_else(|| damaged("an array header that is not understood".to_owned()))?;
        input.consume(start + length);
        header.map_err(|what| RecordingError::Unsupported {
            what,
            advice: "save it as a structured array with the fields t, x, y, p (row order)"
                .to_owned(),
        })
    }

    /// `None` for a literal that is no header, an error for one that is not read here.
    fn from_literal(value: &Value) -> Option<Result<Self, String>> {
        let Value::List(sides) = value.get("shape")? else { return None };
        let shape: Vec<u64> = sides
            .iter()
            .map(|side| match side {
                Value::Word(word) => word.parse().ok(),
                _ => None,
            })
            .collect::<Option<_>>()?;
        let fortran = value.get("fortran_order") == Some(&Value::Word("True".to_owned()));
        if fortran && shape.len() > 1 {
            return Some(Err("an array in column order is not read".to_owned()));
        }
        Some(match value.get("descr")? {
            Value::Text(text) => match Kind::parse(text) {
                Some(kind) => {
                    Ok(Self { elements: Elements::Plain(kind), element_bytes: kind.bytes, shape })
                }
                None => Err(format!("an array of type \"{text}\" is not read")),
            },
            Value::List(fields) => records(fields).map(|(elements, element_bytes)| Self {
                elements,
                element_bytes,
                shape,
            }),
            _ => return None,
        })
    }
}

fn records(fields: &[Value]) -> Result<(Elements, usize), String> {
    let mut offset = 0_usize;
    let mut found = Vec::new();
    for field in fields {
        let Value::List(parts) = field else { return Err("a field that is no tuple".to_owned()) };
        let (names, kind) = match parts.as_slice() {
            [Value::Text(name), Value::Text(kind)] => (vec![name.clone()], kind),
            [Value::List(both), Value::Text(kind)] => {
                let text = |value: &Value| match value {
                    Value::Text(text) => Some(text.clone()),
                    _ => None,
                };
                (both.iter().filter_map(text).collect(), kind)
            }
            _ => return Err("nested fields are not read".to_owned()),
        };
        // Padding is written as a field of raw bytes, "|V3".
        if let Some(padding) = kind.strip_prefix("|V").and_then(|count| count.parse::<u16>().ok()) {
            offset += usize::from(padding);
            continue;
        }
        let kind =
            Kind::parse(kind).ok_or_else(|| format!("a field of type \"{kind}\" is not read"))?;
        found.push((names, kind, offset));
        offset += kind.bytes;
    }
    if offset == 0 {
        return Err("an array without fields".to_owned());
    }
    Ok((Elements::Records(found), offset))
}

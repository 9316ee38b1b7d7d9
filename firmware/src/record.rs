//! Eight-byte event records: what a recording for the device holds, and one of its own.
//!
//! All numbers are little-endian. A recording begins with a header of 24 bytes:
//!
//! | byte | field |
//! |---|---|
//! | 0 | `evtach8\n` |
//! | 8 | time of the first event in microseconds, u64 |
//! | 16 | sensor width in pixels, u16 |
//! | 18 | sensor height in pixels, u16 |
//! | 20 | number of events, u32 |
//!
//! and goes on with one record per event, in time order:
//!
//! | byte | field |
//! |---|---|
//! | 0 | low 32 bits of the time in microseconds |
//! | 4 | column in pixels, u16 |
//! | 6 | row in pixels in bits 0 to 14; bit 15: the pixel became brighter |

use evtach_core::{Event, Geometry, PackedEvent, Polarity};

/// Bytes of one record.
pub const RECORD_BYTES: usize = 8;

/// One event as eight bytes.
pub type Record = [u8; RECORD_BYTES];

const MAGIC: [u8; 8] = *b"evtach8\n";

/// Why a recording for the device cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HeaderError {
    /// The first bytes are not those of a recording.
    #[error(
        "byte 0: this is no recording for the device: `evtach convert FILE OUT.ev8` writes one"
    )]
    Magic,
    /// The sensor size is zero or beyond [`Geometry::MAX_PX`].
    #[error("byte 16: a sensor of {width_px}x{height_px} pixels: each side must be 1 to 2048")]
    Geometry {
        /// Width as it stands in the header.
        width_px: u16,
        /// Height as it stands in the header.
        height_px: u16,
    },
}

/// What stands before the records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Header {
    /// Size of the sensor.
    pub geometry: Geometry,
    /// Time of the first event in microseconds.
    pub first_us: u64,
    /// Number of records that follow.
    pub events: u32,
}

impl Header {
    /// Bytes of a header.
    pub const BYTES: usize = 24;

    /// Reads a header.
    ///
    /// # Errors
    ///
    /// When the bytes are not a header, or the sensor size is out of range.
    pub fn parse(bytes: &[u8; Self::BYTES]) -> Result<Self, HeaderError> {
        if !bytes.starts_with(&MAGIC) {
            return Err(HeaderError::Magic);
        }
        let [.., t0, t1, t2, t3, t4, t5, t6, t7, w0, w1, h0, h1, n0, n1, n2, n3] = *bytes;
        let width_px = u16::from_le_bytes([w0, w1]);
        let height_px = u16::from_le_bytes([h0, h1]);
        Ok(Self {
            geometry: Geometry::new(width_px, height_px)
                .ok_or(HeaderError::Geometry { width_px, height_px })?,
            first_us: u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]),
            events: u32::from_le_bytes([n0, n1, n2, n3]),
        })
    }

    /// The header's bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; Self::BYTES] {
        let [m0, m1, m2, m3, m4, m5, m6, m7] = MAGIC;
        let [t0, t1, t2, t3, t4, t5, t6, t7] = self.first_us.to_le_bytes();
        let [w0, w1] = self.geometry.width_px.to_le_bytes();
        let [h0, h1] = self.geometry.height_px.to_le_bytes();
        let [n0, n1, n2, n3] = self.events.to_le_bytes();
        [
            m0, m1, m2, m3, m4, m5, m6, m7, t0, t1, t2, t3, t4, t5, t6, t7, w0, w1, h0, h1, n0, n1,
            n2, n3,
        ]
    }
}

/// Bit of the polarity in the row.
const BRIGHTER: u16 = 1 << 15;

/// The record of an event; rows beyond 32 767 become that one.
#[must_use]
pub fn encode(event: &Event) -> Record {
    let [t0, t1, t2, t3] = (event.t_us as u32).to_le_bytes();
    let [x0, x1] = event.x.to_le_bytes();
    let brighter = if event.polarity == Polarity::On { BRIGHTER } else { 0 };
    let [y0, y1] = (event.y.min(BRIGHTER - 1) | brighter).to_le_bytes();
    [t0, t1, t2, t3, x0, x1, y0, y1]
}

/// The record of an event in a block.
#[must_use]
pub(crate) fn encode_packed(event: PackedEvent) -> Record {
    encode(&event.unpack(event.low_us().into()))
}

/// The event of a record, as blocks carry it.
#[must_use]
pub(crate) fn pack(record: Record) -> PackedEvent {
    let [t0, t1, t2, t3, x0, x1, y0, y1] = record;
    let (x, y) = (u16::from_le_bytes([x0, x1]), u16::from_le_bytes([y0, y1]));
    let polarity = if y & BRIGHTER == 0 { Polarity::Off } else { Polarity::On };
    PackedEvent::new(u32::from_le_bytes([t0, t1, t2, t3]), x, y & !BRIGHTER, polarity)
}

/// Turns records back into events.
#[derive(Clone, Copy, Debug)]
pub struct Decoder {
    latest_us: u64,
}

impl Decoder {
    /// A decoder for a stream that begins at `first_us` microseconds.
    #[must_use]
    pub const fn new(first_us: u64) -> Self {
        Self { latest_us: first_us }
    }

    /// The event of a record. Records may lie up to 35 minutes before or after their predecessor.
    pub fn decode(&mut self, record: Record) -> Event {
        let event = pack(record).unpack(self.latest_us);
        self.latest_us = event.t_us;
        event
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GEOMETRY: Geometry = Geometry { width_px: 346, height_px: 260 };

    #[test]
    fn header_comes_back() {
        let header = Header { geometry: GEOMETRY, first_us: 1 << 40, events: 70_000 };
        assert_eq!(Header::parse(&header.encode()), Ok(header));
    }

    #[test]
    fn foreign_bytes_and_impossible_sensors_are_refused() {
        assert_eq!(Header::parse(&[0; Header::BYTES]), Err(HeaderError::Magic));
        let mut bytes = Header { geometry: GEOMETRY, first_us: 0, events: 0 }.encode();
        bytes[16..18].copy_from_slice(&4096_u16.to_le_bytes());
        assert_eq!(
            Header::parse(&bytes),
            Err(HeaderError::Geometry { width_px: 4096, height_px: 260 })
        );
    }

    #[test]
    fn events_come_back_over_the_wrap_of_the_32_bit_clock() {
        let first_us = u64::from(u32::MAX) - 1;
        let mut decoder = Decoder::new(first_us);
        for (step, polarity) in [(0, Polarity::On), (1, Polarity::Off), (2, Polarity::On)] {
            let event = Event { t_us: first_us + step, x: 345, y: 259, polarity };
            assert_eq!(decoder.decode(encode(&event)), event);
        }
    }

    #[test]
    fn time_may_step_back() {
        let mut decoder = Decoder::new(1_000);
        let early = Event { t_us: 990, x: 0, y: 0, polarity: Polarity::Off };
        assert_eq!(decoder.decode(encode(&early)), early);
    }
}

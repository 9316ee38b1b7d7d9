//! Reading AEDAT 4.

use evtach_core::{Event, Polarity};

use super::flat::Table;
use super::header::Header;
use super::packet::{Found, Packets};
use crate::recording::error::{Place, RecordingError};
use crate::recording::geometry::KnownSize;
use crate::recording::imu::{ImuSample, from_degrees, from_gravities};
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

/// Opens an AEDAT 4 file.
pub(crate) fn open(mut input: Input) -> Result<Opened, RecordingError> {
    let header = Header::read(&mut input)?;
    let mut streams = header.of_kind("EVTS");
    let Some(stream) = streams.next() else {
        let kinds: Vec<&str> = header.streams.iter().map(|stream| stream.kind.as_str()).collect();
        return Err(RecordingError::Unsupported {
            what: format!("this AEDAT4 file holds no events, only [{}]", kinds.join(", ")),
            advice: "record again with the event stream switched on".to_owned(),
        });
    };
    let geometry = stream
        .geometry
        .map(|size| KnownSize::new(size, format!("from the header of stream {}", stream.id)));
    let mut assumed = Vec::new();
    let others: Vec<String> = streams.map(|other| other.id.to_string()).collect();
    if !others.is_empty() {
        assumed.push(format!(
            "stream {} is the one to read; event streams {} are left out",
            stream.id,
            others.join(", ")
        ));
    }
    let about = stream.source.iter().map(|source| ("source".to_owned(), source.clone())).collect();
    let mut side_notes = Vec::new();
    if header.packets_end.is_none() {
        side_notes.push(
            "the header does not say where the packets end, as in a pipe or a recording that was not closed: read up to the end"
                .to_owned(),
        );
    }
    let source = Aedat4 {
        packets: Packets::new(input, header.compression, header.packets_end),
        stream: stream.id,
        imu_stream: header.of_kind("IMUS").next().map(|stream| stream.id),
        notes: side_notes,
    };
    Ok(Opened { format: "AEDAT4", geometry, assumed, about, source: Box::new(source) })
}

struct Aedat4 {
    packets: Packets,
    stream: i32,
    imu_stream: Option<i32>,
    notes: Vec<String>,
}

impl Source for Aedat4 {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        side.notes.append(&mut self.notes);
        let offset = self.packets.offset();
        let stream = self.stream;
        let imu_stream = self.imu_stream;
        match self.packets.next(|id| id == stream || Some(id) == imu_stream)? {
            Found::Packet(id) => {
                let content = self.packets.content();
                let taken = if id == stream {
                    take_events(content, events)
                } else {
                    take_imu(content, &mut side.imu)
                };
                taken.map_err(|what| RecordingError::Damaged {
                    format: "AEDAT4",
                    place: Place::Byte(offset),
                    what,
                })?;
                Ok(true)
            }
            Found::Skipped => Ok(true),
            Found::End => {
                if let Some(at) = self.packets.further()? {
                    side.notes.push(format!(
                        "another recording begins at byte {at} and was left out: cut the file there to read it"
                    ));
                }
                Ok(false)
            }
            Found::Cut(bytes) => {
                side.notes.push(format!(
                    "the file ends inside a packet: {bytes} bytes at byte {offset} left out"
                ));
                Ok(false)
            }
        }
    }
}

/// Appends the events of an EVTS packet: structures of i64 time in microseconds, i16 x, i16 y, bool, padding.
fn take_events(content: &[u8], events: &mut Vec<Event>) -> Result<(), String> {
    let structs = Table::root(content, b"EVTS")
        .and_then(|table| table.structs::<16>(0))
        .ok_or("an event packet that is no EVTS table")?;
    events.reserve(structs.len());
    let mut negative = false;
    events.extend(structs.iter().map(
        |&[t0, t1, t2, t3, t4, t5, t6, t7, x0, x1, y0, y1, on, ..]| {
            let t = i64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
            negative |= t < 0;
            Event {
                t_us: t.cast_unsigned(),
                // A negative coordinate becomes one off any sensor, which is counted as out of bounds.
                x: u16::from_le_bytes([x0, x1]),
                y: u16::from_le_bytes([y0, y1]),
                polarity: if on == 0 { Polarity::Off } else { Polarity::On },
            }
        },
    ));
    if negative {
        let good = events.iter().position(|event| event.t_us > i64::MAX as u64);
        events.truncate(good.unwrap_or(events.len()));
        return Err("an event before the year 1970".to_owned());
    }
    Ok(())
}

/// Appends the samples of an IMUS packet: acceleration in g and rate in degrees per second, in the camera's axes.
fn take_imu(content: &[u8], samples: &mut Vec<ImuSample>) -> Result<(), String> {
    let tables = Table::root(content, b"IMUS")
        .and_then(|table| table.tables(0))
        .ok_or("an inertial packet that is no IMUS table")?;
    for table in tables {
        let three = |first: usize| {
            [first, first + 1, first + 2].map(|field| table.f32(field).unwrap_or_default())
        };
        let t = table.i64(0).unwrap_or_default();
        samples.push(ImuSample {
            t_us: u64::try_from(t).map_err(|_| "an inertial sample before the year 1970")?,
            accel_m_s2: from_gravities(three(2)),
            gyro_rad_s: from_degrees(three(5)),
        });
    }
    Ok(())
}

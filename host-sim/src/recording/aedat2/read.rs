//! Reading AEDAT 1.0 and 2.0.

use evtach_core::{Event, Geometry};

use super::Header;
use super::chip::{self, Address, Layout};
use crate::recording::clock::Clock32;
use crate::recording::error::RecordingError;
use crate::recording::geometry::KnownSize;
use crate::recording::imu::{ImuSample, from_degrees, from_gravities};
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

/// Records decoded in one go.
const CHUNK_RECORDS: usize = 16 * 1024;
/// Bytes looked at to guess the camera.
const GUESS_BYTES: usize = 64 * 1024;

/// Opens the file; `known` is its size where the person or a first pass over the file told it.
pub(crate) fn open(
    mut input: Input,
    format: &'static str,
    address_bytes: usize,
    known: Option<Geometry>,
) -> Result<Opened, RecordingError> {
    let header = Header::read(&mut input)?;
    let mut assumed = Vec::new();
    let (layout, geometry) =
        match header.get("AEChip:").and_then(|name| Some((name, chip::of_name(name)?))) {
            Some((name, (layout, size))) => (
                layout,
                Some(KnownSize::new(size, format!("from the header line \"AEChip: {name}\""))),
            ),
            None => guess(&mut input, address_bytes, &mut assumed)?,
        };
    let gyro_scale = header.gyro_scale();
    if layout == Layout::Davis {
        assumed.push(match gyro_scale {
            Some(scale) => {
                format!("gyro range {scale} deg/s from the header, if there are gyro samples")
            }
            None => format!(
                "gyro range {DEFAULT_GYRO_SCALE} deg/s (jAER's default), if there are gyro samples"
            ),
        });
    }
    let source = Pairs {
        input,
        layout,
        flip: known.or(geometry.as_ref().map(|told| told.size)),
        record_bytes: address_bytes + 4,
        clock: Clock32::default(),
        imu: Imu {
            words: [0; 7],
            next: 0,
            degrees_per_lsb: gyro_scale.unwrap_or(DEFAULT_GYRO_SCALE) as f32 / 32768.0,
            gravities_per_lsb: header.accel_scale().unwrap_or(DEFAULT_ACCEL_SCALE) as f32 / 32768.0,
        },
    };
    let about = header.about();
    Ok(Opened { format, geometry, assumed, about, source: Box::new(source) })
}

/// Full scale of the gyroscope in degrees per second as jAER sets it up.
const DEFAULT_GYRO_SCALE: u32 = 1000;
/// Full scale of the accelerometer in multiples of gravity as jAER sets it up.
const DEFAULT_ACCEL_SCALE: u32 = 8;

impl Header {
    /// Full scale of the gyroscope where the copied preferences tell it.
    fn gyro_scale(&self) -> Option<u32> {
        self.preference("GyroFullScaleDegPerSec")
    }

    /// Full scale of the accelerometer where the copied preferences tell it.
    fn accel_scale(&self) -> Option<u32> {
        self.preference("ImuAccelScaleG")
    }

    /// The number behind a name inside a preference's value.
    fn preference(&self, name: &str) -> Option<u32> {
        self.lines.iter().find_map(|line| {
            let rest = &line[line.find(name)? + name.len()..];
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            rest[..end].parse().ok().filter(|&scale| (1..=4000).contains(&scale))
        })
    }

    /// Lines of the form "key: value".
    fn about(&self) -> Vec<(String, String)> {
        self.lines
            .iter()
            .filter(|line| !line.starts_with(['<', '!']))
            .filter_map(|line| line.split_once(": "))
            .map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
            .collect()
    }
}

/// Guesses the camera from the addresses: a DVS128 never uses more than 16 bits.
fn guess(
    input: &mut Input,
    address_bytes: usize,
    assumed: &mut Vec<String>,
) -> Result<(Layout, Option<KnownSize>), RecordingError> {
    let bytes = input.peek(GUESS_BYTES)?;
    let small =
        address_bytes == 2 || bytes.chunks_exact(8).all(|record| record[0] == 0 && record[1] == 0);
    Ok(if small {
        let how = "of a DVS128: the header names no camera and the addresses have 16 bits";
        (Layout::Dvs128, Geometry::new(128, 128).map(|size| KnownSize::new(size, how)))
    } else {
        assumed
            .push("a DAVIS: the header names no camera and the addresses have 32 bits".to_owned());
        (Layout::Davis, None)
    })
}

struct Pairs {
    input: Input,
    layout: Layout,
    /// Size to turn columns and rows round in; `None` while it is being found out.
    flip: Option<Geometry>,
    record_bytes: usize,
    clock: Clock32,
    imu: Imu,
}

/// Puts the seven words of an inertial sample together.
struct Imu {
    words: [i16; 7],
    next: usize,
    degrees_per_lsb: f32,
    gravities_per_lsb: f32,
}

impl Imu {
    fn take(&mut self, index: usize, value: i16, t_us: u64) -> Option<ImuSample> {
        if index != self.next || index >= 7 {
            self.next = 0;
            if index != 0 {
                return None;
            }
        }
        self.words[index] = value;
        self.next = index + 1;
        if self.next < 7 {
            return None;
        }
        self.next = 0;
        let [ax, ay, az, _, gx, gy, gz] = self.words.map(f32::from);
        // The chip's axes point left, down and to the back, by the signs jAER documents for pan, tilt and roll.
        let axes = |x: f32, y: f32, z: f32, scale: f32| [-x * scale, y * scale, -z * scale];
        Some(ImuSample {
            t_us,
            gyro_rad_s: from_degrees(axes(gx, gy, gz, self.degrees_per_lsb)),
            accel_m_s2: from_gravities(axes(ax, ay, az, self.gravities_per_lsb)),
        })
    }
}

/// A column or row counted from the other end; off the sensor it stays off it.
fn from_other_end(size: u16, at: u16) -> u16 {
    (size - 1).checked_sub(at).unwrap_or(u16::MAX)
}

impl Source for Pairs {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let record_bytes = self.record_bytes;
        let bytes = self.input.peek(record_bytes)?;
        let records = (bytes.len() / record_bytes).min(CHUNK_RECORDS);
        if records == 0 {
            let rest = bytes.len();
            if rest > 0 {
                let offset = self.input.offset();
                side.notes.push(format!(
                    "the file ends inside a record: {rest} bytes at byte {offset} left out"
                ));
                self.input.consume(rest);
            }
            return Ok(false);
        }
        events.reserve(records);
        for record in bytes[..records * record_bytes].chunks_exact(record_bytes) {
            let (address, time) = record.split_at(record_bytes - 4);
            let address = address.iter().fold(0, |sum, &byte| sum << 8 | u32::from(byte));
            let time = time.iter().fold(0, |sum, &byte| sum << 8 | u32::from(byte));
            let t_us = self.clock.advance(time, &mut side.wraps);
            match self.layout.split(address) {
                Address::Pixel { column, row, polarity } => {
                    let (x, y) = self.flip.map_or((column, row), |size| {
                        (from_other_end(size.width_px, column), from_other_end(size.height_px, row))
                    });
                    events.push(Event { t_us, x, y, polarity });
                }
                Address::Imu { index, value } => side.imu.extend(self.imu.take(index, value, t_us)),
                Address::Other => {}
            }
        }
        self.input.consume(records * record_bytes);
        Ok(true)
    }
}

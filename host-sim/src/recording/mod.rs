//! Event recordings: one folder a format, found by looking inside.

mod aedat2;
mod aedat3;
mod aedat4;
mod clock;
mod csv;
mod dat;
mod error;
mod es;
mod ev8;
mod geometry;
mod imu;
mod input;
mod npy;
mod open;
mod prophesee_header;
mod raw;
mod ros2;
mod spi;
mod time_unit;
pub mod write;

use evtach_core::decode::Counts;
use evtach_core::{Event, Geometry};

pub use error::{Place, RecordingError};
pub use imu::ImuSample;
use open::Progress;
pub use open::{open, open_reader};
pub use time_unit::TimeUnit;

/// What is said of a recording that [is shuffled](Recording::is_shuffled).
pub const SHUFFLED: &str =
    "the recording is not in time order; sort its events by time, then try again";

/// Parses a sensor size such as "640x480".
///
/// # Errors
/// When it is no size, or a side is 0 or longer than [`Geometry::MAX_PX`].
pub fn parse_geometry(text: &str) -> Result<Geometry, String> {
    geometry::parse(text).ok_or_else(|| {
        format!(
            "\"{text}\" is no sensor size; write for example 640x480, each side 1 to {}",
            Geometry::MAX_PX
        )
    })
}

/// What the person knows about a recording that the file may not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenOptions {
    /// Size of the sensor; overrides what the file says.
    pub geometry: Option<Geometry>,
    /// Unit of the times in a text or NumPy recording; overrides what the file says. Others are refused with it.
    pub time_unit: Option<TimeUnit>,
}

/// What a format's reader knows after its header.
pub(crate) struct Opened {
    pub format: &'static str,
    pub geometry: Option<geometry::KnownSize>,
    /// What else was assumed, one sentence each.
    pub assumed: Vec<String>,
    pub about: Vec<(String, String)>,
    pub source: Box<dyn Source>,
}

/// The events of one format, piece by piece.
pub(crate) trait Source: Send {
    /// Appends some events; `false` at the end. On an error, what was appended before it is good.
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError>;
}

/// What a recording tells beside its events.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Side {
    /// Events that the sensor or the link reported lost.
    pub lost: u64,
    /// Times the format's clock wrapped.
    pub wraps: u64,
    /// Events dropped because the stream had not told the time yet.
    pub untimed: u64,
    /// Words of a type that the format does not define.
    pub unknown: u64,
    /// Inertial samples since they were last taken.
    pub imu: Vec<ImuSample>,
    /// What a person should know, one sentence each: cut files, skipped streams.
    pub notes: Vec<String>,
    /// Whether what comes next is another recording, with a clock of its own.
    pub(crate) starts_anew: bool,
}

impl Side {
    /// Takes over what Prophesee's words told since the start.
    fn note(&mut self, counts: Counts) {
        self.wraps = counts.wraps.into();
        self.untimed = counts.untimed;
        self.unknown = counts.unknown;
    }
}

/// An open recording.
pub struct Recording {
    /// Name of the format, for example "EVT3".
    pub format: &'static str,
    /// Size of the sensor in pixels.
    pub geometry: Geometry,
    /// What was assumed, one sentence each.
    pub assumed: Vec<String>,
    /// What the header tells: sensor, serial number, software.
    pub about: Vec<(String, String)>,
    source: Box<dyn Source>,
    progress: Progress,
    side: Side,
    delivered: u64,
    out_of_order: u64,
    out_of_bounds: u64,
    last_us: u64,
    starts_anew: bool,
    ended: bool,
    pending: Option<RecordingError>,
}

impl Recording {
    /// Events kept from growing without bound when a reader hands out little at a time.
    const CHUNK_EVENTS: usize = 16_384;
    /// More than one step back in so many events is no time order.
    const SHUFFLED_ONE_OF: u64 = 10;

    fn new(opened: Opened, geometry: &geometry::KnownSize, progress: Progress) -> Self {
        let mut assumed = opened.assumed;
        assumed.insert(0, geometry.sentence());
        Self {
            format: opened.format,
            geometry: geometry.size,
            assumed,
            about: opened.about,
            source: opened.source,
            progress,
            side: Side::default(),
            delivered: 0,
            out_of_order: 0,
            out_of_bounds: 0,
            last_us: 0,
            starts_anew: false,
            ended: false,
            pending: None,
        }
    }

    /// Appends the next events (some ten thousand) and tells whether there may be more.
    ///
    /// Events outside the sensor are counted and left out; events that step back in time are counted and kept.
    ///
    /// # Errors
    /// When the recording is damaged or cannot be read on. The events before the damage have then been delivered by
    /// the calls before.
    pub fn read_chunk(&mut self, events: &mut Vec<Event>) -> Result<bool, RecordingError> {
        if let Some(error) = self.pending.take() {
            self.ended = true;
            return Err(error);
        }
        let first = events.len();
        self.starts_anew = false;
        while !self.ended && events.len() - first < Self::CHUNK_EVENTS {
            let before = events.len();
            match self.source.read(events, &mut self.side) {
                Ok(more) => self.ended = !more,
                Err(error) => {
                    self.check(events, before);
                    if events.len() == first {
                        self.ended = true;
                        return Err(error);
                    }
                    self.pending = Some(error);
                    return Ok(true);
                }
            }
            self.check(events, before);
            if std::mem::take(&mut self.side.starts_anew) {
                self.starts_anew = true;
                break;
            }
        }
        Ok(!self.ended)
    }

    /// Whether the last chunk ended where another recording was put behind: the clock of what comes next is another one, wherever
    /// its times lie.
    #[must_use]
    pub const fn starts_anew(&self) -> bool {
        self.starts_anew
    }

    /// Drops and counts what lies outside the sensor, counts steps back in time.
    fn check(&mut self, events: &mut Vec<Event>, first: usize) {
        let geometry = self.geometry;
        let (mut outside, mut steps_back, mut last_us) = (false, 0, self.last_us);
        for event in &events[first..] {
            outside |= !geometry.contains(event.x, event.y);
            steps_back += u64::from(event.t_us < last_us);
            last_us = event.t_us;
        }
        if outside {
            // Rare: go over them again without those.
            let before = events.len();
            let mut index = 0;
            events.retain(|event| {
                let keep = index < first || geometry.contains(event.x, event.y);
                index += 1;
                keep
            });
            self.out_of_bounds += (before - events.len()) as u64;
            (steps_back, last_us) = (0, self.last_us);
            for event in &events[first..] {
                steps_back += u64::from(event.t_us < last_us);
                last_us = event.t_us;
            }
        }
        self.delivered += (events.len() - first) as u64;
        self.out_of_order += steps_back;
        self.last_us = last_us;
    }

    /// Events so far that stepped back in time relative to the one before.
    #[must_use]
    pub const fn out_of_order(&self) -> u64 {
        self.out_of_order
    }

    /// Whether so many events stepped back in time that the rest are no sample of what was recorded, but bursts that fit any
    /// speed. A clock that was set back once is no such thing.
    #[must_use]
    pub const fn is_shuffled(&self) -> bool {
        self.out_of_order > self.delivered / Self::SHUFFLED_ONE_OF
    }

    /// Events so far that lay outside the sensor and were left out.
    #[must_use]
    pub const fn out_of_bounds(&self) -> u64 {
        self.out_of_bounds
    }

    /// What the recording told beside its events so far: losses, wraps, notes.
    #[must_use]
    pub const fn side(&self) -> &Side {
        &self.side
    }

    /// What a person should know of it once it is read, one sentence each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let mut notes = self.side.notes.clone();
        if self.side.unknown > 0 {
            notes.push(format!(
                "{} words of unknown type left out; many mean damage, or another format or byte order",
                self.side.unknown
            ));
        }
        if self.out_of_bounds > 0 {
            notes.push(format!(
                "{} events outside the sensor left out; state its size with --geometry WxH if it is wrong",
                self.out_of_bounds
            ));
        }
        notes
    }

    /// Bytes of the file read so far, for a progress bar (not counted inside .npz).
    #[must_use]
    pub fn bytes_read(&self) -> u64 {
        self.progress.bytes()
    }

    /// The inertial samples read since the last call, in the camera's axes.
    pub fn take_imu(&mut self) -> Vec<ImuSample> {
        std::mem::take(&mut self.side.imu)
    }

    /// Events so far that the sensor or the link reported lost.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.side.lost
    }
}

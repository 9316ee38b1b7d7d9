//! ROS 2 bags (.db3, .mcap) with event_camera_msgs.

mod cdr;
mod events;
mod mcap;
mod packet;
mod sqlite;

use std::path::Path;

use evtach_core::{Event, Geometry};

use events::PacketDecoder;
use packet::EventPacket;

use super::error::{Place, RecordingError};
use super::geometry::KnownSize;
use super::input::Input;
use super::{Opened, Side, Source};

/// First bytes of an MCAP file.
pub(crate) const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// First bytes of a SQLite file.
pub(crate) const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";
/// Largest message that is read: the bound on these readers' memory.
const MAX_MESSAGE_BYTES: usize = 64 << 20;

/// Message types that have the layout read here (the second is the old name of the first).
fn is_event_packet(kind: &str) -> bool {
    matches!(
        kind,
        "event_camera_msgs/msg/EventPacket"
            | "event_camera_msgs/EventPacket"
            | "event_array_msgs/msg/EventArray"
            | "event_array_msgs/EventArray"
    )
}

/// The messages of one topic, one after the other.
trait Messages: Send {
    /// The next message; `None` at the end.
    fn next(&mut self) -> Result<Option<Vec<u8>>, RecordingError>;
    /// Topic and what else a person should know, once it is known.
    fn assumed(&self) -> Vec<String>;
}

/// Opens an MCAP bag.
pub(crate) fn open_mcap(input: Input) -> Result<Opened, RecordingError> {
    open("ROS2 MCAP", Box::new(mcap::Bag::new(input)))
}

/// Opens a SQLite bag, which must be a file.
pub(crate) fn open_sqlite(path: &Path) -> Result<Opened, RecordingError> {
    open("ROS2 DB3", Box::new(sqlite::Bag::open(path)?))
}

fn open(format: &'static str, mut messages: Box<dyn Messages>) -> Result<Opened, RecordingError> {
    // The first packet tells the size of the sensor.
    let Some(first) = messages.next()? else {
        return Err(RecordingError::Unsupported {
            what: "this bag holds no event_camera_msgs/msg/EventPacket messages".to_owned(),
            advice: "record the topic of an event_camera_msgs driver (metavision_driver, libcaer_driver)".to_owned(),
        });
    };
    let damaged = |what| RecordingError::Damaged { format, place: Place::Record(0), what };
    let packet = EventPacket::parse(&first).map_err(damaged)?;
    let geometry = packet.size().map(|size| KnownSize::new(size, "from the first message"));
    let decoder = PacketDecoder::new(packet.encoding)?;
    let mut assumed = messages.assumed();
    assumed.push(format!("encoding \"{}\" from the first message", packet.encoding));
    let about = vec![("frame_id".to_owned(), packet.frame_id.to_owned())];
    let bag = Bag {
        format,
        messages,
        decoder,
        pending: Some(first),
        record: 0,
        sequence: None,
        missing: 0,
    };
    Ok(Opened { format, geometry, assumed, about, source: Box::new(bag) })
}

impl EventPacket<'_> {
    fn size(&self) -> Option<Geometry> {
        Geometry::new(u16::try_from(self.width).ok()?, u16::try_from(self.height).ok()?)
    }
}

struct Bag {
    format: &'static str,
    messages: Box<dyn Messages>,
    decoder: PacketDecoder,
    pending: Option<Vec<u8>>,
    record: u64,
    sequence: Option<u64>,
    missing: u64,
}

impl Source for Bag {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let message = match self.pending.take() {
            Some(message) => Some(message),
            None => self.messages.next()?,
        };
        let Some(message) = message else {
            if self.missing > 0 {
                side.notes.push(format!("{} messages are missing from the bag", self.missing));
            }
            return Ok(false);
        };
        let damaged = |what| RecordingError::Damaged {
            format: self.format,
            place: Place::Record(self.record),
            what,
        };
        let packet = EventPacket::parse(&message).map_err(damaged)?;
        if let Some(before) = self.sequence {
            self.missing += packet.sequence.saturating_sub(before).saturating_sub(1);
        }
        self.sequence = Some(packet.sequence);
        self.decoder.decode(&packet, events, side).map_err(damaged)?;
        self.record += 1;
        Ok(true)
    }
}

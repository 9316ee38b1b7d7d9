//! Bags in MCAP, read from front to back.

use std::collections::HashSet;
use std::io::Read;

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{MAX_MESSAGE_BYTES, Messages, is_event_packet};
use crate::recording::error::{Place, RecordingError};
use crate::recording::input::Input;

/// Kinds of records that are looked into.
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;

pub struct Bag {
    input: Input,
    reader: LinearReader,
    /// Schemas that are event packets.
    schemas: HashSet<u16>,
    /// The channel that is read, and its topic.
    channel: Option<(u16, String)>,
    others: Vec<String>,
    ended: bool,
}

impl Bag {
    pub fn new(input: Input) -> Self {
        let options = LinearReaderOptions::default()
            // A recording that was not closed has no end.
            .with_skip_end_magic(true)
            .with_record_length_limit(MAX_MESSAGE_BYTES);
        Self {
            input,
            reader: LinearReader::new_with_options(options),
            schemas: HashSet::new(),
            channel: None,
            others: Vec::new(),
            ended: false,
        }
    }

    /// Looks at a schema or channel.
    fn note(&mut self, record: Record<'_>) {
        match record {
            Record::Schema { header, .. } if is_event_packet(&header.name) => {
                self.schemas.insert(header.id);
            }
            Record::Channel(channel) if self.schemas.contains(&channel.schema_id) => {
                match &self.channel {
                    None => self.channel = Some((channel.id, channel.topic)),
                    Some((id, _)) if *id == channel.id => {}
                    Some(_) if !self.others.contains(&channel.topic) => {
                        self.others.push(channel.topic)
                    }
                    Some(_) => {}
                }
            }
            _ => {}
        }
    }
}

impl Messages for Bag {
    fn next(&mut self) -> Result<Option<Vec<u8>>, RecordingError> {
        while !self.ended {
            let offset = self.input.offset();
            let damaged = |what: String| RecordingError::Damaged {
                format: "ROS2 MCAP",
                place: Place::Byte(offset),
                what,
            };
            let Some(event) = self.reader.next_event() else { break };
            let (opcode, data) = match event.map_err(|error| damaged(error.to_string()))? {
                LinearReadEvent::ReadRequest(need) => {
                    // Grow as data arrives, not by what a length claims.
                    let room = self.reader.insert(need.min(1 << 20));
                    let count = self
                        .input
                        .read(room)
                        .map_err(|cause| RecordingError::Read { offset, cause })?;
                    self.reader.notify_read(count);
                    self.ended = count == 0;
                    continue;
                }
                LinearReadEvent::Record { opcode, data } => (opcode, data),
            };
            if !matches!(opcode, SCHEMA | CHANNEL | MESSAGE) {
                continue;
            }
            let record =
                mcap::parse_record(opcode, data).map_err(|error| damaged(error.to_string()))?;
            if let Record::Message { header, data } = &record {
                if self.channel.as_ref().is_some_and(|(id, _)| *id == header.channel_id) {
                    return Ok(Some(data.to_vec()));
                }
                continue;
            }
            let record = record.into_owned();
            self.note(record);
        }
        Ok(None)
    }

    fn assumed(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        if let Some((_, topic)) = &self.channel {
            sentences.push(format!("topic {topic} is the one to read"));
        }
        if !self.others.is_empty() {
            sentences.push(format!("event topics {} are left out", self.others.join(", ")));
        }
        sentences
    }
}

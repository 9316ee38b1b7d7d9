//! Writing AEDAT 4 with LZ4, as iniVation's recorder does by default.

use std::io::Write;

use evtach_core::{Event, Geometry};
use flatbuffers::FlatBufferBuilder;

use super::MAGIC;
use crate::recording::error::RecordingError;
use crate::recording::write::{Sink, Target};

/// Events in a packet.
const PACKET_EVENTS: usize = 4096;
/// The one stream's number.
const STREAM: i32 = 0;

/// One packet in the table at the end of the file.
struct Entry {
    offset: i64,
    size: i32,
    count: i64,
    first_us: i64,
    last_us: i64,
}

pub(crate) struct Aedat4Writer {
    target: Target,
    builder: FlatBufferBuilder<'static>,
    offset: u64,
    /// Where the header says where the table is.
    table_position_at: u64,
    entries: Vec<Entry>,
    pending: Vec<Event>,
}

impl Aedat4Writer {
    pub(crate) fn new(mut target: Target, geometry: Geometry) -> Result<Self, RecordingError> {
        let mut builder = FlatBufferBuilder::new();
        let (header, table_position) = header(&mut builder, geometry);
        target
            .write_all(MAGIC)
            .and_then(|()| target.write_all(&header))
            .map_err(RecordingError::Write)?;
        let start = MAGIC.len() as u64;
        Ok(Self {
            target,
            builder,
            offset: start + header.len() as u64,
            table_position_at: start + table_position as u64,
            entries: Vec::new(),
            pending: Vec::new(),
        })
    }

    fn packet(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        let (Some(first), Some(last)) = (events.first(), events.last()) else {
            return Ok(());
        };
        self.builder.reset();
        // An event is 16 bytes: pushed as two words, from the back to the front as flatbuffers are built.
        self.builder.start_vector::<u64>(events.len() * 2);
        for event in events.iter().rev() {
            let rest =
                u64::from(event.x) | u64::from(event.y) << 16 | (event.polarity as u64) << 32;
            self.builder.push(rest);
            self.builder.push(event.t_us);
        }
        let elements = self.builder.end_vector::<u64>(events.len());
        let table = self.builder.start_table();
        self.builder.push_slot_always(4, elements);
        let packet = self.builder.end_table(table);
        self.builder.finish_size_prefixed(packet, Some("EVTS"));
        let packed = compress(self.builder.finished_data())?;
        let size = i32::try_from(packed.len())
            .map_err(std::io::Error::other)
            .map_err(RecordingError::Write)?;
        self.target
            .write_all(&STREAM.to_le_bytes())
            .and_then(|()| self.target.write_all(&size.to_le_bytes()))
            .and_then(|()| self.target.write_all(&packed))
            .map_err(RecordingError::Write)?;
        self.entries.push(Entry {
            offset: (self.offset + 8).cast_signed(),
            size,
            count: events.len() as i64,
            first_us: first.t_us.cast_signed(),
            last_us: last.t_us.cast_signed(),
        });
        self.offset += 8 + packed.len() as u64;
        Ok(())
    }

    /// The table of packets that lets other readers seek (`FTAB` of the format).
    fn table(&mut self) -> Result<Vec<u8>, RecordingError> {
        let builder = &mut self.builder;
        builder.reset();
        let definitions: Vec<_> = self
            .entries
            .iter()
            .map(|entry| {
                // PacketHeader is a structure of two i32, stored in place.
                let info =
                    u64::from(STREAM.cast_unsigned()) | u64::from(entry.size.cast_unsigned()) << 32;
                let table = builder.start_table();
                builder.push_slot_always(4, entry.offset);
                builder.push_slot_always(6, info);
                builder.push_slot_always(8, entry.count);
                builder.push_slot_always(10, entry.first_us);
                builder.push_slot_always(12, entry.last_us);
                builder.end_table(table)
            })
            .collect();
        builder.start_vector::<flatbuffers::WIPOffset<u32>>(definitions.len());
        for definition in definitions.iter().rev() {
            builder.push(*definition);
        }
        let vector = builder.end_vector::<flatbuffers::WIPOffset<u32>>(definitions.len());
        let table = builder.start_table();
        builder.push_slot_always(4, vector);
        let root = builder.end_table(table);
        builder.finish_size_prefixed(root, Some("FTAB"));
        compress(builder.finished_data())
    }
}

impl Sink for Aedat4Writer {
    fn write(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        self.pending.extend_from_slice(events);
        let pending = std::mem::take(&mut self.pending);
        let mut packets = pending.chunks_exact(PACKET_EVENTS);
        for packet in &mut packets {
            self.packet(packet)?;
        }
        self.pending = packets.remainder().to_vec();
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        let rest = std::mem::take(&mut self.pending);
        self.packet(&rest)?;
        let table = self.table()?;
        self.target.write_all(&table).map_err(RecordingError::Write)?;
        let (at, position) = (self.table_position_at, self.offset.to_le_bytes());
        self.target
            .patch(at, &position)
            .and_then(|()| self.target.flush())
            .map_err(RecordingError::Write)
    }
}

fn compress(bytes: &[u8]) -> Result<Vec<u8>, RecordingError> {
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    encoder.write_all(bytes).map_err(RecordingError::Write)?;
    encoder.finish().map_err(|error| RecordingError::Write(std::io::Error::other(error)))
}

/// The header, and where in it the position of the table stands.
fn header(builder: &mut FlatBufferBuilder<'_>, geometry: Geometry) -> (Vec<u8>, usize) {
    const LZ4: i32 = 1;
    // Found again in the finished bytes; nothing else in the header looks like it.
    const PLACEHOLDER: i64 = i64::from_le_bytes(*b"\xffTABLE@\xff");
    let xml = format!(
        r#"<dv version="2.0"><node name="outInfo" path="/mainloop/Recorder/outInfo/"><node name="{STREAM}" path="/mainloop/Recorder/outInfo/{STREAM}/"><attr key="compression" type="string">LZ4</attr><attr key="originalModuleName" type="string">evtach</attr><attr key="originalOutputName" type="string">events</attr><attr key="typeDescription" type="string">Array of events (polarity ON/OFF).</attr><attr key="typeIdentifier" type="string">EVTS</attr><node name="info" path="/mainloop/Recorder/outInfo/{STREAM}/info/"><attr key="sizeX" type="int">{}</attr><attr key="sizeY" type="int">{}</attr><attr key="source" type="string">evtach</attr><attr key="tsOffset" type="long">0</attr></node></node></node></dv>"#,
        geometry.width_px, geometry.height_px
    );
    builder.reset();
    let description = builder.create_string(&xml);
    let table = builder.start_table();
    builder.push_slot_always(4, LZ4);
    builder.push_slot_always(6, PLACEHOLDER);
    builder.push_slot_always(8, description);
    let root = builder.end_table(table);
    builder.finish_size_prefixed(root, Some("IOHE"));
    let mut bytes = builder.finished_data().to_vec();
    let at = memchr::memmem::find(&bytes, &PLACEHOLDER.to_le_bytes()).unwrap_or_default();
    // Until it is closed the recording says that it has no table.
    bytes[at..at + 8].copy_from_slice(&(-1_i64).to_le_bytes());
    (bytes, at)
}

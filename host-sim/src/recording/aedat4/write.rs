//! Writing AEDAT 4 with LZ4, as iniVation's recorder does by default.

use std::io::Write;

use evtach_core::{Event, Geometry};
use flatbuffers::FlatBufferBuilder;

use super::build;
use super::{EVENT_STREAM, IMU_STREAM, MAGIC};
use crate::recording::error::RecordingError;
use crate::recording::imu::ImuSample;
use crate::recording::write::{Sink, Target};

/// Events in a packet.
const PACKET_EVENTS: usize = 4096;
/// Most inertial samples in a packet.
const PACKET_SAMPLES: usize = 1024;

/// One packet in the table at the end of the file.
pub(super) struct Entry {
    pub stream: i32,
    pub offset: i64,
    pub size: i32,
    pub count: i64,
    pub first_us: i64,
    pub last_us: i64,
}

pub(crate) struct Aedat4Writer {
    target: Target,
    builder: FlatBufferBuilder<'static>,
    offset: u64,
    /// Where the header says where the table is.
    table_position_at: u64,
    /// Where the header declares the inertial samples, and in how many bytes.
    imu_node: (u64, usize),
    entries: Vec<Entry>,
    pending: Vec<Event>,
    pending_imu: Vec<ImuSample>,
}

impl Aedat4Writer {
    pub(crate) fn new(mut target: Target, geometry: Geometry) -> Result<Self, RecordingError> {
        let mut builder = FlatBufferBuilder::new();
        let head = build::head(&mut builder, geometry);
        target
            .write_all(MAGIC)
            .and_then(|()| target.write_all(&head.bytes))
            .map_err(RecordingError::Write)?;
        let start = MAGIC.len() as u64;
        Ok(Self {
            target,
            builder,
            offset: start + head.bytes.len() as u64,
            table_position_at: start + head.table_position_at as u64,
            imu_node: (start + head.imu_node.0 as u64, head.imu_node.1),
            entries: Vec::new(),
            pending: Vec::new(),
            pending_imu: Vec::new(),
        })
    }

    /// Writes a packet of events, and before it the samples that came before the last of them: a reader then knows the
    /// camera's roll when it gets to the events.
    fn packet(&mut self, events: &[Event]) -> Result<(), RecordingError> {
        let (Some(first), Some(last)) = (events.first(), events.last()) else {
            return Ok(());
        };
        self.flush_imu()?;
        let packed = compress(build::events(&mut self.builder, events))?;
        self.put(EVENT_STREAM, &packed, events.len(), first.t_us..=last.t_us)
    }

    /// Writes the samples that wait.
    fn flush_imu(&mut self) -> Result<(), RecordingError> {
        let pending = std::mem::take(&mut self.pending_imu);
        for samples in pending.chunks(PACKET_SAMPLES) {
            if let (Some(first), Some(last)) = (samples.first(), samples.last()) {
                let packed = compress(build::imu(&mut self.builder, samples))?;
                self.put(IMU_STREAM, &packed, samples.len(), first.t_us..=last.t_us)?;
            }
        }
        Ok(())
    }

    /// Writes a packet's bytes and notes it in the table.
    fn put(
        &mut self,
        stream: i32,
        packed: &[u8],
        count: usize,
        times_us: std::ops::RangeInclusive<u64>,
    ) -> Result<(), RecordingError> {
        let size = i32::try_from(packed.len())
            .map_err(std::io::Error::other)
            .map_err(RecordingError::Write)?;
        self.target
            .write_all(&stream.to_le_bytes())
            .and_then(|()| self.target.write_all(&size.to_le_bytes()))
            .and_then(|()| self.target.write_all(packed))
            .map_err(RecordingError::Write)?;
        self.entries.push(Entry {
            stream,
            offset: (self.offset + 8).cast_signed(),
            size,
            count: count as i64,
            first_us: times_us.start().cast_signed(),
            last_us: times_us.end().cast_signed(),
        });
        self.offset += 8 + packed.len() as u64;
        Ok(())
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

    fn write_imu(&mut self, samples: &[ImuSample]) -> Result<(), RecordingError> {
        self.pending_imu.extend_from_slice(samples);
        // Where hardly an event comes they do not wait for a packet of them.
        if self.pending_imu.len() >= PACKET_SAMPLES { self.flush_imu() } else { Ok(()) }
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        let rest = std::mem::take(&mut self.pending);
        self.packet(&rest)?;
        self.flush_imu()?;
        if !self.target.can_patch() {
            // The header can no more tell where the table is: readers would take it for a packet, and without it go through the packets.
            return self.target.flush().map_err(RecordingError::Write);
        }
        let table = compress(build::table(&mut self.builder, &self.entries))?;
        self.target.write_all(&table).map_err(RecordingError::Write)?;
        if self.entries.iter().all(|entry| entry.stream != IMU_STREAM) {
            // No sample came: the header need not declare them. Blanks keep its length.
            let (at, length) = self.imu_node;
            self.target.patch(at, &vec![b' '; length]).map_err(RecordingError::Write)?;
        }
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

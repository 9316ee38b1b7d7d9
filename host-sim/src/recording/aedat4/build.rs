//! The flatbuffers that are written: header, packets and the table of packets.

use evtach_core::{Event, Geometry};
use flatbuffers::{FlatBufferBuilder, WIPOffset};

use super::write::Entry;
use super::{EVENT_STREAM, IMU_STREAM};
use crate::recording::imu::{ImuSample, to_degrees, to_gravities};

/// The bytes before the packets, and what in them is known only at the end.
pub(super) struct Head {
    pub bytes: Vec<u8>,
    /// Where the position of the table of packets stands.
    pub table_position_at: usize,
    /// Where the stream of inertial samples is declared, and in how many bytes.
    pub imu_node: (usize, usize),
}

/// The header of a recording that is not closed yet.
pub(super) fn head(builder: &mut FlatBufferBuilder<'_>, geometry: Geometry) -> Head {
    const LZ4: i32 = 1;
    // Found again in the finished bytes; nothing else in the header looks like it.
    const PLACEHOLDER: i64 = i64::from_le_bytes(*b"\xffTABLE@\xff");
    let (width_px, height_px) = (geometry.width_px, geometry.height_px);
    let size = format!(
        r#"<attr key="sizeX" type="int">{width_px}</attr><attr key="sizeY" type="int">{height_px}</attr>"#
    );
    let events = node(EVENT_STREAM, "events", "Array of events (polarity ON/OFF).", "EVTS", &size);
    let imu = node(IMU_STREAM, "imu", "Inertial Measurement Unit data samples.", "IMUS", "");
    let xml = format!(
        r#"<dv version="2.0"><node name="outInfo" path="/mainloop/Recorder/outInfo/">{events}{imu}</node></dv>"#
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
    let find = |bytes: &[u8], part: &[u8]| memchr::memmem::find(bytes, part).unwrap_or_default();
    let imu_node = (find(&bytes, imu.as_bytes()), imu.len());
    let at = find(&bytes, &PLACEHOLDER.to_le_bytes());
    // Until it is closed the recording says that it has no table.
    bytes[at..at + 8].copy_from_slice(&(-1_i64).to_le_bytes());
    Head { bytes, table_position_at: at, imu_node }
}

/// What the header says about one stream.
fn node(stream: i32, output: &str, about: &str, kind: &str, size: &str) -> String {
    let path = format!("/mainloop/Recorder/outInfo/{stream}/");
    format!(
        r#"<node name="{stream}" path="{path}"><attr key="compression" type="string">LZ4</attr><attr key="originalModuleName" type="string">evtach</attr><attr key="originalOutputName" type="string">{output}</attr><attr key="typeDescription" type="string">{about}</attr><attr key="typeIdentifier" type="string">{kind}</attr><node name="info" path="{path}info/">{size}<attr key="source" type="string">evtach</attr><attr key="tsOffset" type="long">0</attr></node></node>"#
    )
}

/// A packet of events.
pub(super) fn events<'b>(builder: &'b mut FlatBufferBuilder<'_>, events: &[Event]) -> &'b [u8] {
    builder.reset();
    // An event is 16 bytes: pushed as two words, from the back to the front as flatbuffers are built.
    builder.start_vector::<u64>(events.len() * 2);
    for event in events.iter().rev() {
        let rest = u64::from(event.x) | u64::from(event.y) << 16 | (event.polarity as u64) << 32;
        builder.push(rest);
        builder.push(event.t_us);
    }
    let elements = builder.end_vector::<u64>(events.len());
    let table = builder.start_table();
    builder.push_slot_always(4, elements);
    let packet = builder.end_table(table);
    builder.finish_size_prefixed(packet, Some("EVTS"));
    builder.finished_data()
}

/// A packet of inertial samples. Temperature and magnetic field, of which nothing is known, are left out.
pub(super) fn imu<'b>(builder: &'b mut FlatBufferBuilder<'_>, samples: &[ImuSample]) -> &'b [u8] {
    builder.reset();
    let tables: Vec<_> = samples
        .iter()
        .map(|sample| {
            let table = builder.start_table();
            builder.push_slot_always(4, sample.t_us);
            let values = [to_gravities(sample.accel_m_s2), to_degrees(sample.gyro_rad_s)].concat();
            // Behind time and temperature.
            for (slot, value) in (8..).step_by(2).zip(values) {
                builder.push_slot_always(slot, value);
            }
            builder.end_table(table)
        })
        .collect();
    finish_tables(builder, &tables, "IMUS")
}

/// The table of packets that lets other readers seek (`FTAB` of the format).
pub(super) fn table<'b>(builder: &'b mut FlatBufferBuilder<'_>, entries: &[Entry]) -> &'b [u8] {
    builder.reset();
    let definitions: Vec<_> = entries
        .iter()
        .map(|entry| {
            // PacketHeader is a structure of two i32, stored in place.
            let (stream, size) = (entry.stream.cast_unsigned(), entry.size.cast_unsigned());
            let info = u64::from(stream) | u64::from(size) << 32;
            let table = builder.start_table();
            builder.push_slot_always(4, entry.offset);
            builder.push_slot_always(6, info);
            builder.push_slot_always(8, entry.count);
            builder.push_slot_always(10, entry.first_us);
            builder.push_slot_always(12, entry.last_us);
            builder.end_table(table)
        })
        .collect();
    finish_tables(builder, &definitions, "FTAB")
}

/// Finishes a buffer whose root holds a list of tables.
fn finish_tables<'b, T>(
    builder: &'b mut FlatBufferBuilder<'_>,
    tables: &[WIPOffset<T>],
    identifier: &str,
) -> &'b [u8] {
    builder.start_vector::<WIPOffset<u32>>(tables.len());
    for table in tables.iter().rev() {
        builder.push(*table);
    }
    let vector = builder.end_vector::<WIPOffset<u32>>(tables.len());
    let table = builder.start_table();
    builder.push_slot_always(4, vector);
    let root = builder.end_table(table);
    builder.finish_size_prefixed(root, Some(identifier));
    builder.finished_data()
}

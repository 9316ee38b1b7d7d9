//! Reading AEDAT 3.

use evtach_core::{Event, Geometry, Polarity};

use crate::recording::aedat2::Header;
use crate::recording::error::{Place, RecordingError};
use crate::recording::geometry::KnownSize;
use crate::recording::imu::{ImuSample, from_degrees, from_gravities};
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

const HEADER_BYTES: usize = 28;
/// Largest packet that is read: the bound on this reader's memory.
const MAX_PACKET_BYTES: usize = 64 << 20;
const TYPE_POLARITY: i16 = 1;
const TYPE_IMU6: i16 = 3;

/// Opens the file; `known` is its size where the person or a first pass over the file told it.
pub(crate) fn open(mut input: Input, known: Option<Geometry>) -> Result<Opened, RecordingError> {
    let header = Header::read(&mut input)?;
    let version = header.lines.first().map_or("", String::as_str).trim_start_matches("!AER-DAT");
    // 3.0 counts rows from the bottom.
    let flip = version.starts_with("3.0");
    if let Some(kind) = header.get("Format:")
        && kind != "RAW"
    {
        return Err(RecordingError::Unsupported {
            what: format!("AEDAT 3 packets in the form \"{kind}\" are not read, only RAW"),
            advice: "open it in DV and save it as AEDAT4".to_owned(),
        });
    }
    let source_line = header.lines.iter().find(|line| line.starts_with("Source "));
    let geometry = source_line.and_then(|line| {
        Some(KnownSize::new(size_of_source(line)?, format!("from the header line \"{line}\"")))
    });
    let size = known.or(geometry.as_ref().map(|told| told.size));
    let about = header
        .lines
        .iter()
        .filter_map(|line| line.split_once(": "))
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect();
    let flip = if flip { size } else { None };
    let source = Box::new(Packets { input, flip });
    Ok(Opened { format: "AEDAT3", geometry, assumed: Vec::new(), about, source })
}

/// Size of the camera in a line such as "Source 1: DAVIS346".
fn size_of_source(line: &str) -> Option<Geometry> {
    let (_, name) = line.split_once(':')?;
    let name = name.trim().to_ascii_uppercase();
    let (width, height) = [
        ("DVS128", (128, 128)),
        ("DVS132", (132, 104)),
        ("DAVIS128", (128, 128)),
        ("DAVIS208", (208, 192)),
        ("DAVIS240", (240, 180)),
        ("DAVIS346", (346, 260)),
        ("DAVIS640", (640, 480)),
        ("DVXPLORER", (640, 480)),
    ]
    .into_iter()
    .find_map(|(camera, size)| name.starts_with(camera).then_some(size))?;
    Geometry::new(width, height)
}

struct Packets {
    input: Input,
    flip: Option<Geometry>,
}

/// The fields of a packet header that matter here.
struct PacketHeader {
    kind: i16,
    event_bytes: usize,
    overflow: u32,
    count: usize,
}

impl PacketHeader {
    fn parse(bytes: &[u8; HEADER_BYTES], offset: u64) -> Result<Self, RecordingError> {
        let int = |at: usize| {
            i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        let damaged = |what: String| RecordingError::Damaged {
            format: "AEDAT3",
            place: Place::Byte(offset),
            what,
        };
        let kind = i16::from_le_bytes([bytes[0], bytes[1]]);
        let field = |at: usize, name: &str| {
            usize::try_from(int(at))
                .map_err(|_| damaged(format!("{name} {} in a packet header", int(at))))
        };
        let event_bytes = field(4, "event size")?;
        let count = field(20, "event number")?;
        let overflow = u32::try_from(int(12))
            .map_err(|_| damaged(format!("time overflow {} in a packet header", int(12))))?;
        let smallest = match kind {
            TYPE_POLARITY => 8,
            TYPE_IMU6 => 36,
            _ => 1,
        };
        if event_bytes < smallest || event_bytes.saturating_mul(count) > MAX_PACKET_BYTES {
            return Err(damaged(format!(
                "a packet that claims {count} events of {event_bytes} bytes"
            )));
        }
        Ok(Self { kind, event_bytes, overflow, count })
    }

    /// Full time: 31 bits in the event, the rest in the packet.
    fn time(&self, event: &[u8], at: usize) -> u64 {
        let low = u32::from_le_bytes([event[at], event[at + 1], event[at + 2], event[at + 3]]);
        u64::from(self.overflow) << 31 | u64::from(low & 0x7fff_ffff)
    }
}

impl Source for Packets {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let offset = self.input.offset();
        let cut = |side: &mut Side, bytes: usize| {
            if bytes > 0 {
                side.notes.push(format!(
                    "the file ends inside a packet: {bytes} bytes at byte {offset} left out"
                ));
            }
            Ok(false)
        };
        let bytes = self.input.peek(HEADER_BYTES)?;
        let Some(head) = bytes.first_chunk::<HEADER_BYTES>() else {
            return cut(side, bytes.len());
        };
        let header = PacketHeader::parse(head, offset)?;
        let size = header.event_bytes * header.count;
        let bytes = self.input.peek(HEADER_BYTES + size)?;
        let available = bytes.len();
        // A cut packet still has its first events.
        let body = &bytes[HEADER_BYTES..available.min(HEADER_BYTES + size)];
        if matches!(header.kind, TYPE_POLARITY | TYPE_IMU6) {
            for event in body.chunks_exact(header.event_bytes) {
                take(event, &header, self.flip, events, &mut side.imu);
            }
        }
        side.wraps = side.wraps.max(u64::from(header.overflow));
        let whole = available >= HEADER_BYTES + size;
        self.input.consume((HEADER_BYTES + size).min(available));
        if whole { Ok(true) } else { cut(side, available) }
    }
}

/// Takes in one event of a packet of polarity events or inertial samples, which has at least its info and time.
fn take(
    event: &[u8],
    header: &PacketHeader,
    flip: Option<Geometry>,
    events: &mut Vec<Event>,
    imu: &mut Vec<ImuSample>,
) {
    let info = u32::from_le_bytes([event[0], event[1], event[2], event[3]]);
    // Bit 0 marks events that a filter has not thrown out.
    if info & 1 == 0 {
        return;
    }
    let t_us = header.time(event, 4);
    if header.kind == TYPE_POLARITY {
        events.push(polarity_event(info, t_us, flip));
    } else {
        imu.push(imu_sample(event, t_us));
    }
}

fn polarity_event(info: u32, t_us: u64, flip: Option<Geometry>) -> Event {
    let y = ((info >> 2) & 0x7fff) as u16;
    Event {
        t_us,
        x: ((info >> 17) & 0x7fff) as u16,
        y: flip.map_or(y, |size| (size.height_px - 1).checked_sub(y).unwrap_or(u16::MAX)),
        polarity: if info & 2 == 0 { Polarity::Off } else { Polarity::On },
    }
}

/// Six floats behind info and time: acceleration in g, rate in degrees per second, in libcaer's axes.
fn imu_sample(event: &[u8], t_us: u64) -> ImuSample {
    let float = |index: usize| {
        let at = 8 + 4 * index;
        f32::from_le_bytes([event[at], event[at + 1], event[at + 2], event[at + 3]])
    };
    ImuSample {
        t_us,
        gyro_rad_s: from_degrees([float(3), float(4), float(5)]),
        accel_m_s2: from_gravities([float(0), float(1), float(2)]),
    }
}

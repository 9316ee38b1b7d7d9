//! The frame: header, payload, checksum. The layout stands in `firmware/docs/spi.md`.

use evtach_core::Geometry;

use super::checksum::checksum_of;

/// First bytes of a frame. Read as words they are of types that neither EVT 2 nor EVT 3 defines, so
/// they cannot stand in a payload where a word begins.
pub const MAGIC: [u8; 4] = [0xd7, 0xc3, 0x69, 0x96];

/// Longest payload in bytes: 256 words of EVT 2, 512 of EVT 3.
pub const MAX_PAYLOAD_BYTES: usize = 1024;

/// Bytes before the payload.
pub(super) const HEADER_BYTES: usize = 28;

/// Bytes behind the payload.
const CHECKSUM_BYTES: usize = 4;

/// Bytes of a frame that are not payload.
pub const OVERHEAD_BYTES: usize = HEADER_BYTES + CHECKSUM_BYTES;

/// Longest frame in bytes.
pub const MAX_FRAME_BYTES: usize = MAX_PAYLOAD_BYTES + OVERHEAD_BYTES;

/// What a frame carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Kind {
    /// [`Hello`]: what the sensor is.
    Hello = 0x10,
    /// Words of EVT 2.
    Evt2 = 0x12,
    /// Words of EVT 3.
    Evt3 = 0x13,
    /// Nothing: the bridge has come to the end of a recording, or goes to sleep.
    End = 0x1f,
}

impl Kind {
    const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x10 => Some(Self::Hello),
            0x12 => Some(Self::Evt2),
            0x13 => Some(Self::Evt3),
            0x1f => Some(Self::End),
            _ => None,
        }
    }

    /// Whether a payload may be of this many bytes.
    const fn takes(self, payload_bytes: usize) -> bool {
        match self {
            Self::Hello => payload_bytes == Hello::BYTES,
            Self::Evt2 => payload_bytes <= MAX_PAYLOAD_BYTES && payload_bytes.is_multiple_of(4),
            Self::Evt3 => payload_bytes <= MAX_PAYLOAD_BYTES && payload_bytes.is_multiple_of(2),
            Self::End => payload_bytes == 0,
        }
    }
}

/// What stands before the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Header {
    /// What the frame carries.
    pub kind: Kind,
    /// Bytes of payload, 0 to [`MAX_PAYLOAD_BYTES`].
    pub payload_bytes: u16,
    /// Number of the frame since the bridge started, low 32 bits.
    pub sequence: u32,
    /// Events in all frames before this one since the bridge started, low 32 bits.
    pub events_before: u32,
    /// Events that the bridge has lost since it started, low 32 bits.
    pub bridge_lost: u32,
    /// Time of the frame's first event in microseconds, wraps of the words' own clock undone.
    pub t_us: u64,
}

impl Header {
    /// Reads the header at the start of `bytes`; `None` when they do not begin as a frame of this version.
    #[must_use]
    pub fn parse(bytes: &[u8; HEADER_BYTES]) -> Option<Self> {
        let (word, long) = (|at: usize| u32::from_le_bytes(array(bytes, at)), array(bytes, 20));
        let header = Self {
            kind: Kind::from_byte(bytes[4])?,
            payload_bytes: u16::from_le_bytes(array(bytes, 6)),
            sequence: word(8),
            events_before: word(12),
            bridge_lost: word(16),
            t_us: u64::from_le_bytes(long),
        };
        let sound = bytes.starts_with(&MAGIC)
            && bytes[5] == 0
            && header.kind.takes(usize::from(header.payload_bytes));
        sound.then_some(header)
    }

    pub(super) fn encode(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4] = self.kind as u8;
        bytes[6..8].copy_from_slice(&self.payload_bytes.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.events_before.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.bridge_lost.to_le_bytes());
        bytes[20..].copy_from_slice(&self.t_us.to_le_bytes());
        bytes
    }

    /// Bytes of the whole frame.
    #[must_use]
    pub const fn frame_bytes(&self) -> usize {
        OVERHEAD_BYTES + self.payload_bytes as usize
    }
}

/// `N` bytes from `at` on.
fn array<const N: usize>(bytes: &[u8; HEADER_BYTES], at: usize) -> [u8; N] {
    core::array::from_fn(|index| bytes[at + index])
}

/// The checksum of a frame: over all of it but the magic, which is always the same, and itself.
pub(super) fn checksum(header_and_payload: &[u8]) -> [u8; CHECKSUM_BYTES] {
    checksum_of(header_and_payload.get(MAGIC.len()..).unwrap_or_default()).to_le_bytes()
}

/// What the sensor is: sent first, and again at least every 100 ms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Hello {
    /// Size of the sensor.
    pub geometry: Geometry,
    /// Name of the sensor in ASCII, filled up with zeros.
    pub name: [u8; 16],
}

impl Hello {
    pub(super) const BYTES: usize = 20;

    /// Reads the payload of a frame of [`Kind::Hello`]; `None` when no sensor has such a size.
    #[must_use]
    pub fn parse(payload: &[u8]) -> Option<Self> {
        let &[w0, w1, h0, h1, ref name @ ..] = payload.first_chunk::<{ Self::BYTES }>()?;
        let geometry = Geometry::new(u16::from_le_bytes([w0, w1]), u16::from_le_bytes([h0, h1]))?;
        Some(Self { geometry, name: *name })
    }

    pub(super) fn encode(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..2].copy_from_slice(&self.geometry.width_px.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.geometry.height_px.to_le_bytes());
        bytes[4..].copy_from_slice(&self.name);
        bytes
    }

    /// The name up to its first zero; "?" when it is not ASCII.
    #[must_use]
    pub fn name(&self) -> &str {
        let end = self.name.iter().position(|&byte| byte == 0).unwrap_or(self.name.len());
        match core::str::from_utf8(&self.name[..end]) {
            Ok(name) if name.is_ascii() => name,
            _ => "?",
        }
    }
}

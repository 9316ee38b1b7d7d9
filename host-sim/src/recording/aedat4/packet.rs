//! One packet: its envelope, its decompression.

use std::io::Read;

use super::Compression;
use crate::recording::error::{Place, RecordingError};
use crate::recording::input::Input;

/// Largest packet that is read; recorders write some ten kilobytes.
const MAX_PACKET_BYTES: usize = 32 << 20;
/// Largest packet after decompression: the bound on this reader's memory.
const MAX_UNPACKED_BYTES: usize = 64 << 20;

/// What was found where a packet was expected.
pub enum Found {
    /// A packet of this wanted stream; its content is in the buffer.
    Packet(i32),
    /// A packet of a stream that was not asked for.
    Skipped,
    /// The end of the packets.
    End,
    /// The file ends inside a packet: so many bytes of it are there.
    Cut(usize),
}

/// Reads packets and keeps their buffers.
pub struct Packets {
    input: Input,
    compression: Compression,
    end: Option<u64>,
    unpacked: Vec<u8>,
}

fn damaged(offset: u64, what: impl Into<String>) -> RecordingError {
    RecordingError::Damaged { format: "AEDAT4", place: Place::Byte(offset), what: what.into() }
}

impl Packets {
    pub const fn new(input: Input, compression: Compression, end: Option<u64>) -> Self {
        Self { input, compression, end, unpacked: Vec::new() }
    }

    /// Offset of the next packet.
    pub const fn offset(&self) -> u64 {
        self.input.offset()
    }

    /// The content of the last packet, without its size prefix.
    pub fn content(&self) -> &[u8] {
        self.unpacked.get(4..).unwrap_or_default()
    }

    /// Where another recording begins behind this one, as in files that were put behind each other. Looks past the
    /// table of packets, which takes some 50 bytes for each packet.
    pub fn further(&mut self) -> Result<Option<u64>, RecordingError> {
        const REACH_BYTES: usize = 4 << 20;
        let offset = self.input.offset();
        let bytes = self.input.peek(REACH_BYTES)?;
        Ok(memchr::memmem::find(bytes, super::MAGIC).map(|at| offset + at as u64))
    }

    /// Goes to the next packet; unpacks it when its stream is wanted.
    pub fn next(&mut self, wanted: impl Fn(i32) -> bool) -> Result<Found, RecordingError> {
        let offset = self.input.offset();
        if self.end.is_some_and(|end| offset >= end) {
            return Ok(Found::End);
        }
        let head = self.input.peek(8)?;
        let &[i0, i1, i2, i3, s0, s1, s2, s3, ..] = head else {
            return Ok(if head.is_empty() { Found::End } else { Found::Cut(head.len()) });
        };
        if head.starts_with(&super::MAGIC[..8]) {
            return Ok(Found::End);
        }
        let stream = i32::from_le_bytes([i0, i1, i2, i3]);
        let size = u32::from_le_bytes([s0, s1, s2, s3]) as usize;
        if size > MAX_PACKET_BYTES {
            return Err(damaged(offset, format!("a packet that claims {size} bytes")));
        }
        let bytes = self.input.peek(8 + size)?;
        let Some(packed) = bytes.get(8..8 + size) else {
            return Ok(Found::Cut(bytes.len()));
        };
        let found = if wanted(stream) {
            unpack(self.compression, packed, &mut self.unpacked)
                .map_err(|what| damaged(offset, what))?;
            Found::Packet(stream)
        } else {
            Found::Skipped
        };
        self.input.consume(8 + size);
        Ok(found)
    }
}

fn unpack(compression: Compression, packed: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
    out.clear();
    let limit = MAX_UNPACKED_BYTES as u64 + 1;
    let result = match compression {
        Compression::None => {
            out.extend_from_slice(packed);
            Ok(packed.len())
        }
        Compression::Lz4 => lz4_flex::frame::FrameDecoder::new(packed).take(limit).read_to_end(out),
        Compression::Zstd => zstd::Decoder::with_buffer(packed)
            .and_then(|decoder| decoder.take(limit).read_to_end(out)),
    };
    match result {
        Ok(_) if out.len() > MAX_UNPACKED_BYTES => {
            Err(format!("a packet that unpacks to more than {MAX_UNPACKED_BYTES} bytes"))
        }
        Ok(_) => Ok(()),
        Err(error) => Err(format!("a packet that does not unpack: {error}")),
    }
}

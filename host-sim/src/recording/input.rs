//! A byte source with look-ahead and a byte offset, over files, pipes and decompressors.

use std::io::Read;

use super::error::RecordingError;

/// Bytes read ahead in one go.
const STEP: usize = 256 * 1024;

/// Buffered input. Memory is bounded by the largest look-ahead a format asks for.
pub struct Input {
    reader: Box<dyn Read + Send>,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    offset: u64,
    ended: bool,
}

impl Input {
    /// Input over any reader.
    pub fn new(reader: Box<dyn Read + Send>) -> Self {
        Self { reader, buffer: Vec::new(), start: 0, end: 0, offset: 0, ended: false }
    }

    /// Offset of the next byte from the start of the recording.
    pub const fn offset(&self) -> u64 {
        self.offset
    }

    /// The next bytes without consuming them: at least `want`, fewer only at the end of the input.
    pub fn peek(&mut self, want: usize) -> Result<&[u8], RecordingError> {
        while self.end - self.start < want && !self.ended {
            self.fill(want)?;
        }
        Ok(&self.buffer[self.start..self.end])
    }

    /// The bytes that are already there.
    pub fn buffered(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    fn fill(&mut self, want: usize) -> Result<(), RecordingError> {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        // Grow as data arrives, not by what a length field claims.
        let room = want.min(self.end + 4 * STEP).max(STEP);
        if self.buffer.len() < room {
            self.buffer.resize(room, 0);
        }
        match self.reader.read(&mut self.buffer[self.end..]) {
            Ok(0) => self.ended = true,
            Ok(count) => self.end += count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(cause) => {
                return Err(RecordingError::Read {
                    offset: self.offset + (self.end - self.start) as u64,
                    cause,
                });
            }
        }
        Ok(())
    }

    /// Moves past `count` bytes that have been peeked.
    pub fn consume(&mut self, count: usize) {
        let count = count.min(self.end - self.start);
        self.start += count;
        self.offset += count as u64;
    }
}

impl Read for Input {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        if out.is_empty() {
            return Ok(0);
        }
        let available = self.peek(1).map_err(std::io::Error::other)?;
        let count = available.len().min(out.len());
        out[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

//! From bytes to frames, whatever the pieces in which the bytes come.

use super::frame::{self, HEADER_BYTES, Header, MAGIC, MAX_FRAME_BYTES};

/// Bytes held: a frame that is not complete yet, and room for at least as much behind it.
pub const BUFFER_BYTES: usize = 2 * MAX_FRAME_BYTES;

/// A frame whose checksum is right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'p> {
    /// What stands before the payload.
    pub header: Header,
    /// The payload.
    pub payload: &'p [u8],
    /// Frames since the last sound one whose checksum was wrong.
    pub damaged_before: u32,
}

/// Finds frames in a stream: fill [`Parser::space`], say how much by [`Parser::filled`], and take frames
/// from [`Parser::next_frame`] until there is none.
#[derive(Debug)]
pub struct Parser {
    buffer: [u8; BUFFER_BYTES],
    start: usize,
    end: usize,
    damaged: u32,
}

impl Default for Parser {
    fn default() -> Self {
        Self::new()
    }
}

impl Parser {
    /// A parser that has seen nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { buffer: [0; BUFFER_BYTES], start: 0, end: 0, damaged: 0 }
    }

    /// Where the next bytes of the stream go; never empty once [`Parser::next_frame`] has returned `None`.
    pub fn space(&mut self) -> &mut [u8] {
        // What is held here is less than a frame, and the buffer is two.
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        &mut self.buffer[self.end..]
    }

    /// So many bytes of the space are the stream's.
    pub fn filled(&mut self, bytes: usize) {
        self.end = (self.end + bytes).min(BUFFER_BYTES);
    }

    /// The next sound frame; `None` until more bytes come.
    pub fn next_frame(&mut self) -> Option<Frame<'_>> {
        loop {
            self.skip_to_magic();
            let held = &self.buffer[self.start..self.end];
            let head: &[u8; HEADER_BYTES] = held.first_chunk()?;
            let Some(header) = Header::parse(head) else {
                self.reject();
                continue;
            };
            let whole = held.get(..header.frame_bytes())?;
            let (told, checksum) = whole.split_last_chunk()?;
            if frame::checksum(told) != *checksum {
                self.reject();
                continue;
            }
            let payload = self.start + HEADER_BYTES..self.start + told.len();
            self.start += whole.len();
            let damaged_before = core::mem::take(&mut self.damaged);
            return Some(Frame { header, payload: &self.buffer[payload], damaged_before });
        }
    }

    /// Goes past what cannot begin a frame.
    fn skip_to_magic(&mut self) {
        loop {
            let held = &self.buffer[self.start..self.end];
            let Some(skipped) = held.iter().position(|&byte| byte == MAGIC[0]) else {
                self.start = self.end;
                return;
            };
            self.start += skipped;
            let held = &held[skipped..];
            if held.iter().zip(&MAGIC).all(|(here, magic)| here == magic) {
                return;
            }
            self.start += 1;
        }
    }

    /// Looks on right behind the magic: the length cannot be trusted, and sound frames may follow anywhere.
    fn reject(&mut self) {
        self.damaged = self.damaged.saturating_add(1);
        self.start += 1;
    }
}

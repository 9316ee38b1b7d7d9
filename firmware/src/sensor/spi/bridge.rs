//! The other end of the bus: what a bridge in front of a sensor sends.
//!
//! A reference for those who build one, and what recordings of the stream are written with.

use evtach_core::{Event, Geometry, Polarity};

use super::frame::{self, HEADER_BYTES, Header, Hello, Kind, MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES};

/// Longest time between the first event of a frame and its last, in microseconds: a frame goes out then,
/// full or not.
pub const MAX_SPAN_US: u64 = 1_000;

/// Longest pause between two [`Hello`]s, in microseconds of sensor time.
const HELLO_EVERY_US: u64 = 100_000;

/// Most bytes that one event takes: two words of EVT 2, or four of EVT 3 (time in two, row, pixel).
const MOST_BYTES_AN_EVENT: usize = 8;

/// Events in, frames out.
#[derive(Clone, Debug)]
pub struct Bridge {
    kind: Kind,
    hello: Hello,
    hello_us: Option<u64>,
    sequence: u32,
    /// Events in the frames that have gone out.
    sent: u32,
    lost: u32,
    /// Room for the header, the words of the open frame, its checksum.
    frame: [u8; MAX_FRAME_BYTES],
    filled: usize,
    /// Events in the open frame, and the times of its first and last.
    events: u32,
    first_us: u64,
    last_us: u64,
    /// Row and times that the open frame's words have told so far.
    row: Option<u16>,
    high: Option<u32>,
    low: Option<u32>,
}

impl Bridge {
    /// A bridge that has just started. Its words are those of EVT 2 or EVT 3; any other kind is sent as EVT 2.
    #[must_use]
    pub fn new(kind: Kind, geometry: Geometry, name: &str) -> Self {
        let kind = if kind == Kind::Evt3 { kind } else { Kind::Evt2 };
        let mut hello = Hello { geometry, name: [0; 16] };
        for (place, byte) in hello.name.iter_mut().zip(name.bytes()) {
            *place = byte;
        }
        Self {
            kind,
            hello,
            hello_us: None,
            sequence: 0,
            sent: 0,
            lost: 0,
            frame: [0; MAX_FRAME_BYTES],
            filled: HEADER_BYTES,
            events: 0,
            first_us: 0,
            last_us: 0,
            row: None,
            high: None,
            low: None,
        }
    }

    /// Takes in an event; frames that it completes go to `send`. Columns and rows beyond 2047 do not fit
    /// the words: only their low 11 bits go out.
    pub fn push(&mut self, event: &Event, mut send: impl FnMut(&[u8])) {
        let full = self.filled + MOST_BYTES_AN_EVENT > HEADER_BYTES + MAX_PAYLOAD_BYTES;
        let steps_back = event.t_us < self.last_us;
        let too_late = event.t_us.saturating_sub(self.first_us) >= MAX_SPAN_US;
        if self.events > 0 && (steps_back || too_late || full) {
            self.flush(&mut send);
        }
        if self.hello_us.is_none_or(|last_us| event.t_us.abs_diff(last_us) >= HELLO_EVERY_US) {
            self.say_hello(event.t_us, &mut send);
        }
        if self.events == 0 {
            self.first_us = event.t_us;
        }
        self.last_us = event.t_us;
        self.events += 1;
        match self.kind {
            Kind::Evt3 => self.words_evt3(event),
            _ => self.words_evt2(event),
        }
    }

    /// Sends the open frame, full or not.
    pub fn flush(&mut self, mut send: impl FnMut(&[u8])) {
        if self.events > 0 {
            self.close(self.kind, self.first_us, &mut send);
            self.sent = self.sent.wrapping_add(self.events);
            self.events = 0;
            (self.row, self.high, self.low) = (None, None, None);
        }
    }

    /// Says what the sensor is.
    pub fn say_hello(&mut self, t_us: u64, mut send: impl FnMut(&[u8])) {
        self.flush(&mut send);
        self.hello_us = Some(t_us);
        let hello = self.hello.encode();
        self.put(&hello);
        self.close(Kind::Hello, t_us, &mut send);
    }

    /// Sends what is left, and that nothing follows.
    pub fn end(&mut self, mut send: impl FnMut(&[u8])) {
        if self.hello_us.is_none() {
            self.say_hello(self.last_us, &mut send);
        }
        self.flush(&mut send);
        self.close(Kind::End, self.last_us, &mut send);
    }

    /// Counts events that the bridge itself had to drop.
    pub fn lost(&mut self, events: u32) {
        self.lost = self.lost.wrapping_add(events);
    }

    fn words_evt2(&mut self, event: &Event) {
        let high = (event.t_us >> 6) as u32 & 0x0fff_ffff;
        if self.high.replace(high) != Some(high) {
            self.put(&(0x8000_0000 | high).to_le_bytes());
        }
        let (x, y) = (u32::from(event.x) & 0x7ff, u32::from(event.y) & 0x7ff);
        let low = (event.t_us & 0x3f) as u32;
        self.put(&(u32::from(event.polarity as u8) << 28 | low << 22 | x << 11 | y).to_le_bytes());
    }

    fn words_evt3(&mut self, event: &Event) {
        let (high, low) = ((event.t_us >> 12) as u32 & 0xfff, event.t_us as u32 & 0xfff);
        if self.high.replace(high) != Some(high) {
            self.put(&(0x8000 | high as u16).to_le_bytes());
            self.low = None;
        }
        if self.low.replace(low) != Some(low) {
            self.put(&(0x6000 | low as u16).to_le_bytes());
        }
        let y = event.y & 0x7ff;
        if self.row.replace(y) != Some(y) {
            self.put(&y.to_le_bytes());
        }
        let brighter = if event.polarity == Polarity::On { 0x800 } else { 0 };
        self.put(&(0x2000 | brighter | event.x & 0x7ff).to_le_bytes());
    }

    fn put(&mut self, bytes: &[u8]) {
        self.frame[self.filled..self.filled + bytes.len()].copy_from_slice(bytes);
        self.filled += bytes.len();
    }

    /// Writes header and checksum around what has been put, and sends it.
    fn close(&mut self, kind: Kind, t_us: u64, send: &mut impl FnMut(&[u8])) {
        let header = Header {
            kind,
            payload_bytes: (self.filled - HEADER_BYTES) as u16,
            sequence: self.sequence,
            events_before: self.sent,
            bridge_lost: self.lost,
            t_us,
        };
        self.frame[..HEADER_BYTES].copy_from_slice(&header.encode());
        let checksum = frame::checksum(&self.frame[..self.filled]);
        self.put(&checksum);
        send(&self.frame[..self.filled]);
        self.filled = HEADER_BYTES;
        self.sequence = self.sequence.wrapping_add(1);
    }
}

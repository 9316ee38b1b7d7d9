//! SCPI over a stream of bytes: what a serial port brings in, and what it sends.
//!
//! [`Link`] knows no port and no clock. Whoever has them hands it bytes ([`Link::receive`]), lets it work
//! ([`Link::run`]) and sends what it has to say ([`Link::transmit`]); [`Device`] is what it sees of the
//! rest. Nothing in it waits, allocates or panics, whatever arrives. `firmware/docs/scpi.md` is the manual.

mod commands;
mod device;
mod error;
mod fetch;
mod header;
mod log;
mod parameter;
mod recording;
mod response;
mod seconds;
mod session;
mod setting;
mod speed;
mod status;
mod system;

use core::fmt::Write as _;

use commands::COMMANDS;
use error::ScpiError;
use header::Path;
use heapless::Vec;
use parameter::Unit;
use response::Response;
use session::{Block, BlockKind, Flow, Session};

pub use device::{
    Device, Fate, Identity, RecorderFailed, RecorderState, RecorderStatus, Statistics, View,
};
pub use error::ErrorCode;
pub use log::LogLine;

/// Longest line, without its end.
pub const LINE_BYTES: usize = 256;

/// How long `READ?` and `MEASure?` wait for a reading before they answer 9.91E+37: below the two seconds after
/// which PyVISA gives up.
pub const READING_TIMEOUT_US: u64 = 1_500_000;

/// Control-C: forgets the line, the answer and the block under way, as a device clear does on other buses.
const DEVICE_CLEAR: u8 = 0x03;

/// A command that waits for a reading.
#[derive(Clone, Copy, Debug)]
struct Wait {
    since_us: u64,
    /// Readings at its start.
    readings: u32,
    rotor: Option<u8>,
    speed: bool,
}

/// One end of the link.
#[derive(Clone, Debug)]
pub struct Link {
    /// A carriage return is none of it.
    line: Vec<u8, { LINE_BYTES + 1 }>,
    overrun: bool,
    complete: bool,
    /// Where the next command of the line begins.
    at: usize,
    path: Path,
    /// Whether the line has been answered, so that a further answer needs a semicolon.
    answered: bool,
    wait: Option<Wait>,
    response: Response,
    block: Option<Block>,
    session: Session,
    /// Readings that have been told.
    logged: u32,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// As after power-on.
    #[must_use]
    pub fn new() -> Self {
        Self {
            line: Vec::new(),
            overrun: false,
            complete: false,
            at: 0,
            path: Path::new(),
            answered: false,
            wait: None,
            response: Response::new(),
            block: None,
            session: Session::power_on(),
            logged: 0,
        }
    }

    /// Takes in bytes and returns how many; it takes no more while a whole line is being worked on.
    pub fn receive(&mut self, bytes: &[u8]) -> usize {
        for (index, &byte) in bytes.iter().enumerate() {
            if byte == DEVICE_CLEAR {
                self.forget();
            } else if self.complete {
                return index;
            } else if byte == b'\n' {
                self.complete = true;
            } else if self.line.push(byte).is_err() {
                self.overrun = true;
            }
        }
        bytes.len()
    }

    /// Forgets the line, the answer and the block under way: control-C came, or nobody fetches them, and whoever does next is not
    /// to be told the end of them.
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn forget(&mut self) {
        self.end_line();
        self.wait = None;
        self.response.clear();
        self.block = None;
    }

    /// Works until there is something to send, or nothing left to do. To be called after bytes have come, after a
    /// reading, and at least ten times a second; `now_us` is any clock that does not stand still.
    pub fn run(&mut self, now_us: u64, device: &mut impl Device) {
        self.session.observe(device);
        if !self.session.log {
            self.logged = device.readings();
        }
        while self.response.rest().is_empty() && self.block.is_none() {
            if let Some(wait) = self.wait {
                if !self.is_over(wait, now_us, device) {
                    return;
                }
                self.wait = None;
                self.begin_answer();
                // What stood before is no next speed.
                if wait.speed && device.readings() == wait.readings {
                    self.response.number(None);
                } else {
                    fetch::speed(wait.rotor, device, &mut self.response);
                }
            } else if !self.complete {
                self.log(device);
                return;
            } else if self.overrun {
                self.session.report(ScpiError { code: ErrorCode::InputOverrun, byte: None });
                self.end_line();
            } else {
                self.next_command(now_us, device);
            }
        }
    }

    /// Copies what is to be sent and returns how many bytes; 0 when there is nothing.
    pub fn transmit(&mut self, out: &mut [u8], device: &mut impl Device) -> usize {
        let rest = self.response.rest();
        if !rest.is_empty() {
            let count = rest.len().min(out.len());
            out[..count].copy_from_slice(&rest[..count]);
            self.response.sent(count);
            return count;
        }
        let Some(block) = &mut self.block else { return 0 };
        let count = out.len().min((block.length - block.sent) as usize);
        let out = &mut out[..count];
        // The length has been announced: what cannot be read is sent as zeros, and told as an error.
        out.fill(0);
        match block.kind {
            BlockKind::Headers => commands::copy_headers(block.sent, out),
            BlockKind::Screen => {
                let rest = device.screen().get(block.sent as usize..).unwrap_or_default();
                out.iter_mut().zip(rest).for_each(|(out, byte)| *out = *byte);
            }
            BlockKind::Recording => {
                if device.read_recording(block.sent, out).is_err() {
                    self.session.report(ScpiError { code: ErrorCode::Hardware, byte: None });
                }
            }
        }
        block.sent += count as u32;
        if block.sent == block.length {
            self.block = None;
        }
        count
    }

    /// Whether there is nothing to send and nothing to work on.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.response.rest().is_empty() && self.block.is_none() && !self.complete
    }

    fn is_over(&self, wait: Wait, now_us: u64, device: &impl Device) -> bool {
        let fresh = device.readings() != wait.readings;
        fresh && (!wait.speed || fetch::has_speed(wait.rotor, device))
            || now_us.saturating_sub(wait.since_us) >= READING_TIMEOUT_US
    }

    fn begin_answer(&mut self) {
        if self.answered {
            self.response.raw(";");
        }
        self.answered = true;
    }

    fn next_command(&mut self, now_us: u64, device: &mut impl Device) {
        let line = core::mem::take(&mut self.line);
        match Unit::next(&line, &mut self.at) {
            None => {
                if self.answered {
                    self.response.raw("\n");
                }
                self.end_line();
            }
            Some(unit) => {
                let result = unit.and_then(|unit| self.execute(&unit, now_us, device));
                self.line = line;
                if let Err(error) = result {
                    self.response.clear();
                    self.session.report(error);
                    // Behind what was not understood, nothing of the line can be trusted (IEEE 488.2, 6.1.6).
                    if error.code.event() == status::esr::COMMAND {
                        self.at = self.line.len();
                    }
                }
            }
        }
    }

    fn execute(
        &mut self,
        unit: &Unit<'_>,
        now_us: u64,
        device: &mut impl Device,
    ) -> Result<(), ScpiError> {
        let at = |code| ScpiError::at(code, unit.at);
        let header = self.path.follow(unit.header).map_err(at)?;
        let command = header::find(COMMANDS, &header).map_err(at)?;
        let answered = self.answered;
        if header.ends_with(b"?") {
            self.begin_answer();
        }
        let mut parameters = unit.parameters;
        let flow = self.session.execute(command, &mut parameters, device, &mut self.response);
        if self.response.overflowed() {
            self.answered = answered;
            return Err(at(ErrorCode::OutOfMemory));
        }
        match flow {
            Ok(Flow::Done) => Ok(()),
            Ok(Flow::Block(block)) => {
                self.block = Some(block);
                Ok(())
            }
            Ok(Flow::Wait { rotor, speed }) => {
                // The separator is written with the answer.
                self.response.clear();
                self.answered = answered;
                let readings = device.readings();
                self.wait = Some(Wait { since_us: now_us, readings, rotor, speed });
                Ok(())
            }
            Err(error) => {
                self.answered = answered;
                Err(error)
            }
        }
    }

    fn end_line(&mut self) {
        self.line.clear();
        self.path.clear();
        self.at = 0;
        self.overrun = false;
        self.complete = false;
        self.answered = false;
    }

    /// Tells the reading if it is new. Between lines only, so that an answer stays whole; a reading that comes while
    /// another is sent is left out.
    fn log(&mut self, device: &impl Device) {
        let readings = device.readings();
        if readings == self.logged {
            return;
        }
        self.logged = readings;
        if let Some(reading) = device.last_reading() {
            let line = LogLine { reading, first_us: device.first_us() };
            writeln!(self.response, "{line}").ok();
            if self.response.overflowed() {
                self.response.clear();
                self.session.report(ScpiError { code: ErrorCode::OutOfMemory, byte: None });
            }
        }
    }
}

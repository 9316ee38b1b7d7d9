//! The PC at the device port: enumerates, opens the serial port, and passes bytes on.

use std::collections::VecDeque;

use super::device::{Core, Said};
use crate::time::{MS, NEVER, US};

/// Time from the pull-up to the reset of the bus.
const SETTLE_PS: u64 = 100 * MS;
const RESET_PS: u64 = 15 * MS;
/// After a reset the PC leaves the device alone for as long.
const RECOVERY_PS: u64 = 20 * MS;
/// A transaction at full speed.
const TRANSACTION_PS: u64 = 50 * US;
/// A device that does not answer for as long is reset again.
const PATIENCE_PS: u64 = 500 * MS;

/// What the PC sends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Token {
    /// It wants data of this endpoint.
    In(u8),
    /// It has data for this endpoint.
    Out(u8, Vec<u8>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// No device is there.
    Waiting,
    /// The bus is about to be reset.
    Settling,
    Resetting,
    /// Carries out the requests of the start-up, by their number.
    Asking(usize),
    /// The port is open.
    Open,
}

/// A control transfer under way.
struct Transfer {
    setup: [u8; 8],
    out: Vec<u8>,
    answer: Vec<u8>,
    /// Of the three phases, which is due.
    phase: Phase,
    since: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Setup,
    Data,
    Status,
}

/// The PC.
pub struct Pc {
    /// The cable is in.
    pub plugged: bool,
    stage: Stage,
    due: u64,
    transfer: Option<Transfer>,
    configuration: Vec<u8>,
    data_in: u8,
    data_out: u8,
    /// What the device said and nobody has read.
    pub received: VecDeque<u8>,
    /// What is to be said to the device.
    pub to_send: VecDeque<u8>,
    /// Texts of the device's string descriptors: maker, product, serial number.
    pub strings: Vec<String>,
    /// Times it had to begin anew because the device did not answer.
    pub retries: u64,
}

impl Default for Pc {
    fn default() -> Self {
        Self {
            plugged: true,
            stage: Stage::Waiting,
            due: NEVER,
            transfer: None,
            configuration: Vec::new(),
            data_in: 0,
            data_out: 0,
            received: VecDeque::new(),
            to_send: VecDeque::new(),
            strings: Vec::new(),
            retries: 0,
        }
    }
}

/// Requests of the start-up, in their order.
const SERIAL_PORT: [[u8; 8]; 10] = [
    [0x80, 6, 0, 1, 0, 0, 8, 0],
    [0x00, 5, 1, 0, 0, 0, 0, 0],
    [0x80, 6, 0, 1, 0, 0, 18, 0],
    [0x80, 6, 0, 2, 0, 0, 0xff, 0],
    [0x80, 6, 1, 3, 9, 4, 0xff, 0],
    [0x80, 6, 2, 3, 9, 4, 0xff, 0],
    [0x80, 6, 3, 3, 9, 4, 0xff, 0],
    [0x00, 9, 1, 0, 0, 0, 0, 0],
    // Line coding: 115200 baud, 8N1; then "a terminal is ready".
    [0x21, 0x20, 0, 0, 0, 0, 7, 0],
    [0x21, 0x22, 3, 0, 0, 0, 0, 0],
];
const LINE_CODING: [u8; 7] = [0, 0xc2, 1, 0, 0, 0, 8];

impl Pc {
    /// Whether the serial port is open.
    pub fn is_open(&self) -> bool {
        self.stage == Stage::Open
    }

    /// The device was reset and is gone from the bus.
    pub fn lost(&mut self) {
        self.stage = Stage::Waiting;
        self.transfer = None;
        self.due = NEVER;
    }

    /// When something is due.
    pub fn next(&self, core: &Core) -> u64 {
        let there = self.plugged && core.is_connected();
        match self.stage {
            Stage::Waiting if there => 0,
            Stage::Waiting => NEVER,
            _ if !there => 0,
            Stage::Settling | Stage::Resetting => self.due,
            Stage::Asking(_) => match self.transfer.as_ref().map(|transfer| self.token(transfer)) {
                Some(Some(token)) if !core.would_answer(&token) => self.give_up(),
                _ => self.due,
            },
            Stage::Open => {
                let wants_in = core.would_answer(&Token::In(self.data_in));
                let out = Token::Out(self.data_out, Vec::new());
                let wants_out = !self.to_send.is_empty() && core.would_answer(&out);
                if wants_in || wants_out { self.due } else { NEVER }
            }
        }
    }

    fn give_up(&self) -> u64 {
        self.transfer.as_ref().map_or(NEVER, |transfer| transfer.since + PATIENCE_PS)
    }

    /// What a transfer does next on the wire; a setup packet is none that can be refused.
    fn token(&self, transfer: &Transfer) -> Option<Token> {
        let reads = transfer.setup[0] & 0x80 != 0;
        match (transfer.phase, reads) {
            (Phase::Setup, _) => None,
            (Phase::Data, true) | (Phase::Status, false) => Some(Token::In(0)),
            (Phase::Data, false) => Some(Token::Out(0, transfer.out.clone())),
            (Phase::Status, true) => Some(Token::Out(0, Vec::new())),
        }
    }

    /// Does what is due.
    pub fn advance(&mut self, core: &mut Core, now: u64) {
        if !(self.plugged && core.is_connected()) {
            if self.stage != Stage::Waiting {
                self.lost();
            }
            return;
        }
        match self.stage {
            Stage::Waiting => {
                self.stage = Stage::Settling;
                self.due = now + SETTLE_PS;
            }
            Stage::Settling if self.due <= now => {
                core.bus_reset(true);
                self.stage = Stage::Resetting;
                self.due = now + RESET_PS;
            }
            Stage::Resetting if self.due <= now => {
                core.bus_reset(false);
                self.stage = Stage::Asking(0);
                self.transfer = None;
                self.strings.clear();
                self.due = now + RECOVERY_PS;
            }
            Stage::Asking(step) => self.ask(step, core, now),
            Stage::Open if self.due <= now => self.pass(core, now),
            _ => {}
        }
    }

    fn ask(&mut self, step: usize, core: &mut Core, now: u64) {
        if self.give_up() <= now {
            self.retries += 1;
            self.stage = Stage::Settling;
            self.due = now + MS;
            self.transfer = None;
            return;
        }
        if self.due > now {
            return;
        }
        let Some(setup) = SERIAL_PORT.get(step) else {
            self.stage = Stage::Open;
            self.due = now + MS;
            return;
        };
        let mut transfer = self.transfer.take().unwrap_or_else(|| Transfer {
            setup: *setup,
            out: if setup[6] == 7 { LINE_CODING.to_vec() } else { Vec::new() },
            answer: Vec::new(),
            phase: Phase::Setup,
            since: now,
        });
        self.due = now + TRANSACTION_PS;
        let length = usize::from(u16::from_le_bytes([setup[6], setup[7]]));
        let Some(token) = self.token(&transfer) else {
            core.setup(*setup);
            transfer.phase = if length > 0 { Phase::Data } else { Phase::Status };
            self.transfer = Some(transfer);
            return;
        };
        match core.answer(token) {
            Said::Nak => self.transfer = Some(transfer),
            // What a device does not have, it need not have: the next request.
            Said::Stall => self.stage = Stage::Asking(step + 1),
            Said::Done(bytes) => {
                let reads = setup[0] & 0x80 != 0;
                if transfer.phase == Phase::Status {
                    self.learn(step, &transfer.answer);
                    self.stage = Stage::Asking(step + 1);
                    self.due = now + MS;
                    return;
                }
                let short = bytes.len() < 64;
                transfer.answer.extend(bytes);
                if !reads || short || transfer.answer.len() >= length {
                    transfer.phase = Phase::Status;
                }
                self.transfer = Some(transfer);
            }
        }
    }

    fn learn(&mut self, step: usize, answer: &[u8]) {
        match step {
            3 => {
                self.configuration = answer.to_vec();
                let mut at = 0;
                while let [length, kind, rest @ ..] = answer.get(at..).unwrap_or_default() {
                    // A bulk endpoint.
                    if *kind == 5 && rest.get(1) == Some(&2) {
                        let address = rest[0];
                        let which = if address & 0x80 != 0 {
                            &mut self.data_in
                        } else {
                            &mut self.data_out
                        };
                        *which = address & 0xf;
                    }
                    at += usize::from(*length).max(2);
                }
            }
            4..=6 => {
                let units = answer.get(2..).unwrap_or_default().as_chunks::<2>().0;
                let units: Vec<u16> = units.iter().map(|unit| u16::from_le_bytes(*unit)).collect();
                self.strings.push(String::from_utf16_lossy(&units));
            }
            _ => {}
        }
    }

    /// Bytes each way, a packet at a time.
    fn pass(&mut self, core: &mut Core, now: u64) {
        self.due = now + TRANSACTION_PS;
        let out = Token::Out(self.data_out, Vec::new());
        if !self.to_send.is_empty() && core.would_answer(&out) {
            let count = self.to_send.len().min(64);
            let packet: Vec<u8> = self.to_send.drain(..count).collect();
            core.answer(Token::Out(self.data_out, packet));
        } else if let Said::Done(bytes) = core.answer(Token::In(self.data_in)) {
            self.received.extend(bytes);
        }
    }
}

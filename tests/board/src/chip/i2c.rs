//! I2C controllers (the second version of ST's block), and who answers on the bus.

use super::Device;
use crate::cpu::nvic::Nvic;
use crate::time::{NEVER, S};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const TIMINGR: u32 = 0x10;
const ISR: u32 = 0x18;
const ICR: u32 = 0x1c;
const RXDR: u32 = 0x24;
const TXDR: u32 = 0x28;

const PE: u32 = 1;
const READ: u32 = 1 << 10;
const START: u32 = 1 << 13;
const STOP: u32 = 1 << 14;
const RELOAD: u32 = 1 << 24;
const AUTOEND: u32 = 1 << 25;

const TXE: u32 = 1;
const TXIS: u32 = 1 << 1;
const RXNE: u32 = 1 << 2;
const NACKF: u32 = 1 << 4;
const STOPF: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TCR: u32 = 1 << 7;
const BUSY: u32 = 1 << 15;

/// A chip on the bus.
pub trait Slave {
    /// Its address, 7 bits.
    fn address(&self) -> u8;
    /// A transfer begins.
    fn start(&mut self, read: bool);
    /// Takes a byte.
    fn write(&mut self, byte: u8);
    /// Hands out the next byte.
    fn read(&mut self) -> u8;
}

/// What the bus does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Idle,
    /// The address is on the wire.
    Address,
    /// A byte is on its way in.
    Receiving,
    /// A byte is on its way out.
    Sending(u8),
    /// Waits for software: a byte, or what comes after the last one.
    Waiting,
    /// The stop condition is on the wire.
    Stopping,
}

/// One controller.
pub struct I2c {
    event_line: u8,
    clock_hz: u64,
    cr1: u32,
    cr2: u32,
    timing: u32,
    status: u32,
    received: u8,
    phase: Phase,
    /// When the phase ends.
    ends: u64,
    /// Bytes left of this part.
    left: u32,
    answered: bool,
    /// Transfers that nobody answered.
    pub unanswered: u64,
}

impl I2c {
    /// A controller with its interrupt for events; that for errors follows it.
    pub fn new(event_line: u8) -> Self {
        Self {
            event_line,
            clock_hz: 54_000_000,
            cr1: 0,
            cr2: 0,
            timing: 0,
            status: TXE,
            received: 0,
            phase: Phase::Idle,
            ends: NEVER,
            left: 0,
            answered: false,
            unanswered: 0,
        }
    }

    /// The bus clock changes.
    pub fn set_clock(&mut self, hz: u64) {
        self.clock_hz = hz.max(1);
    }

    /// Nine clocks of the bus: a byte and its acknowledge.
    fn byte_ps(&self) -> u64 {
        let (low, high) = (self.timing & 0xff, self.timing >> 8 & 0xff);
        let ticks = u64::from(low + high + 2) * u64::from((self.timing >> 28) + 1);
        9 * ticks * S / self.clock_hz
    }

    fn go(&mut self, phase: Phase, now: u64) {
        self.phase = phase;
        self.ends = now + self.byte_ps();
    }

    fn after_byte(&mut self, now: u64) {
        self.left = self.left.saturating_sub(1);
        if self.left > 0 {
            return self.next_byte(now);
        }
        self.phase = Phase::Waiting;
        self.ends = NEVER;
        if self.cr2 & RELOAD != 0 {
            self.status |= TCR;
        } else if self.cr2 & AUTOEND != 0 {
            self.go(Phase::Stopping, now);
        } else {
            self.status |= TC;
        }
    }

    fn next_byte(&mut self, now: u64) {
        if self.cr2 & READ != 0 {
            // The clock is held low until the byte before has been read.
            if self.status & RXNE == 0 {
                self.go(Phase::Receiving, now);
            } else {
                (self.phase, self.ends) = (Phase::Waiting, NEVER);
            }
        } else {
            (self.phase, self.ends) = (Phase::Waiting, NEVER);
            self.status |= TXIS | TXE;
        }
    }

    /// Does what is due by now, with these chips on the bus.
    pub fn advance_with(&mut self, now: u64, slaves: &mut [&mut dyn Slave]) {
        while self.ends <= now {
            let at = self.ends;
            let address = (self.cr2 >> 1 & 0x7f) as u8;
            let slave = slaves.iter_mut().find(|slave| slave.address() == address);
            match (self.phase, slave) {
                (Phase::Address, Some(slave)) => {
                    slave.start(self.cr2 & READ != 0);
                    self.answered = true;
                    if self.left == 0 {
                        self.left = 1;
                        self.after_byte(at);
                    } else {
                        self.next_byte(at);
                    }
                }
                (Phase::Address, None) => {
                    self.unanswered += 1;
                    self.status |= NACKF;
                    self.go(Phase::Stopping, at);
                }
                (Phase::Receiving, slave) => {
                    self.received = slave.map_or(0xff, |slave| slave.read());
                    self.status |= RXNE;
                    self.after_byte(at);
                }
                (Phase::Sending(byte), slave) => {
                    if let Some(slave) = slave {
                        slave.write(byte);
                    }
                    self.after_byte(at);
                }
                (Phase::Stopping, _) => {
                    self.status = self.status & !(BUSY | TXIS) | STOPF;
                    (self.phase, self.ends) = (Phase::Idle, NEVER);
                }
                (Phase::Idle | Phase::Waiting, _) => self.ends = NEVER,
            }
        }
    }
}

impl Device for I2c {
    fn read(&mut self, at: u32, _size: u8, now: u64) -> u32 {
        match at {
            CR1 => self.cr1,
            CR2 => self.cr2,
            TIMINGR => self.timing,
            ISR => self.status,
            RXDR => {
                self.status &= !RXNE;
                if self.phase == Phase::Waiting && self.left > 0 && self.cr2 & READ != 0 {
                    self.go(Phase::Receiving, now);
                }
                u32::from(self.received)
            }
            _ => 0,
        }
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, now: u64) {
        match at {
            CR1 => {
                self.cr1 = value;
                if value & PE == 0 {
                    self.status = TXE;
                    (self.phase, self.ends) = (Phase::Idle, NEVER);
                }
            }
            CR2 => {
                // The requests are taken at once and read back as done.
                self.cr2 = value & !(START | STOP);
                self.left = value >> 16 & 0xff;
                if self.cr1 & PE == 0 {
                    return;
                }
                if value & START != 0 {
                    self.status = self.status & !(TC | TCR) | BUSY;
                    self.go(Phase::Address, now);
                } else if value & STOP != 0 && self.phase != Phase::Idle {
                    self.status &= !(TC | TXIS);
                    self.go(Phase::Stopping, now);
                } else if self.status & TCR != 0 && self.left > 0 {
                    self.status &= !TCR;
                    self.next_byte(now);
                }
            }
            TIMINGR => self.timing = value,
            ICR => self.status &= !(value & 0x3f38),
            TXDR if self.phase == Phase::Waiting && self.status & TXIS != 0 => {
                self.status &= !TXIS;
                self.go(Phase::Sending(value as u8), now);
            }
            _ => {}
        }
    }

    fn next(&self) -> u64 {
        self.ends
    }

    fn lines(&self, nvic: &mut Nvic) {
        // TXIE, RXIE, NACKIE, STOPIE, TCIE in CR1 stand one bit before their flags.
        let wanted = [(1, TXIS), (2, RXNE), (4, NACKF), (5, STOPF), (6, TC | TCR)];
        let high =
            wanted.iter().any(|(bit, flags)| self.cr1 & 1 << bit != 0 && self.status & flags != 0);
        nvic.set_line(self.event_line, high);
    }

    fn reset(&mut self) {
        *self = Self { clock_hz: self.clock_hz, ..Self::new(self.event_line) };
    }
}

//! The QUADSPI controller in front of the board's serial flash.

use std::collections::VecDeque;

use super::Device;
use crate::board::n25q::{Direction, N25q};
use crate::cpu::nvic::Nvic;

const LINE: u8 = 92;
const CR: u32 = 0x00;
const DCR: u32 = 0x04;
const SR: u32 = 0x08;
const FCR: u32 = 0x0c;
const DLR: u32 = 0x10;
const CCR: u32 = 0x14;
const AR: u32 = 0x18;
const ABR: u32 = 0x1c;
const DR: u32 = 0x20;
const PSMKR: u32 = 0x24;
const PSMAR: u32 = 0x28;

const ENABLED: u32 = 1;
const ABORT: u32 = 1 << 1;
const ERROR: u32 = 1;
const COMPLETE: u32 = 1 << 1;
const THRESHOLD: u32 = 1 << 2;
const MATCH: u32 = 1 << 3;
const BUSY: u32 = 1 << 5;
/// Bytes that its queue holds.
const FIFO: usize = 32;

/// QUADSPI.
#[derive(Default)]
pub struct QuadSpi {
    /// The chip behind it.
    pub flash: N25q,
    registers: [u32; 12],
    status: u32,
    queue: VecDeque<u8>,
    /// Bytes of this transfer that are still to come or to go.
    left: u64,
    /// Flash content that memory-mapped readers see has changed since this was last taken.
    pub changed: bool,
}

impl QuadSpi {
    fn get(&self, at: u32) -> u32 {
        self.registers[(at / 4) as usize]
    }

    fn mode(&self) -> u32 {
        self.get(CCR) >> 26 & 3
    }

    fn has(&self, shift: u32) -> bool {
        self.get(CCR) >> shift & 3 != 0
    }

    /// Whether the flash is read as memory.
    pub fn is_mapped(&self) -> bool {
        self.get(CR) & ENABLED != 0 && self.mode() == 3
    }

    /// Sends the command, when all that belongs to it has been written.
    fn send(&mut self, now: u64) {
        let command = self.get(CCR) as u8;
        let address = if self.has(10) { self.get(AR) } else { 0 };
        if self.get(CR) & ENABLED == 0 || !self.has(8) || self.mode() == 3 {
            return;
        }
        let data = self.has(24);
        let direction = self.flash.command(command, address, now);
        self.queue.clear();
        self.status &= !(COMPLETE | MATCH);
        match self.mode() {
            0 if data => {
                self.left = u64::from(self.get(DLR)) + 1;
                self.status |= BUSY;
                if direction != Direction::In {
                    self.status |= ERROR;
                }
            }
            1 if data => {
                self.left = u64::from(self.get(DLR)).wrapping_add(1);
                self.status |= BUSY;
                self.fetch(now);
            }
            2 => {
                let answer = u32::from(self.flash.read(now));
                self.status |= BUSY;
                if (answer ^ self.get(PSMAR)) & self.get(PSMKR) == 0 {
                    self.status = self.status & !BUSY | MATCH;
                } else {
                    // Polls again when the flash is done; until then nothing changes.
                    self.left = 0;
                }
            }
            _ => self.end(now),
        }
    }

    fn fetch(&mut self, now: u64) {
        while self.left > 0 && self.queue.len() < FIFO {
            let byte = self.flash.read(now);
            self.queue.push_back(byte);
            self.left -= 1;
        }
        if self.left == 0 {
            self.status |= COMPLETE;
        }
    }

    fn end(&mut self, now: u64) {
        self.flash.end(now);
        self.changed |= std::mem::take(&mut self.flash.changed);
        self.status = self.status & !BUSY | COMPLETE;
    }

    fn status(&self) -> u32 {
        let threshold = (self.get(CR) >> 8 & 0x1f) as usize + 1;
        let level = self.queue.len();
        let reached = match self.mode() {
            0 => self.status & BUSY != 0 && FIFO - level >= threshold,
            _ => level >= threshold || level > 0 && self.left == 0,
        };
        self.status | if reached { THRESHOLD } else { 0 } | (level as u32) << 8
    }
}

impl Device for QuadSpi {
    fn read(&mut self, at: u32, size: u8, now: u64) -> u32 {
        match at {
            SR => self.status(),
            DR => {
                let mut word = [0; 4];
                for byte in word.iter_mut().take(usize::from(size)) {
                    *byte = self.queue.pop_front().unwrap_or(0);
                }
                if self.mode() == 1 {
                    self.fetch(now);
                    if self.left == 0 && self.queue.is_empty() && self.status & BUSY != 0 {
                        self.end(now);
                    }
                }
                u32::from_le_bytes(word)
            }
            _ => self.registers.get((at / 4) as usize).copied().unwrap_or(0),
        }
    }

    fn write(&mut self, at: u32, value: u32, size: u8, now: u64) {
        if at == DR {
            for byte in value.to_le_bytes().into_iter().take(usize::from(size)) {
                if self.mode() == 0 && self.left > 0 {
                    self.flash.write(byte, now);
                    self.left -= 1;
                    if self.left == 0 {
                        self.end(now);
                    }
                }
            }
            return;
        }
        match at {
            FCR => self.status &= !(value & 0x1b),
            SR => {}
            _ => {
                if let Some(register) = self.registers.get_mut((at / 4) as usize) {
                    *register = value;
                }
            }
        }
        match at {
            CR if value & ABORT != 0 => {
                self.registers[0] &= !ABORT;
                self.queue.clear();
                self.end(now);
            }
            CR | DCR | DLR | ABR => {}
            // The command goes out with the last thing it needs: itself, its address, or its data.
            CCR if !self.has(10) => self.send(now),
            AR => self.send(now),
            _ => {}
        }
    }

    fn next(&self) -> u64 {
        if self.mode() == 2 && self.status & BUSY != 0 { self.flash.ready_at() } else { u64::MAX }
    }

    fn advance(&mut self, now: u64, _memory: &mut dyn super::Memory) {
        if self.next() <= now {
            let answer = u32::from(self.flash.read(now));
            self.status &= !BUSY;
            if (answer ^ self.get(PSMAR)) & self.get(PSMKR) == 0 {
                self.status |= MATCH;
            }
        }
    }

    fn lines(&self, nvic: &mut Nvic) {
        // TEIE, TCIE, FTIE, SMIE stand 16 bits above their flags.
        nvic.set_line(LINE, self.status() & self.get(CR) >> 16 & 0xf != 0);
    }

    fn reset(&mut self) {
        // The flash is a chip of its own, with a reset of its own: power.
        self.registers = [0; 12];
        self.status = 0;
        self.queue.clear();
        self.left = 0;
    }
}

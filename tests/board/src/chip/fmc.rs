//! The memory controller: SDRAM answers once it has been through its start-up sequence.

use super::{Device, plain::Plain};

const SDCMR: u32 = 0x150;
const SDSR: u32 = 0x158;
/// Commands to bank 1 in the order that the SDRAM asks for: clock, precharge, refresh, mode.
const SEQUENCE: [u32; 4] = [1, 2, 3, 4];

/// FMC.
#[derive(Default)]
pub struct Fmc {
    words: Plain,
    done: usize,
}

impl Fmc {
    /// Whether the SDRAM was started as it must be.
    pub fn is_ready(&self) -> bool {
        self.done == SEQUENCE.len()
    }
}

impl Device for Fmc {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        if at == SDSR { 0 } else { self.words.get(at) }
    }

    fn write(&mut self, at: u32, value: u32, size: u8, now: u64) {
        const BANK_1: u32 = 1 << 4;
        if at == SDCMR && value & BANK_1 != 0 {
            if SEQUENCE.get(self.done) == Some(&(value & 7)) {
                self.done += 1;
            } else if value & 7 == SEQUENCE[0] {
                self.done = 1;
            }
        }
        self.words.write(at, value, size, now);
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

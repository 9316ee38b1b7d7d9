//! Flash interface: wait states are kept; programming from within is not modelled, and told when it is tried.

use super::{Device, plain::Plain};

const ACR: u32 = 0x00;
const KEYR: u32 = 0x04;
const CR: u32 = 0x10;
const CR_LOCK: u32 = 1 << 31;

/// FLASH.
pub struct Flash {
    words: Plain,
    /// Firmware tried to open it for programming.
    pub unlocked: bool,
}

impl Default for Flash {
    fn default() -> Self {
        Self { words: Plain::new(&[(CR, CR_LOCK), (0x14, 0xc0ff_aafd)]), unlocked: false }
    }
}

impl Flash {
    /// Wait states.
    pub fn latency(&self) -> u32 {
        self.words.get(ACR) & 0xf
    }
}

impl Device for Flash {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        self.words.get(at)
    }

    fn write(&mut self, at: u32, value: u32, size: u8, now: u64) {
        self.unlocked |= at == KEYR;
        self.words.write(at, value, size, now);
    }

    fn reset(&mut self) {
        self.words.reset();
    }
}

//! Power control: over-drive and voltage scaling are ready as soon as they are asked for.

use super::{Device, plain::Plain};

const CR1: u32 = 0x00;
const CSR1: u32 = 0x04;
const ODEN: u32 = 1 << 16;
const ODSWEN: u32 = 1 << 17;
const VOSRDY: u32 = 1 << 14;

/// PWR.
pub struct Pwr(Plain);

impl Default for Pwr {
    fn default() -> Self {
        Self(Plain::new(&[(CR1, 0xc000)]))
    }
}

impl Pwr {
    /// Whether the core may run beyond 180 MHz.
    pub fn over_drive(&self) -> bool {
        self.0.get(CR1) & (ODEN | ODSWEN) == ODEN | ODSWEN
    }
}

impl Device for Pwr {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        let value = self.0.get(at);
        if at == CSR1 { value | VOSRDY | self.0.get(CR1) & (ODEN | ODSWEN) } else { value }
    }

    fn write(&mut self, at: u32, value: u32, size: u8, now: u64) {
        self.0.write(at, value, size, now);
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}

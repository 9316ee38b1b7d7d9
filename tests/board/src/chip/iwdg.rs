//! The independent watchdog, on its own oscillator of 32 kHz.

use super::Device;
use crate::time::{NEVER, S};

const KR: u32 = 0x00;
const PR: u32 = 0x04;
const RLR: u32 = 0x08;
const LSI_HZ: u64 = 32_000;

/// IWDG.
pub struct Iwdg {
    prescaler: u32,
    reload: u32,
    unlocked: bool,
    /// When it bites; never before it is started. Once started it cannot be stopped but by a reset.
    bites: u64,
    started: bool,
}

impl Default for Iwdg {
    fn default() -> Self {
        Self { prescaler: 0, reload: 0xfff, unlocked: false, bites: NEVER, started: false }
    }
}

impl Iwdg {
    /// Whether it has bitten by now.
    pub fn has_bitten(&self, now: u64) -> bool {
        self.bites <= now
    }

    fn feed(&mut self, now: u64) {
        let divided = 4_u64 << self.prescaler.min(6);
        self.bites = now + (u64::from(self.reload) + 1) * divided * S / LSI_HZ;
    }
}

impl Device for Iwdg {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        match at {
            PR => self.prescaler,
            RLR => self.reload,
            // Updates of the registers are over at once.
            0x10 => 0xfff,
            _ => 0,
        }
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, now: u64) {
        match (at, value) {
            (KR, 0xcccc) => {
                self.started = true;
                self.feed(now);
            }
            (KR, 0xaaaa) if self.started => self.feed(now),
            (KR, _) => self.unlocked = value == 0x5555,
            (PR, _) if self.unlocked => self.prescaler = value & 7,
            (RLR, _) if self.unlocked => self.reload = value & 0xfff,
            _ => {}
        }
    }

    fn next(&self) -> u64 {
        self.bites
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

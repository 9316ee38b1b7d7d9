//! Registers that only keep what is written to them.

use std::collections::BTreeMap;

use super::Device;

/// A block without behaviour.
#[derive(Default)]
pub struct Plain {
    words: BTreeMap<u32, u32>,
    reset: &'static [(u32, u32)],
}

impl Plain {
    /// A block whose registers read zero after reset but for these.
    pub fn new(reset: &'static [(u32, u32)]) -> Self {
        Self { words: reset.iter().copied().collect(), reset }
    }

    /// What a register holds.
    pub fn get(&self, at: u32) -> u32 {
        self.words.get(&at).copied().unwrap_or(0)
    }
}

impl Device for Plain {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        self.get(at)
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, _now: u64) {
        self.words.insert(at, value);
    }

    fn reset(&mut self) {
        self.words = self.reset.iter().copied().collect();
    }
}

//! What the USB words of iniVation's cameras have in common: 16 bits, and a 15-bit clock with wrap words.

/// The word by which a camera tells that its clock was set to zero.
pub(super) const CLOCK_RESET: u16 = 1;

/// Clock behind words with bit 15 set (low 15 bits of the time) and wrap words (multiples of 2^15 us).
#[derive(Clone, Debug, Default)]
pub(super) struct Clock {
    base_us: u64,
    t_us: u64,
    wraps: u32,
    resets: u32,
}

impl Clock {
    pub(super) const fn new() -> Self {
        Self { base_us: 0, t_us: 0, wraps: 0, resets: 0 }
    }

    pub(super) const fn t_us(&self) -> u64 {
        self.t_us
    }

    pub(super) const fn wraps(&self) -> u32 {
        self.wraps
    }

    pub(super) const fn resets(&self) -> u32 {
        self.resets
    }

    #[inline]
    pub(super) fn low(&mut self, word: u16) {
        self.t_us = self.base_us + u64::from(word & 0x7fff);
    }

    /// A wrap word: the camera folds wraps in which nothing happened into one word with their number.
    pub(super) fn wrap(&mut self, count: u16) {
        self.base_us += u64::from(count) << 15;
        self.t_us = self.base_us;
        self.wraps += u32::from(count);
    }

    /// The camera's clock was set to zero.
    pub(super) fn reset(&mut self) {
        self.base_us = 0;
        self.t_us = 0;
        self.resets += 1;
    }
}

//! The clock of Prophesee's EVT 2.0 and 2.1: its upper 28 bits come in words of their own, its lower six with the events.

/// Bits of the TIME_HIGH counter, which counts steps of 64 us: it wraps after 2^34 us (4.8 hours).
const HIGH_BITS: u32 = 28;
const LOW_BITS: u32 = 6;

/// What the last TIME_HIGH word said.
#[derive(Clone, Debug, Default)]
pub(super) struct HighClock {
    /// Time of that word in microseconds, wraps included.
    base_us: u64,
    /// Its payload.
    high: Option<u32>,
    wraps: u32,
}

impl HighClock {
    pub(super) const fn new() -> Self {
        Self { base_us: 0, high: None, wraps: 0 }
    }

    /// Time of the last TIME_HIGH word in microseconds, once one has come.
    #[inline]
    pub(super) const fn base_us(&self) -> Option<u64> {
        if self.high.is_some() { Some(self.base_us) } else { None }
    }

    pub(super) const fn wraps(&self) -> u32 {
        self.wraps
    }

    /// Takes in the payload of a TIME_HIGH word.
    pub(super) fn set(&mut self, high: u32) {
        // Only a jump back by more than half the range is the counter's wrap; less is a stream out of order.
        if self.high.is_some_and(|before| before > high && before - high > 1 << (HIGH_BITS - 1)) {
            self.wraps += 1;
        }
        self.high = Some(high);
        self.base_us =
            (u64::from(self.wraps) << (HIGH_BITS + LOW_BITS)) | (u64::from(high) << LOW_BITS);
    }
}

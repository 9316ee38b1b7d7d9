//! Undoing the wrap of a 32-bit microsecond counter.

/// A 32-bit counter of microseconds that wraps after 71.6 minutes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock32 {
    base_us: u64,
    last: u32,
}

impl Clock32 {
    /// The full time; counts a wrap when the counter falls by more than half its range.
    pub fn advance(&mut self, t: u32, wraps: &mut u64) -> u64 {
        if t < self.last && self.last - t > 1 << 31 {
            self.base_us += 1 << 32;
            *wraps += 1;
        }
        self.last = t;
        self.base_us + u64::from(t)
    }
}

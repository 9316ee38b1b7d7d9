//! Undoing the wrap of a 32-bit microsecond counter.

/// A 32-bit counter of microseconds that wraps after 71.6 minutes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock32 {
    base_us: u64,
    last: u32,
}

impl Clock32 {
    const SPAN_US: u64 = 1 << 32;

    /// The full time; counts a wrap when the counter falls by more than half its range. What leaps by as much ahead after a wrap is late,
    /// from before it.
    pub fn advance(&mut self, t: u32, wraps: &mut u64) -> u64 {
        const HALF: u32 = 1 << 31;
        if self.base_us > 0 && t.saturating_sub(self.last) > HALF {
            return self.base_us - Self::SPAN_US + u64::from(t);
        }
        if self.last.saturating_sub(t) > HALF {
            self.base_us += Self::SPAN_US;
            *wraps += 1;
        }
        self.last = t;
        self.base_us + u64::from(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_late_across_a_wrap_stays_before_it() {
        let (mut clock, mut wraps) = (Clock32::default(), 0);
        let full = [u32::MAX - 4, 3, u32::MAX - 1, 6, 7].map(|t| clock.advance(t, &mut wraps));
        let wrap = 1 << 32;
        assert_eq!(full, [wrap - 5, wrap + 3, wrap - 2, wrap + 6, wrap + 7]);
        assert_eq!(wraps, 1);
    }
}

//! Even thinning of a window.

use super::{StoredEvent, Window};

/// Goes through events that each stand for the same number of arrived ones, a segment of the window at a time.
///
/// The stored events are dense at the start of each segment; whoever looks for frequencies must not take
/// that rhythm for one of the scene. So all segments are weighed first, and then gone through.
#[derive(Clone, Copy, Debug, Default)]
pub struct Even {
    /// Events that were weighed, and how many arrived ones they stand for.
    count: u32,
    weight: u32,
    /// Arrived events that went by, and how many were taken.
    passed: u32,
    taken: u32,
    coarsest_log2: u8,
    weighed: bool,
    /// Segment that comes next.
    segment: u8,
}

impl Even {
    /// Nothing gone through yet.
    pub const EMPTY: Self = Self {
        count: 0,
        weight: 0,
        passed: 0,
        taken: 0,
        coarsest_log2: 0,
        weighed: false,
        segment: 0,
    };

    /// Weighs the next segment; `true` once all segments were.
    pub fn weigh(&mut self, window: &Window<'_>, inside: impl Fn(StoredEvent) -> bool) -> bool {
        // In registers: 32 bits hold what a segment stands for.
        let (mut count, mut weight, mut coarsest_log2) = (0, 0_u32, self.coarsest_log2);
        for event in window.segment(usize::from(self.segment)) {
            if inside(*event) {
                let weight_log2 = event.weight_log2();
                count += 1;
                weight = weight.wrapping_add(1 << weight_log2);
                if weight_log2 > coarsest_log2 {
                    coarsest_log2 = weight_log2;
                }
            }
        }
        self.count += count;
        self.weight = self.weight.saturating_add(weight);
        self.coarsest_log2 = coarsest_log2;
        self.weighed = self.advance(window);
        self.weighed
    }

    /// Weighs the next segment, or hands `take` its share of at most `most` events for which `inside` gives a value; `true` once all
    /// segments were gone through. `inside` is the same in every call.
    pub fn step<T>(
        &mut self,
        window: &Window<'_>,
        most: usize,
        inside: impl Fn(StoredEvent) -> Option<T>,
        mut take: impl FnMut(StoredEvent, T),
    ) -> bool {
        if !self.weighed {
            self.weigh(window, |event| inside(event).is_some());
            return false;
        }
        // Fixed-point, so that any ratio thins evenly.
        let stride = (u64::from(self.weight) << 8) / most.max(1) as u64 + 1;
        let stride = stride.max(1 << (self.coarsest_log2 + 8));
        let mut passed = u64::from(self.passed) << 8;
        let mut next = u64::from(self.taken) * stride;
        for event in window.segment(usize::from(self.segment)) {
            let Some(value) = inside(*event) else { continue };
            if passed >= next {
                next += stride;
                self.taken += 1;
                take(*event, value);
            }
            passed += 1 << (event.weight_log2() + 8);
        }
        self.passed = (passed >> 8) as u32;
        self.advance(window)
    }

    /// Goes on to the next segment; `true` at the end, where the first comes next.
    const fn advance(&mut self, window: &Window<'_>) -> bool {
        self.segment += 1;
        if (self.segment as usize) < window.segments() {
            return false;
        }
        self.segment = 0;
        true
    }

    /// Goes through the events once more.
    pub const fn again(&mut self) {
        (self.passed, self.taken) = (0, 0);
    }

    /// Whether all segments were weighed.
    #[must_use]
    pub const fn is_weighed(&self) -> bool {
        self.weighed
    }

    /// Events inside, before thinning.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count as usize
    }

    /// Share of the events that would be left if all were thinned as the thinnest are.
    #[must_use]
    pub fn share(&self) -> f32 {
        (self.weight >> self.coarsest_log2) as f32 / (self.count as f32).max(1.0)
    }
}

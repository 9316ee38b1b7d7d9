//! Slices of events around a rotor's centre.

use heapless::Vec;

use crate::limits::SLICE_POINTS;
use crate::speed::path::Moving;
use crate::store::Window;
use crate::thinning::Thinning;

/// One event of a slice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlicePoint {
    /// Position relative to the rotor's centre in pixels.
    pub x_px: f32,
    /// Position relative to the rotor's centre in pixels.
    pub y_px: f32,
    /// Time since the start of the slice in seconds: the third coordinate of the registration.
    ///
    /// Relative to the slice, as slices that overlap would otherwise match themselves.
    pub tau_s: f32,
    /// Brighter or darker.
    pub on: bool,
}

/// A slice of events.
pub type Slice = Vec<SlicePoint, SLICE_POINTS>;

/// Which events make a slice, in microseconds since the start of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Start of the slice.
    pub start_us: f32,
    /// Length of the slice.
    pub length_us: f32,
    /// Period with which the pattern repeats.
    pub period_us: f32,
    /// How many stretches, each one period after the other, are laid over each other: a thinned window holds too few
    /// events in one.
    pub folds: u32,
    /// Most events, up to the capacity of a slice.
    pub most: usize,
}

impl Cut {
    /// Collects the slice, evenly thinned to the most.
    pub fn collect(&self, window: &Window<'_>, disc: Moving<'_>, slice: &mut Slice) {
        // As they come, while there is room: seldom are there more, which are gone through again.
        let total = self.take(self.most, window, disc, slice);
        if total > SLICE_POINTS {
            self.take(total, window, disc, slice);
        } else if total > self.most {
            let mut thinning = Thinning::new(self.most, total);
            slice.retain(|_| thinning.keeps_next());
        }
    }

    /// Takes the most of so many events; the number of all that there are.
    // Not inlined: flash is short.
    #[inline(never)]
    fn take(
        &self,
        of: usize,
        window: &Window<'_>,
        mut disc: Moving<'_>,
        slice: &mut Slice,
    ) -> usize {
        slice.clear();
        let mut thinning = Thinning::new(self.most, of);
        for fold in 0..self.folds {
            let start_us = self.start_us + fold as f32 * self.period_us;
            let end_us = start_us + self.length_us;
            // Events are gone through in stretches, which a loop over all of them would not know.
            window.between(start_us as i32, end_us as i32).for_each(|event| {
                if let Some((x_px, y_px, _)) = disc.place(event)
                    && thinning.keeps_next()
                {
                    let tau_s = (event.since(window.start_us) as f32 - start_us) * 1e-6;
                    slice.push(SlicePoint { x_px, y_px, tau_s, on: window.is_on(event) }).ok();
                }
            });
        }
        thinning.count()
    }
}

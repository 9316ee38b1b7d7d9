//! How sharply the events show the rotor's edges.

use super::{LEAST_SHARE, Pose};
use crate::math::larger;

impl Pose {
    /// How sharply the events show the rotor's edges, in pixels half-way to the rim: the width of what they would be
    /// scattered over evenly.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn sharpness_px(&self) -> f32 {
        0.5 * self.disc.radius_px / (self.harmonic as f32 * self.coherence.max(LEAST_SHARE))
    }

    /// The same for those events that kept step when the rotor was found, where a harmonic twice as high or more shows edges
    /// at all: noise, a lamp and a background among the rotor's events are not blur. Pixels at the rim's half.
    #[must_use]
    pub fn blur_px(&self) -> f32 {
        if self.has_overtone() {
            // Of what is followed and what shows beside it, whichever is sharper.
            let finer = larger(1.0, 2.0 * self.overtone / self.coherence.max(LEAST_SHARE));
            self.sharpness_px() / finer * self.first_coherence.max(self.coherence)
        } else {
            self.sharpness_px()
        }
    }

    /// Whether twice the harmonic that the rotor was found by keeps step too.
    #[must_use]
    pub fn has_overtone(&self) -> bool {
        self.harmonic > self.first_harmonic || self.overtone > 0.0
    }
}

//! Sums over a rotor's events by angular harmonic, for each ring and polarity.

/// Terms: harmonics from -16 to 16, or the first 24.
pub const TERMS: usize = 33;
/// Rings and polarities.
pub const BANKS: usize = 16;

/// The memory of a look at all harmonics: [`super::phase::scan`] or [`super::symmetry::turn_back`], some events a call.
#[derive(Clone, Debug)]
pub struct AngularSums {
    /// Cosines and sines by ring and polarity, and term.
    pub sums: [[(f32, f32); TERMS]; BANKS],
    /// Events by ring and polarity.
    pub counts: [u32; BANKS],
}

impl AngularSums {
    /// No events. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self = Self { sums: [[(0.0, 0.0); TERMS]; BANKS], counts: [0; BANKS] };

    /// Starts over.
    pub fn clear(&mut self) {
        for bank in &mut self.sums {
            bank.fill((0.0, 0.0));
        }
        self.counts.fill(0);
    }
}

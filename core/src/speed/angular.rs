//! Sums over a rotor's events by direction or angular harmonic, for each ring and polarity.

use microfft::Complex32;

/// Directions, or harmonics.
pub const DIRECTIONS: usize = 64;
/// Rings between a rotor's inner edge and rim that [`super::phase::scan`] tells apart, each for both polarities.
pub const BANKS: usize = 14;

/// The memory of a look at all harmonics: [`super::phase::scan`], or [`super::symmetry::turn_back`] some events a call.
#[derive(Clone, Debug)]
pub struct AngularSums {
    /// Sums by ring and polarity, and direction or harmonic.
    pub sums: [[Complex32; DIRECTIONS]; BANKS],
    /// Events by ring and polarity.
    pub counts: [u32; BANKS],
}

impl AngularSums {
    /// No events. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self =
        Self { sums: [[Complex32 { re: 0.0, im: 0.0 }; DIRECTIONS]; BANKS], counts: [0; BANKS] };

    /// Starts over.
    pub fn clear(&mut self) {
        self.sums.as_flattened_mut().fill(Complex32::default());
        self.counts.fill(0);
    }
}

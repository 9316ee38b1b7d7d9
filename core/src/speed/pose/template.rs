//! The rotor in its own frame: the phase of one angular harmonic on many narrow rings, for each polarity.

use crate::math::{larger, sqrt};

/// Rings between centre and rim.
pub const RINGS: usize = 32;
/// Banks: a ring for each polarity.
pub const BANKS: usize = 2 * RINGS;

/// Less than this share in step is none.
const LEAST_COHERENCE: f32 = 1e-3;

/// Template of a rotor: a harmonic by ring and polarity.
#[derive(Clone, Copy, Debug)]
pub struct Template {
    sums: [(f32, f32); BANKS],
}

/// Events by ring and polarity.
pub type Counts = [u32; BANKS];

impl Template {
    /// Nothing learnt.
    pub const EMPTY: Self = Self { sums: [(0.0, 0.0); BANKS] };

    /// Adds an event by the (sine, cosine) of its phase.
    pub fn add(&mut self, bank: usize, (sin, cos): (f32, f32)) {
        self.sums[bank].0 += cos;
        self.sums[bank].1 += sin;
    }

    /// Share of so many events in step, 0 to 1, corrected for what chance gives.
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn coherence(&self, counts: &Counts) -> f32 {
        let (mut in_step, mut total) = (0.0, 0.0);
        for (sum, count) in self.sums.iter().zip(counts) {
            let excess = sum.0 * sum.0 + sum.1 * sum.1 - *count as f32;
            in_step += sqrt(larger(excess, 0.0));
            total += *count as f32;
        }
        in_step / larger(total, 1.0)
    }

    /// Every bank's phase as (cosine, sine) times what its events weigh: as much as they are in step, 1 on average, where `coherence` is
    /// [`Self::coherence`].
    pub fn phases(&self, counts: &Counts, coherence: f32) -> [(f32, f32, f32); BANKS] {
        let mean = larger(coherence, LEAST_COHERENCE);
        let mut phases = [(0.0, 0.0, 0.0); BANKS];
        for ((phase, (re, im)), count) in phases.iter_mut().zip(self.sums).zip(counts) {
            let count = *count as f32;
            let square = re * re + im * im;
            let length = larger(sqrt(square), f32::MIN_POSITIVE);
            let weight = sqrt(larger(square - count, 0.0)) / larger(count * mean, 1.0);
            let per = weight / length;
            *phase = (re * per, im * per, weight);
        }
        phases
    }
}

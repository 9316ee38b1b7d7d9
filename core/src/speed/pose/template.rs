//! The rotor in its own frame: the phase of one angular harmonic on many narrow rings, for each polarity.

use crate::math::{Turn, larger, sqrt};

/// Rings between centre and rim.
pub const RINGS: usize = 32;
/// Banks: a ring for each polarity.
pub const BANKS: usize = 2 * RINGS;

/// Rings of each of so many sectors.
pub const fn rings(sectors: u32) -> usize {
    let rings = RINGS / sectors as usize;
    if rings > 0 { rings } else { 1 }
}

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

    /// By how many radians an edge goes round for each factor of e in radius, at harmonic `m` of a rotor of so many sectors, where about as
    /// much is known: rings beside each other may be more than a cycle apart.
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn sweep(&self, sectors: u32, m: f32, known: f32) -> f32 {
        let rings = rings(sectors);
        let (mut sum, mut whole) = (0.0, f32::MIN_POSITIVE);
        for (bank, (a, b)) in self.sums.iter().zip(self.sums.iter().skip(2)).enumerate() {
            let outer = bank / 2 % rings + 1;
            if outer == rings {
                continue;
            }
            let (re, im) = (a.0 * b.0 + a.1 * b.1, a.0 * b.1 - a.1 * b.0);
            // From the middle of a ring to that of the next the radius grows by about one part in so many.
            let per = outer as f32 / m;
            let (sin, cos) = Turn::from_rad(known / per).sin_cos();
            // As much as events are in step; the sine does for the angle, as more rounds come.
            let weight = larger(sqrt(sqrt(re * re + im * im)), f32::MIN_POSITIVE);
            sum += per * (im * cos - re * sin) / weight;
            whole += weight;
        }
        known + sum / whole
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sweep_of_a_spiral_is_found_from_ring_to_ring() {
        for (sectors, sweep) in [(1, 0.8), (1, -1.3), (4, 0.5), (1, 0.0)] {
            let mut found = 0.0;
            // As the harmonic is doubled from round to round.
            for m in [4, 8, 8, 16, 32, 32] {
                let mut template = Template::EMPTY;
                for bank in 0..BANKS {
                    let ring = bank / 2 % rings(sectors);
                    let angle = Turn::from_rad(sweep * libm::logf(ring as f32 + 0.5));
                    (0..=ring).for_each(|_| template.add(bank, angle.times(m).sin_cos()));
                }
                found = template.sweep(sectors, m as f32, found);
            }
            assert!((found - sweep).abs() < 0.02, "{sectors} sectors, {sweep}: {found}");
        }
        assert_eq!(Template::EMPTY.sweep(1, 8.0, 0.3), 0.3, "nothing seen, nothing learnt");
    }
}

//! Angle of rotational symmetry: how many equal parts a rotor has.
//!
//! The paper clusters 300 events with K-means++ and the Davies-Bouldin index, which never returns one part and errs
//! often (0 to 100 % right). Here: angular autocorrelation of the rotor in its own frame. With the speed known
//! all events of the window can be turned back to one instant; the power of the angular harmonics of what is seen
//! then is the Fourier transform of the autocorrelation, chance taken off.

use heapless::Vec;
use microfft::Complex32;

use super::angular::AngularSums;
use super::polar::PolarEvent;
use crate::limits::MAX_BLADES;
use crate::math::{Turn, TurnRate, sqrt};
use crate::rotors::Disc;

/// Angular harmonics: the third overtone of eight blades.
const HARMONICS: usize = 24;
/// Rings and polarities whose patterns are turned against each other and so are summed by power.
const RINGS: usize = 4;
/// Least score of a symmetry, else the rotor has one part: twice what chance gives a single mark of so many events, one over their
/// root. (Single marks of random scenes score 0.03 at most from a thousand events on, and 0.09 with two hundred.)
const LEAST_SCORE: f32 = 2.0;
/// Events beyond which what a single mark scores is no longer chance, but its shape.
const MOST_CHANCE: u32 = 3_072;
/// The largest count within this share of the best score wins: six blades also repeat like three and two.
const CLOSE_TO_BEST: f32 = 0.85;
/// Largest count that is tried: beyond [`MAX_BLADES`] only to say that it is beyond.
const MOST_PARTS: usize = 20;

/// What the autocorrelation says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Symmetry {
    /// Number of equal parts, `None` when it is above [`MAX_BLADES`].
    pub parts: Option<u8>,
    /// Correlation at the angle of symmetry over that at zero: below 1 where parts differ.
    pub score: f32,
}

/// Adds events, turned back at a speed to one instant. Cost: about 400 instructions an event.
pub fn turn_back(angular: &mut AngularSums, track: &[PolarEvent], disc: Disc, omega_rad_s: f32) {
    let rate = TurnRate::from_rad_s(omega_rad_s);
    for event in track {
        let ring = (event.radius_px() / disc.radius_px.max(1.0) * RINGS as f32) as usize;
        let bank = 2 * ring.min(RINGS - 1) + usize::from(event.is_on());
        angular.counts[bank] += 1;
        let (sin, cos) = event.angle().minus(rate.after(event.t_us)).sin_cos();
        let (mut s, mut c) = (sin, cos);
        for sum in &mut angular.sums[bank][..HARMONICS] {
            sum.re += c;
            sum.im += s;
            (c, s) = (c * cos - s * sin, s * cos + c * sin);
        }
    }
}

/// What is left when it is turned so far. Not inlined: flash is short.
#[inline(never)]
fn correlation(powers: &[f32], turns: f32) -> f32 {
    let angle = (turns * 65_536.0) as u32;
    let part = |(index, power): (usize, &f32)| {
        power * Turn(angle.wrapping_mul(index as u32 + 1) << 16).sin_cos().1
    };
    powers.iter().enumerate().map(part).sum()
}

/// Finds the number of equal parts in what was turned back. Cost: 300 000 instructions.
#[must_use]
pub fn symmetry(angular: &AngularSums) -> Symmetry {
    let powers = powers(angular);
    let at = |turns: f32| correlation(&powers, turns);
    let zero = at(0.0);
    if zero <= 0.0 {
        return Symmetry { parts: Some(1), score: 0.0 };
    }
    // Mean correlation at the multiples of the angle of symmetry, less that half-way between them.
    let comb = |parts: usize| {
        let angle = 1.0 / parts as f32;
        let peaks: f32 = (1..parts).map(|i| at(i as f32 * angle)).sum();
        let valleys: f32 = (0..parts).map(|i| at((i as f32 + 0.5) * angle)).sum();
        (peaks / (parts - 1) as f32 - valleys / parts as f32) / zero
    };
    let mut scores = Vec::<f32, { MOST_PARTS + 1 }>::new();
    for parts in 0..=MOST_PARTS {
        scores.push(if parts < 2 { 0.0 } else { comb(parts) }).ok();
    }
    let best = scores.iter().copied().fold(0.0, f32::max);
    let events: u32 = angular.counts.iter().take(2 * RINGS).sum();
    let least = LEAST_SCORE / sqrt(events.min(MOST_CHANCE) as f32);
    let mut parts = 1;
    for (number, score) in scores.iter().enumerate().skip(2) {
        if *score >= CLOSE_TO_BEST * best {
            parts = number;
        }
    }
    let mean_peak =
        (1..parts).map(|i| at(i as f32 / parts as f32)).sum::<f32>() / (parts - 1).max(1) as f32;
    let known = parts <= usize::from(MAX_BLADES);
    // The edges of a sharp single mark differ from what is beside them at some angles, but nothing comes again there.
    let comes_again = mean_peak >= least * zero || !known;
    if best < least || !comes_again {
        return Symmetry { parts: Some(1), score: best };
    }
    Symmetry { parts: known.then_some(parts as u8), score: mean_peak / zero }
}

/// Power of each angular harmonic in the rotor's own frame, less what unrelated events would give.
fn powers(angular: &AngularSums) -> [f32; HARMONICS] {
    let mut powers = [0.0; HARMONICS];
    for (bank, count) in angular.sums.iter().zip(angular.counts).take(2 * RINGS) {
        for (power, Complex32 { re, im }) in powers.iter_mut().zip(bank) {
            *power += (re * re + im * im - count as f32).max(0.0);
        }
    }
    powers
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Events at the edges of so many parts, ON at one edge and OFF at the other, both as sharp as can be.
    fn edges(parts: u32, width_rad: f32) -> AngularSums {
        let mut angular = AngularSums::EMPTY;
        for part in 0..parts {
            let first_rad = part as f32 * crate::math::TAU / parts as f32;
            for (bank, at_rad) in [first_rad, first_rad + width_rad].into_iter().enumerate() {
                angular.counts[bank] += 2_000;
                for (k, sum) in angular.sums[bank][..HARMONICS].iter_mut().enumerate() {
                    let (sin, cos) = Turn::from_rad(at_rad).times(k as u32 + 1).sin_cos();
                    sum.re += 2_000.0 * cos;
                    sum.im += 2_000.0 * sin;
                }
            }
        }
        angular
    }

    #[test]
    fn sharp_parts_are_counted_and_a_sharp_single_mark_is_one() {
        for parts in 1..=u32::from(MAX_BLADES) {
            let found = symmetry(&edges(parts, 0.36));
            assert_eq!(found.parts.map(u32::from), Some(parts), "{found:?}");
        }
    }
}

//! Angle of rotational symmetry: how many equal parts a rotor has.
//!
//! The paper clusters 300 events with K-means++ and the Davies-Bouldin index, which never returns one part and errs
//! often (0 to 100 % right). Here: angular autocorrelation of the rotor in its own frame. With the speed known
//! all events of the window can be turned back to one instant; the power of the angular harmonics of what is seen
//! then is the Fourier transform of the autocorrelation, chance taken off.

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
/// The largest count whose parts are within this share as alike as the best one's are wins: six blades also repeat like three and two.
const CLOSE_TO_BEST: f32 = 0.85;
/// Without polarity: a count is a rival of smaller ones when its least alike step is within this share of the best one's. The largest
/// rival wins when it is within the second share, else the count is not known. (Of random scenes nearly all true counts have 0.98
/// and more, those of few events less, and nearly all edges counted as blades less.)
const RIVALS: f32 = 0.9;
const NO_RIVAL: f32 = 0.98;
/// Least correlation of parts without polarity, and of what was not counted, below which it may be a single mark: its edges, a third or about
/// a half of a turn wide, are half as alike as parts are.
pub(super) const LEAST_ALIKE: f32 = 0.7;
/// Power at a higher harmonic over that at the first from which on it shows a single mark, and how many are asked.
const LEAST_OF_FIRST: f32 = 0.25;
const MARK_HARMONICS: usize = 8;
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

/// Correlation at the multiples of the angle of symmetry of so many parts: sum and least. Not inlined: flash is short.
#[inline(never)]
fn correlation(powers: &[f32], parts: usize) -> (f32, f32) {
    let (mut sum, mut least) = (0.0, f32::INFINITY);
    for step in 1..parts {
        let turn = ((step << 16) / parts) as u32;
        let harmonic = |(index, power): (usize, &f32)| {
            power * Turn(turn.wrapping_mul(index as u32 + 1) << 16).sin_cos().1
        };
        let at_step: f32 = powers.iter().enumerate().map(harmonic).sum();
        sum += at_step;
        least = at_step.min(least);
    }
    (sum, least)
}

/// Harmonic that shows a single mark best, where the second hardly shows it: without polarity both edges of a mark are alike, and those
/// of one that is a quarter of a turn wide, say, cancel in the second. `None` where no higher one shows it, either.
#[must_use]
pub fn mark_harmonic(angular: &AngularSums) -> Option<u32> {
    let powers = powers(angular);
    let least = LEAST_OF_FIRST * powers[0];
    let higher = powers.iter().copied().enumerate().take(MARK_HARMONICS).skip(2);
    let (index, power) = higher.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (powers[1] < least && power > least).then_some(index as u32 + 1)
}

/// Finds the number of equal parts in what was turned back: the largest whose multiples of an angle all look alike. The mean over them
/// counts, so that one odd blade does not; without polarity both edges of a blade look alike, and the mean would favour what edges have in
/// common, but where a blade is not as wide as the gap beside it they are not alike at every step: there the least counts.
/// Cost: 190 000 instructions.
#[must_use]
pub fn symmetry(angular: &AngularSums) -> Symmetry {
    let powers = powers(angular);
    let zero: f32 = powers.iter().sum();
    if zero <= 0.0 {
        return Symmetry { parts: Some(1), score: 0.0 };
    }
    let events: u32 = angular.counts.iter().take(2 * RINGS).sum();
    let on: u32 = angular.counts.iter().take(2 * RINGS).skip(1).step_by(2).sum();
    let has_polarity = on != 0 && on != events;
    let rival = if has_polarity { CLOSE_TO_BEST } else { RIVALS };
    let least = LEAST_SCORE / sqrt(events.min(MOST_CHANCE) as f32);
    let (mut parts, mut score, mut best) = (1, 0.0, 0.0_f32);
    for number in 2..=MOST_PARTS {
        let (sum, least_alike) = correlation(&powers, number);
        let alike = if has_polarity { sum / (number - 1) as f32 } else { least_alike } / zero;
        best = best.max(alike);
        if alike >= rival * best {
            (parts, score) = (number, alike);
        }
    }
    if best < least {
        return Symmetry { parts: Some(1), score: best };
    }
    let counted = has_polarity || score >= NO_RIVAL * best && score >= LEAST_ALIKE;
    let known = counted && parts <= usize::from(MAX_BLADES);
    Symmetry { parts: known.then_some(parts as u8), score }
}

/// Power of each angular harmonic in the rotor's own frame, less what unrelated events would give.
// Not inlined: flash is short.
#[inline(never)]
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

    /// Events at the edges of so many parts, both as sharp as can be: ON at one edge, and OFF at the other or ON as well.
    fn edges(parts: u32, width_rad: f32, has_polarity: bool) -> AngularSums {
        let mut angular = AngularSums::EMPTY;
        for part in 0..parts {
            let first_rad = part as f32 * crate::math::TAU / parts as f32;
            for (edge, at_rad) in [first_rad, first_rad + width_rad].into_iter().enumerate() {
                let bank = usize::from(!has_polarity || edge == 0);
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
            let found = symmetry(&edges(parts, 0.36, true));
            assert_eq!(found.parts.map(u32::from), Some(parts), "{found:?}");
        }
    }

    #[test]
    fn blurred_parts_are_counted_however_strong_their_overtone() {
        for (parts, counted) in
            [(3_usize, Some(3)), (5, Some(5)), (7, Some(7)), (8, Some(8)), (12, None)]
        {
            let mut angular = AngularSums::EMPTY;
            angular.counts[..2].fill(2_000);
            for sum in &mut angular.sums[..2] {
                sum[parts - 1].re = 600.0;
                sum[2 * parts - 1].re = 1_000.0;
            }
            assert_eq!(symmetry(&angular).parts, counted, "{parts}");
        }
    }

    #[test]
    fn without_polarity_the_edges_of_broad_parts_are_not_counted_as_parts() {
        for parts in 1..=u32::from(MAX_BLADES) {
            for share in [0.35, 0.4, 0.43, 0.57, 0.6, 0.65] {
                let width_rad = share * crate::math::TAU / parts as f32;
                let found = symmetry(&edges(parts, width_rad, false)).parts.map(u32::from);
                assert!(found.is_none_or(|found| found == parts), "{parts}, {share}: {found:?}");
                assert!(found.is_some() || !(2..=5).contains(&parts), "{parts}, {share}");
            }
        }
    }

    #[test]
    fn without_polarity_narrow_parts_are_counted() {
        for parts in 1..=u32::from(MAX_BLADES) {
            let found = symmetry(&edges(parts, 0.02, false));
            assert_eq!(found.parts.map(u32::from), Some(parts), "{found:?}");
        }
    }

    #[test]
    fn a_broad_mark_without_polarity_is_shown_by_a_harmonic_that_its_edges_add_up_in() {
        let quarter_rad = 0.25 * crate::math::TAU;
        let found = mark_harmonic(&edges(1, quarter_rad, false));
        assert!(matches!(found, Some(4 | 8)), "{found:?}");
        // Where edges are told apart by their polarity, or hardly are two, all harmonics show it.
        assert_eq!(mark_harmonic(&edges(1, quarter_rad, true)), None);
        assert_eq!(mark_harmonic(&edges(1, 0.02, false)), None);
    }
}

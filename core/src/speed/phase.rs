//! Polar phase: how well the events follow a rotation, and what small change of centre and speed makes
//! them follow better.
//!
//! With the right centre and speed, m (theta - w t) of all events at one radius and polarity lies around one
//! phase (swept blades and the two edges of a blade have different ones, hence rings and polarities).
//! The deviation psi from it is explained to first order by a wrong centre, speed and phase; a Newton step on the
//! sum of cos(psi) finds them. Cost: about 150 instructions an event and step.

use microfft::Complex32;
use nalgebra::{Matrix4, Vector4};

use super::angular::{AngularSums, DIRECTIONS};
use super::polar::PolarEvent;
use crate::math::{TAU, Turn, TurnRate, larger, quick_sqrt, sqrt};
use crate::rotors::Disc;

/// Rings between centre and rim, each for both polarities: the innermost, within a rotor's inner edge, and those that a [`scan`] tells
/// apart.
const RINGS: usize = super::angular::BANKS / 2 + 1;
const BANKS: usize = 2 * RINGS;

/// Share that a ring, of either polarity, adds to the events in step within it, below which it lies beyond the rim.
const LEAST_IN_RING: f32 = 0.01;

/// Phases of the rotor's pattern by ring and polarity.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pattern {
    sums: [(f32, f32); BANKS],
    counts: [u32; BANKS],
}

fn bank(event: PolarEvent, disc: Disc) -> usize {
    let ring = (event.radius_px() / disc.radius_px.max(1.0) * RINGS as f32) as usize;
    2 * ring.min(RINGS - 1) + usize::from(event.is_on())
}

fn phase(event: PolarEvent, rate: TurnRate, harmonic: u32) -> Turn {
    event.angle().minus(rate.after(event.t_us)).times(harmonic)
}

/// Sine and cosine of what an event is ahead of its ring's phase.
// Inlined, as it is asked of every event.
#[inline(always)]
pub(super) fn ahead(
    event: PolarEvent,
    disc: Disc,
    rate: TurnRate,
    harmonic: u32,
    turns: &[Turn; BANKS],
) -> (f32, f32) {
    phase(event, rate, harmonic).minus(turns[bank(event, disc)]).sin_cos()
}

impl Pattern {
    /// Learns the phases at a speed.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn learn(track: &[PolarEvent], disc: Disc, omega_rad_s: f32, harmonic: u32) -> Self {
        let rate = TurnRate::from_rad_s(omega_rad_s);
        let mut pattern = Self::default();
        for event in track {
            let (sin, cos) = phase(*event, rate, harmonic).sin_cos();
            let bank = bank(*event, disc);
            pattern.sums[bank].0 += cos;
            pattern.sums[bank].1 += sin;
            pattern.counts[bank] += 1;
        }
        pattern
    }

    /// Share of events in step, 0 to 1, corrected for what chance gives; and the share of the disc's radius within which they lie, by the
    /// outermost ring that adds a hundredth to them.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn coherence(&self) -> (f32, f32) {
        let (mut in_step, mut total, mut rings) = (0.0, 0.0, 0);
        for (bank, (sum, count)) in self.sums.iter().zip(self.counts).enumerate() {
            let excess = sum.0 * sum.0 + sum.1 * sum.1 - count as f32;
            let more = sqrt(excess.max(0.0));
            in_step += more;
            total += count as f32;
            if more > LEAST_IN_RING * in_step {
                rings = bank / 2 + 1;
            }
        }
        (in_step / total.max(1.0), rings as f32 / RINGS as f32)
    }

    /// Adds its sums to those of others.
    pub fn add_to(&self, sums: &mut [Complex32]) {
        for (sum, (re, im)) in sums.iter_mut().zip(self.sums) {
            *sum += Complex32::new(re, im);
        }
    }

    /// By how much it is ahead of the sums of others, weighed by how clearly both show each ring.
    #[must_use]
    pub fn ahead_of(&self, sums: &[Complex32]) -> Turn {
        let (mut along, mut across) = (0.0, 0.0);
        for (sum, (re, im)) in sums.iter().zip(self.sums) {
            along += sum.re * re + sum.im * im;
            across += sum.re * im - sum.im * re;
        }
        direction((along, across))
    }

    /// The phases by ring and polarity.
    pub(super) fn turns(&self) -> [Turn; BANKS] {
        self.sums.map(direction)
    }
}

/// Direction of a sum of (cosines, sines). Not inlined: flash is short.
#[inline(never)]
pub(super) fn direction((x, y): (f32, f32)) -> Turn {
    Turn::of_vector(y, x)
}

/// Highest angular harmonic that a [`scan`] tries.
const MOST_HARMONIC: usize = 16;
/// Harmonics from the lowest to the highest.
const TERMS: usize = 2 * MOST_HARMONIC + 1;

/// Which angular harmonic keeps step with a frequency best.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonics {
    /// The harmonic: positive = clockwise, 0 = all directions in step.
    pub best: i32,
    /// Share of events in step with it.
    pub share: f32,
    /// The same for the next best: near `share` where the pattern stands (flicker, vibration) or the centre is off.
    pub second_share: f32,
    /// The same with all directions in step.
    pub still_share: f32,
    /// The same with as many windings the other way.
    pub mirror_share: f32,
    /// The same for the best that could be taken for it about another centre. Not all directions in step, nor twice the
    /// harmonic: those two keep step with fast blades where a pixel that has just fired misses the next edge, so that the
    /// events of a rotor show where its blades were when the pixels first fired.
    pub rival_share: f32,
}

/// Which angular harmonics from -16 to 16 keep step with one frequency in Hz.
///
/// For each ring and polarity, phases of that frequency are summed by the direction of their events, and the Fourier transform over the
/// directions has all harmonics at once. Cost: about 80 instructions an event, and 60 000.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn scan(
    angular: &mut AngularSums,
    track: &[PolarEvent],
    disc: Disc,
    line_hz: f32,
) -> Harmonics {
    angular.clear();
    let rate = TurnRate::from_rad_s(line_hz * TAU);
    let rings_a_px = RINGS as f32 / larger(disc.radius_px, 1.0);
    for event in track {
        // The innermost ring lies within a rotor's inner edge.
        let ring = (event.radius_px() * rings_a_px) as usize;
        let bank = 2 * (ring.clamp(1, RINGS - 1) - 1) + usize::from(event.is_on());
        angular.counts[bank] += 1;
        let sum = &mut angular.sums[bank][event.angle().sector(DIRECTIONS as u32) as usize];
        let (sin, cos) = rate.after(event.t_us).sin_cos();
        sum.re += cos;
        sum.im -= sin;
    }
    let mut shares = [0.0_f32; TERMS];
    for (sums, count) in angular.sums.iter_mut().zip(angular.counts) {
        let transform = microfft::complex::cfft_64(sums);
        for (term, share) in shares.iter_mut().enumerate() {
            // exp(i m theta), where the transform has exp(-i m theta).
            let Complex32 { re, im } = transform[(DIRECTIONS + MOST_HARMONIC - term) % DIRECTIONS];
            *share += quick_sqrt(larger(re * re + im * im - count as f32, 0.0));
        }
    }
    let total = larger(track.len() as f32, 1.0);
    for (term, share) in shares.iter_mut().enumerate() {
        // All that lies in one direction counts as its middle, which weakens harmonics by sin(x) / x: a tenth at most.
        let x = (term as f32 - MOST_HARMONIC as f32) * (0.5 * TAU / DIRECTIONS as f32);
        *share *= (1.0 + x * x * (1.0 / 6.0 + x * x * (7.0 / 360.0))) / total;
    }
    standing(&shares)
}

/// What the shares in step of all harmonics say.
fn standing(shares: &[f32; TERMS]) -> Harmonics {
    let harmonic = |term: usize| term as i32 - MOST_HARMONIC as i32;
    let mut found = Harmonics::default();
    for (term, share) in shares.iter().enumerate() {
        if *share > found.share {
            found.second_share = found.share;
            found.share = *share;
            found.best = harmonic(term);
        } else {
            found.second_share = larger(found.second_share, *share);
        }
    }
    found.still_share = shares[MOST_HARMONIC];
    found.mirror_share = shares[(MOST_HARMONIC as i32 - found.best) as usize];
    for (term, share) in shares.iter().enumerate() {
        if ![0, found.best, 2 * found.best].contains(&harmonic(term)) {
            found.rival_share = larger(found.rival_share, *share);
        }
    }
    found
}

/// A Newton step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Step {
    /// Change of the centre in pixels.
    pub dx_px: f32,
    /// Change of the centre in pixels.
    pub dy_px: f32,
    /// Change of the speed in rad/s.
    pub domega_rad_s: f32,
}

/// The change of centre and speed that brings the events closer into step.
#[must_use]
pub fn newton(
    track: &[PolarEvent],
    disc: Disc,
    omega_rad_s: f32,
    harmonic: u32,
    window_us: u32,
) -> Option<Step> {
    let pattern = Pattern::learn(track, disc, omega_rad_s, harmonic);
    let rate = TurnRate::from_rad_s(omega_rad_s);
    let m = harmonic as f32;
    let per_us = 1.0 / window_us.max(1) as f32;
    let turns = pattern.turns();
    // Sums of the levers of centre and time and of their products, without m and the radius; those with the sine.
    let (mut levers, mut products, mut right) = ([0.0_f32; 3], [0.0_f32; 6], [0.0_f32; 4]);
    let mut in_step = 0.0;
    for event in track {
        let (sin_psi, cos_psi) = ahead(*event, disc, rate, harmonic, &turns);
        let (sin, cos) = event.angle().sin_cos();
        let per_r = disc.radius_px / larger(event.radius_px(), 1.0);
        let (x, y, t) = (-sin * per_r, cos * per_r, event.t_us as f32 * per_us);
        levers[0] += x;
        levers[1] += y;
        levers[2] += t;
        let added = [x * x, x * y, x * t, y * y, y * t, t * t];
        products.iter_mut().zip(added).for_each(|(sum, product)| *sum += product);
        let added = [x * sin_psi, y * sin_psi, t * sin_psi, sin_psi];
        right.iter_mut().zip(added).for_each(|(sum, product)| *sum += product);
        in_step += cos_psi;
    }
    let count = track.len() as f32;
    let share = in_step / count.max(1.0);
    if share <= 0.0 {
        return None;
    }
    let ([x, y, t], [xx, xy, xt, yy, yt, tt]) = (levers, products);
    let normal = Matrix4::new(xx, xy, xt, x, xy, yy, yt, y, xt, yt, tt, t, x, y, t, count);
    let solved = (normal * (m * share)).cholesky()?.solve(&Vector4::from(right));
    Some(Step {
        dx_px: solved[0] * disc.radius_px,
        dy_px: solved[1] * disc.radius_px,
        domega_rad_s: solved[2] * per_us * 1e6,
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::speed::polar::Annulus;

    extern crate std;
    use std::vec::Vec;

    pub const DISC: Disc = Disc { x_px: 100.0, y_px: 100.0, radius_px: 40.0 };

    /// An event at a place beside the centre, if it lies in the annulus.
    pub fn seen_at(x_px: f32, y_px: f32, t_us: i32) -> Option<PolarEvent> {
        let mut event = PolarEvent::default();
        event.t_us = t_us;
        event.seen_from(-x_px, -y_px, &Annulus::of(DISC))
    }

    /// Events of a pattern of so many windings that keeps step with a frequency, every third of them anywhere.
    pub fn pattern(windings: i32, line_hz: f32) -> Vec<PolarEvent> {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let event = |index: i32| {
            let t_us = (150_000.0 * random()) as i32 - 75_000;
            let winding = (windings.unsigned_abs() as f32 * random()) as i32 as f32;
            let turns = line_hz * t_us as f32 * 1e-6 + winding + 0.1 * random();
            let turns = if index % 3 == 0 { random() } else { turns / windings as f32 };
            let (sin, cos) = Turn((turns.rem_euclid(1.0) * 4_294_967_296.0) as u32).sin_cos();
            let r_px = DISC.radius_px * (0.3 + 0.7 * random());
            seen_at(r_px * cos, r_px * sin, t_us)
        };
        (0..3_000).filter_map(event).collect()
    }

    #[test]
    fn the_winding_is_found_and_keeps_as_much_step_as_its_phases_do() {
        let line_hz = 120.0;
        for windings in (-16..=16).filter(|windings| *windings != 0) {
            let track = pattern(windings, line_hz);
            let mut angular = AngularSums::EMPTY;
            let found = scan(&mut angular, &track, DISC, line_hz);
            assert_eq!(found.best, windings, "{found:?}");
            let omega_rad_s = line_hz * TAU / windings as f32;
            let phases = Pattern::learn(&track, DISC, omega_rad_s, windings.unsigned_abs());
            let (share, _) = phases.coherence();
            assert!(share > 0.5 && (found.share - share).abs() < 0.01, "{share} {found:?}");
            assert!(found.rival_share < 0.15, "{found:?}");
        }
    }

    #[test]
    fn a_disc_reaches_as_far_as_what_keeps_step() {
        let track = pattern(3, 120.0);
        let reach = |radius_px| {
            let disc = Disc { radius_px, ..DISC };
            Pattern::learn(&track, disc, 120.0 * TAU / 3.0, 3).coherence().1
        };
        assert_eq!(reach(DISC.radius_px), 1.0);
        assert_eq!(reach(2.0 * DISC.radius_px), 0.5);
        // By the ring that the rim is in: never less than what turns.
        assert_eq!(reach(1.5 * DISC.radius_px), 0.75);
    }
}

//! Phase winding: the rotation that explains a coherence map.
//!
//! Under a rotor with speed w, the phase of a cell at the frequency f = m w / 2 pi is m times the cell's direction
//! as seen from the centre (plus a constant for each radius and polarity): going around the centre
//! once, the phase winds m times. The number of windings tells the speed from its multiples, its sign the
//! direction, and its centre is the axis, even where the light makes one side of the rotor brighter or part of it
//! lies outside the frame, so that the centroid is off. A flickering lamp winds zero times, a shaken
//! texture winds nowhere.

use heapless::Vec;

use super::coherence::Phasor;
use super::disc::Disc;
use crate::limits::WINDING_PHASORS;
use crate::math::sqrt;

/// Most windings that are tried: 8 blades seen at the second overtone.
const MOST_WINDINGS: usize = 16;
/// Rings between centre and rim, each with a phase of its own (swept blades), for each polarity.
const RINGS: usize = 4;
const BANKS: usize = 2 * RINGS;
/// First search: centres on a square of this many steps to each side.
const COARSE_STEPS: i32 = 3;
/// Spacing of the first search, as a share of the radius.
const COARSE_SPACING: f32 = 0.2;
/// Halvings of the spacing afterwards.
const HALVINGS: u8 = 3;

/// Phasors of one region, evenly thinned.
pub type Region = Vec<Phasor, WINDING_PHASORS>;

/// A rotation that explains a region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Winding {
    /// Axis of rotation in pixels.
    pub x_px: f32,
    /// Axis of rotation in pixels.
    pub y_px: f32,
    /// Windings of the phase around the axis: positive = clockwise on the screen, 0 = all in step.
    pub windings: i32,
    /// Share of the region's phasors that the rotation explains, 0 to 1.
    pub share: f32,
    /// The same share for zero windings about the same centre: all cells in step, as under a lamp.
    pub share_in_step: f32,
}

/// Collects the phasors for which `inside` holds, evenly thinned to the capacity; returns their number before that too.
pub fn collect(
    phasors: impl Iterator<Item = Phasor> + Clone,
    inside: impl Fn(&Phasor) -> bool,
) -> (Region, usize) {
    let mut region = Region::new();
    let total = phasors.clone().filter(&inside).count();
    let mut next = 0;
    for (index, phasor) in phasors.filter(&inside).enumerate() {
        if index * WINDING_PHASORS >= next {
            region.push(phasor).ok();
            next += total.max(WINDING_PHASORS);
        }
    }
    (region, total)
}

/// The axis and winding number that explain the region best, searched within 0.6 radius of the disc's centre.
/// Cost: about 300 instructions a phasor and centre, 80 centres.
#[must_use]
pub fn explain(region: &[Phasor], disc: Disc) -> Winding {
    let mut best = Winding::default();
    let mut spacing_px = COARSE_SPACING * disc.radius_px;
    let search = |from: (f32, f32), steps: i32, spacing_px: f32, best: &mut Winding| {
        for row in -steps..=steps {
            for column in -steps..=steps {
                let (x_px, y_px) =
                    (from.0 + column as f32 * spacing_px, from.1 + row as f32 * spacing_px);
                let found = about(region, x_px, y_px, disc.radius_px);
                if found.share > best.share {
                    *best = found;
                }
            }
        }
    };
    search((disc.x_px, disc.y_px), COARSE_STEPS, spacing_px, &mut best);
    for _ in 0..HALVINGS {
        spacing_px *= 0.5;
        search((best.x_px, best.y_px), 1, spacing_px, &mut best);
    }
    best
}

/// The winding number that explains the region best about a given axis.
fn about(region: &[Phasor], x_px: f32, y_px: f32, radius_px: f32) -> Winding {
    const TERMS: usize = 2 * MOST_WINDINGS + 1;
    let mut sums = [[(0.0_f32, 0.0_f32); TERMS]; BANKS];
    let mut weights = [(0.0_f32, 0.0_f32); BANKS];
    for phasor in region {
        let (dx, dy) = (phasor.x_px - x_px, phasor.y_px - y_px);
        let r = sqrt(dx * dx + dy * dy);
        if r < 1.0 {
            continue;
        }
        let ring = ((r / radius_px.max(1.0) * RINGS as f32) as usize).min(RINGS - 1);
        let bank = 2 * ring + usize::from(phasor.on);
        weights[bank].0 += phasor.amplitude;
        weights[bank].1 += phasor.amplitude * phasor.amplitude;
        // Normalised to the amplitude, so that chance does not count.
        let norm = phasor.amplitude / sqrt(phasor.re * phasor.re + phasor.im * phasor.im);
        let (re, im) = (phasor.re * norm, phasor.im * norm);
        let (cos, sin) = (dx / r, dy / r);
        let (mut c, mut s) = (1.0_f32, 0.0_f32);
        for m in 0..=MOST_WINDINGS {
            // z e^{i m theta} and z e^{-i m theta}
            let (rc, is, rs, ic) = (re * c, im * s, re * s, im * c);
            let plus = &mut sums[bank][MOST_WINDINGS + m];
            plus.0 += rc - is;
            plus.1 += rs + ic;
            if m > 0 {
                let minus = &mut sums[bank][MOST_WINDINGS - m];
                minus.0 += rc + is;
                minus.1 += ic - rs;
            }
            (c, s) = (c * cos - s * sin, s * cos + c * sin);
        }
    }
    // Without each phasor's square, so that a bank of one phasor explains nothing.
    let possible: f32 = weights.iter().map(|(sum, sum2)| sqrt((sum * sum - sum2).max(0.0))).sum();
    let mut found = Winding { x_px, y_px, ..Winding::default() };
    for term in 0..TERMS {
        let aligned: f32 = (0..BANKS)
            .map(|bank| {
                let (re, im) = sums[bank][term];
                sqrt((re * re + im * im - weights[bank].1).max(0.0))
            })
            .sum();
        let share = aligned / possible.max(1.0);
        if share > found.share {
            found.share = share;
            found.windings = term as i32 - MOST_WINDINGS as i32;
        }
        if term == MOST_WINDINGS {
            found.share_in_step = share;
        }
    }
    found
}

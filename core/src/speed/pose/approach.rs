//! A rotor that comes nearer, or goes away, as someone walks up to it or a hand sways along the line of sight.
//!
//! The picture of it grows. Where its blades are curved, whatever lies at a given distance from the axis then shows another place of
//! their edges, farther round: it seems to turn. Rings tell the same of both, as a spiral that grows is one that turns; only how far from
//! the axis its events lie tells them apart. So that is what the growth is measured by, and the sweep of the blades, by which it counts,
//! by the phases of the rings beside each other ([`super::template::Template::sweep`]).

use super::super::baseline::Estimate;
use super::{MOVING_PX_S, Pose};
use crate::math::{floor, larger, sqrt};

/// Sweep in radians for each factor of e in radius below which blades are straight: what grows shows no turn of theirs.
const STRAIGHT: f32 = 0.1;
/// Periods in each half from which on they are alike: in fewer, what a hand moves behind a slow rotor is not, and what seems to grow only
/// widens the bar.
const LEAST_PERIODS: f32 = 3.0;
/// Standard errors that growth stands out by.
const GROWING_SIGMAS: f32 = 3.0;
/// Focal length in pixels by which a hand's speed across the line of sight tells that along it: of a lens of a usual angle before a sensor of
/// some 346 pixels.
const FOCAL_PX: f32 = 400.0;
/// Standard error of the growth of what moves across the line of sight, over its way across in radii: its hub, its rim and what is behind it
/// show edges then that blades alone do not.
const ACROSS_SIGMA: f32 = 0.1;
/// Most of the way in pixels that a hand's speed tells: it goes to and fro.
const MOST_ACROSS_PX: f32 = 3.0;
/// Standard error of what growth seems to turn, as a share of it: what leaves the disc at its rim and comes into it at its hub makes growth
/// seem less, and a sweep may differ from ring to ring.
const APPROACH_SIGMA: f32 = 0.1;

/// Variance of an event's distance, relative: squares of distances that are spread evenly scatter by 0.58 of their mean, distances by half as
/// much. Of rotors that do not grow, 95 % are told less than two standard errors by it, whichever events are kept.
const EVENT_VARIANCE: f32 = 0.085;

/// How a rotor comes nearer or goes away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// What is to be added to the speed that its edges seem to turn with.
    pub speed: Estimate,
    /// By how much its radius grows in the window, over the radius.
    pub growth: f32,
}

impl Approach {
    /// It does not, or that shows no turn as its blades are straight.
    pub const NONE: Self =
        Self { speed: Estimate { omega_rad_s: 0.0, sigma_rad_s: 0.0 }, growth: 0.0 };
}

/// Squares of events' distances from the axis, in the same number of whole periods before and behind the window's middle: what differs from
/// place to place and from blade to blade is the same in both.
#[derive(Clone, Copy, Debug)]
pub struct Growth {
    /// Number and sum.
    halves: [[f32; 2]; 2],
}

impl Growth {
    /// No events.
    pub const EMPTY: Self = Self { halves: [[0.0; 2]; 2] };

    /// Adds an event of the half behind the middle or before it by the square of its distance in pixels.
    pub fn add(&mut self, behind: bool, square: f32) {
        let half = &mut self.halves[usize::from(behind)];
        half[0] += 1.0;
        half[1] += square;
    }

    /// Growth of the distances from one half to the other, over the distances, and its variance.
    fn half_to_half(&self) -> (f32, f32) {
        let [[a, before], [b, behind]] = self.halves;
        let (a, b) = (1.0 / larger(a, 1.0), 1.0 / larger(b, 1.0));
        let (before, behind) = (before * a, behind * b);
        // A square grows twice as fast.
        ((behind - before) / larger(before + behind, 1.0), EVENT_VARIANCE * (a + b))
    }
}

impl Pose {
    /// Length of each half in microseconds: whole periods, or 0 where there are too few, or blades are straight.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn halves_us(&self) -> f32 {
        let periods = floor(0.5 * self.window_us / self.period_us);
        if self.sweep.abs() > STRAIGHT { periods * self.period_us } else { 0.0 }
    }

    /// How the rotor comes nearer or goes away, by what the last round saw.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn approaches(&self, seen: &Growth) -> Approach {
        let apart_us = self.halves_us();
        if apart_us <= 0.0 {
            return Approach::NONE;
        }
        let apart_s = apart_us * 1e-6;
        let drift_px_s = self.drift_px_s();
        let across_px_s = if drift_px_s > MOVING_PX_S { drift_px_s } else { 0.0 };
        // What drifts too slowly to be called moving shows another background in one half than in the other all the same.
        let half_to_half_px = self.path.half_to_half_px();
        let to_and_fro_px = (across_px_s * apart_s).min(MOST_ACROSS_PX);
        let seeming = larger(to_and_fro_px, half_to_half_px) / self.disc.radius_px;
        // What drifts farther than a hand goes to and fro is likely to come nearer, or go away, as fast.
        let drifts = half_to_half_px > MOST_ACROSS_PX;
        let along_px_s = if drifts { half_to_half_px / apart_s } else { across_px_s };
        let usual = along_px_s / FOCAL_PX;
        let usual = usual * usual;
        let (growth, variance) = seen.half_to_half();
        let variance = variance + ACROSS_SIGMA * ACROSS_SIGMA * seeming * seeming;
        let (rate, variance) = (growth / apart_s, variance / (apart_s * apart_s));
        let unusual = rate * rate / (GROWING_SIGMAS * GROWING_SIGMAS * variance);
        let stands_out = unusual > 1.0;
        let few = apart_us < LEAST_PERIODS * self.period_us;
        let (taken, error) = if stands_out && !few && across_px_s <= 0.0 {
            (rate, sqrt(variance + APPROACH_SIGMA * APPROACH_SIGMA * rate * rate))
        } else {
            // What is not taken out counts as error: the more, the more it stands out, and as far as a hand is likely to make it. Taken out
            // there, what only seems to come nearer would be several times what speeds are off by.
            let likely = usual / (usual + variance);
            let share = if stands_out { 1.0 } else { larger(likely, unusual * unusual) };
            let error = share * rate;
            // Nor is it told that what drifts does not come nearer, where it does not seem to.
            (0.0, if drifts { sqrt(error * error + likely * variance) } else { error })
        };
        let sigma_rad_s = self.sweep.abs() * error.abs();
        let speed = Estimate { omega_rad_s: self.sweep * taken, sigma_rad_s };
        Approach { speed, growth: taken * self.window_us * 1e-6 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_how_much_farther_out_events_are_later() {
        for grown in [0.0_f32, 0.02, -0.05] {
            let mut growth = Growth::EMPTY;
            for k in 0..2000_u16 {
                let square = f32::from(k % 100);
                growth.add(false, square);
                growth.add(true, square * (1.0 + grown) * (1.0 + grown));
            }
            let (found, variance) = growth.half_to_half();
            assert!((found - grown).abs() < 0.03 * grown.abs() + 1e-5, "{grown}: {found}");
            assert!((sqrt(variance) - 0.0092).abs() < 0.001, "{variance}");
        }
        let (none, variance) = Growth::EMPTY.half_to_half();
        assert!(none == 0.0 && variance.is_finite() && variance > 0.0, "{variance}");
    }
}

//! What the pose says in the end: the speed and its change, and how the axis wanders.

use heapless::Vec;

use super::super::baseline::Estimate;
use super::super::path::Knot;
use super::super::statistics::student_over_normal;
use super::super::trend::{Point, Trend};
use super::{Pose, Sums};
use crate::limits::MAX_KNOTS;
use crate::math::{TAU, larger, sqrt};

/// Symmetry periods in the window from which on places in the period get offsets of their own.
const FOLDED_PERIODS: usize = 3;
/// Blocks over which the wandering of the axis is judged.
const DRIFT_BLOCKS: usize = 12;
/// No rotor turns by this share of a cycle of its harmonic beyond an even turn from a block to the next: the path has slipped to another
/// edge of the template. Blocks of the fewest events scatter by a tenth of a cycle.
const SLIP_CYCLES: f32 = 0.4;

/// The turn followed through the window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slope {
    /// Mean speed over the window.
    pub speed: Estimate,
    /// The same beyond the even turn that the path starts from.
    pub beyond_rad_s: f32,
    /// Standard deviation of the speed within the window, in rad/s: that of one swing a window.
    pub swing_rad_s: f32,
    /// Acceleration in rad/s^2.
    pub alpha_rad_s2: f32,
    /// Its standard error in rad/s^2.
    pub alpha_sigma_rad_s2: f32,
    /// Root mean square speed of the axis in px/s: 0 on a tripod, tens in the hand.
    pub drift_px_s: f32,
}

/// Whether the turn goes by `most_rad` beyond an even one from a block in step to the next.
fn slips(points: &[Point], most_rad: f32) -> bool {
    let seen = || points.iter().filter(|point| point.weight > 0.0);
    let (Some(first), Some(last)) = (seen().next(), seen().next_back()) else { return false };
    let even = (last.y - first.y) / larger(last.u - first.u, f32::MIN_POSITIVE);
    let off = |(a, b): (&Point, &Point)| (b.y - a.y - even * (b.u - a.u)).abs();
    seen().zip(seen().skip(1)).map(off).any(|off_rad| off_rad > most_rad)
}

impl Pose {
    /// The trend of the turn through the blocks, and how the axis wanders; `None` when too few blocks tell, or the path
    /// has slipped.
    pub(super) fn trend(&self, sums: &Sums) -> Option<Slope> {
        let count = self.path.blocks();
        let periods = count / self.in_period.max(1);
        let half_us = 0.5 * self.window_us;
        let mut points = Vec::<Point, MAX_KNOTS>::new();
        for block in sums.blocks.iter().take(count) {
            let t_us = block.middle_us();
            let (off_rad, weight) = block.turn_rad(self.harmonic as f32).unwrap_or_default();
            let y = self.path.at(t_us).turn_rad + off_rad;
            points.push(Point { u: t_us / half_us, y, weight }).ok();
        }
        if slips(&points, SLIP_CYCLES * TAU / self.harmonic as f32) {
            return None;
        }
        // Blocks a period apart see the same pixels, unless the axis wanders: what tells more exactly.
        let folded = periods >= FOLDED_PERIODS && self.in_period > 1;
        let trend = [1, self.in_period]
            .into_iter()
            .take(1 + usize::from(folded))
            .filter_map(|fold| Trend::fit(&points, fold))
            .min_by(|a, b| a.slope_error.total_cmp(&b.slope_error))?;
        let factor = student_over_normal(trend.degrees_of_freedom);
        let half_s = half_us * 1e-6;
        Some(Slope {
            speed: Estimate {
                omega_rad_s: self.omega_rad_s + trend.slope / half_s,
                sigma_rad_s: factor * trend.slope_error / half_s,
            },
            beyond_rad_s: trend.slope / half_s,
            swing_rad_s: 0.5 * TAU / half_s * sqrt(trend.bent),
            alpha_rad_s2: trend.bend / (half_s * half_s),
            alpha_sigma_rad_s2: factor * trend.bend_error / (half_s * half_s),
            drift_px_s: self.drift_px_s(),
        })
    }

    /// Root mean square speed of the axis along the path, in px/s.
    pub(super) fn drift_px_s(&self) -> f32 {
        let size = self.path.blocks().div_ceil(DRIFT_BLOCKS).max(1);
        let dt_s = size as f32 * self.path.step_us() * 1e-6;
        let mean = |knots: &[Knot]| {
            let n = knots.len() as f32;
            let sum = |part: fn(&Knot) -> f32| knots.iter().map(part).sum::<f32>() / n;
            (sum(|knot| knot.x_px), sum(|knot| knot.y_px))
        };
        let (mut squares, mut count, mut before) = (0.0, 0_u8, None);
        for knots in self.path.knots().chunks_exact(size) {
            let here = mean(knots);
            if let Some((x, y)) = before {
                let (vx, vy) = ((here.0 - x) / dt_s, (here.1 - y) / dt_s);
                squares += vx * vx + vy * vy;
                count += 1;
            }
            before = Some(here);
        }
        sqrt(squares / f32::from(count.max(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns of 40 blocks, every fifth not in step: `jump_rad` in the middle, and a scatter of a tenth of a cycle of the
    /// harmonic 12 about a speed that changes.
    fn points(jump_rad: f32) -> Vec<Point, MAX_KNOTS> {
        (0..40_usize)
            .map(|i| {
                let u = (i as f32 - 19.5) / 20.0;
                let scatter = 0.05 * ((i * 7 % 11) as f32 - 5.0) / 5.0;
                let y = 0.8 * u + 0.1 * u * u + scatter + if i < 20 { 0.0 } else { jump_rad };
                Point { u, y, weight: if i % 5 == 0 { 0.0 } else { 50.0 } }
            })
            .collect()
    }

    #[test]
    fn a_turn_by_a_cycle_of_the_harmonic_is_a_slip() {
        let cycle_rad = TAU / 12.0;
        for jump_rad in [cycle_rad, -cycle_rad] {
            assert!(slips(&points(jump_rad), SLIP_CYCLES * cycle_rad));
        }
        assert!(!slips(&points(0.0), SLIP_CYCLES * cycle_rad));
        assert!(!slips(&[], SLIP_CYCLES * cycle_rad));
    }
}

//! What the pose says in the end: the speed and its change, and how the axis wanders.

use heapless::Vec;

use super::super::baseline::Estimate;
use super::super::path::Knot;
use super::super::statistics::student_over_normal;
use super::super::trend::{Point, Trend};
use super::{Pose, Sums};
use crate::limits::MAX_KNOTS;
use crate::math::sqrt;

/// Symmetry periods in the window from which on places in the period get offsets of their own.
const FOLDED_PERIODS: usize = 3;
/// Blocks over which the wandering of the axis is judged.
const DRIFT_BLOCKS: usize = 12;

/// The turn followed through the window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slope {
    /// Mean speed over the window.
    pub speed: Estimate,
    /// Acceleration in rad/s^2.
    pub alpha_rad_s2: f32,
    /// Its standard error in rad/s^2.
    pub alpha_sigma_rad_s2: f32,
    /// Root mean square speed of the axis in px/s: 0 on a tripod, tens in the hand.
    pub drift_px_s: f32,
}

impl Pose {
    /// The trend of the turn through the blocks, and how the axis wanders; `None` when too few blocks tell.
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
            alpha_rad_s2: trend.bend / (half_s * half_s),
            alpha_sigma_rad_s2: factor * trend.bend_error / (half_s * half_s),
            drift_px_s: self.drift_px_s(),
        })
    }

    fn drift_px_s(&self) -> f32 {
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

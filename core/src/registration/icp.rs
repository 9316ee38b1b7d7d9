//! Iterative closest point between two slices of a rotor.

use super::grid::{Grid, Metric};
use super::rigid::{PointToHelicoid, PointToPoint, Rigid};
use super::slice::{Slice, SlicePoint};
use crate::math::sqrt;

/// Iterations in one direction.
const MOST_ITERATIONS: u8 = 10;
/// Registration ends when an iteration turns by less than this. Absolute: the paper's ratio to the accumulated
/// yaw stops early at large angles (a bias of up to 0.8 permille) and never at small ones.
const SETTLED_RAD: f32 = 1e-4;
/// Fewest matches that determine a yaw.
const LEAST_MATCHES: usize = 12;
/// Matches farther than this in pixels are not used.
const REACH_PX: f32 = 12.0;
/// Half the side of the neighbour grid in radii of the rotor.
const REACH_RADII: f32 = 1.2;
/// Residuals beyond this many root mean squares of the iteration before are not used.
const TRIM: f32 = 2.5;

/// What is minimised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Residual {
    /// Positions only, turning about the centre: needs no idea of the speed (initial alignment, thin slices).
    FixedAxis,
    /// Positions only, yaw and shift free: needs no idea of the centre either.
    FreeAxis,
    /// Distance along the motion at this speed in rad/s, with time as third coordinate (refinement and lock).
    Helicoid {
        /// Speed to a few percent, positive = clockwise.
        omega_rad_s: f32,
    },
}

/// Result of a registration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registered {
    /// Yaw that carries the first slice onto the second, in radians, positive = clockwise.
    pub yaw_rad: f32,
    /// Share of the points that found a match.
    pub matched: f32,
}

/// Memory of a registration: two slices and a grid.
#[derive(Debug, Default)]
pub struct Icp {
    /// The earlier slice.
    pub first: Slice,
    /// The later slice.
    pub second: Slice,
    grid: Grid,
}

impl Icp {
    /// Registers both ways and averages, so that the bias of matching a sparse slice to a dense one cancels.
    ///
    /// `start_rad` is the yaw to start from, `radius_px` the rotor's radius.
    /// Cost: about 300 instructions a point and iteration, 10 to 20 iterations in all.
    pub fn both_ways(
        &mut self,
        start_rad: f32,
        radius_px: f32,
        residual: Residual,
    ) -> Option<Registered> {
        let there = self.there(start_rad, radius_px, residual)?;
        self.back(there, start_rad, radius_px, residual)
    }

    /// The first half of [`Self::both_ways`]: the first slice onto the second.
    pub fn there(
        &mut self,
        start_rad: f32,
        radius_px: f32,
        residual: Residual,
    ) -> Option<Registered> {
        self.grid.build(&self.second, REACH_RADII * radius_px);
        one_way(&self.first, &self.second, &self.grid, start_rad, radius_px, residual)
    }

    /// The second half of [`Self::both_ways`]: the second slice onto the first, averaged with the first half.
    pub fn back(
        &mut self,
        there: Registered,
        start_rad: f32,
        radius_px: f32,
        residual: Residual,
    ) -> Option<Registered> {
        self.grid.build(&self.first, REACH_RADII * radius_px);
        let back = one_way(&self.second, &self.first, &self.grid, -start_rad, radius_px, residual)?;
        Some(Registered {
            yaw_rad: 0.5 * (there.yaw_rad - back.yaw_rad),
            matched: 0.5 * (there.matched + back.matched),
        })
    }
}

fn one_way(
    source: &[SlicePoint],
    target: &[SlicePoint],
    grid: &Grid,
    start_rad: f32,
    radius_px: f32,
    residual: Residual,
) -> Option<Registered> {
    let lambda_px_per_s = match residual {
        Residual::FixedAxis | Residual::FreeAxis => 0.0,
        // Twice the mean speed of the points: flat optimum between one and four times.
        Residual::Helicoid { omega_rad_s } => 1.4 * radius_px * omega_rad_s.abs(),
    };
    let metric = Metric { lambda_px_per_s, reach_px: REACH_PX, same_polarity: true };
    let mut rigid = Rigid::yaw(start_rad);
    // The yaw is summed besides, as it may pass pi.
    let mut yaw_rad = start_rad;
    let mut limit_px = f32::MAX;
    let mut matched = 0.0;
    for _ in 0..MOST_ITERATIONS {
        let mut point = PointToPoint::default();
        let mut helicoid = PointToHelicoid::default();
        let (mut matches, mut found, mut squares) = (0, 0, 0.0_f32);
        for from in source {
            let (x_px, y_px) = rigid.apply(from.x_px, from.y_px);
            let query = SlicePoint { x_px, y_px, ..*from };
            let Some((index, distance2)) = grid.nearest(target, query, &metric) else { continue };
            let to = &target[index];
            found += 1;
            match residual {
                Residual::FixedAxis | Residual::FreeAxis => {
                    squares += distance2;
                    if distance2 <= limit_px * limit_px {
                        point.add((x_px, y_px), (to.x_px, to.y_px));
                        matches += 1;
                    }
                }
                Residual::Helicoid { omega_rad_s } => {
                    let r = sqrt(x_px * x_px + y_px * y_px).max(1.0);
                    let u = (-y_px / r, x_px / r);
                    let along = (to.x_px - x_px) * u.0 + (to.y_px - y_px) * u.1
                        - r * omega_rad_s * (to.tau_s - from.tau_s);
                    squares += along * along;
                    if along.abs() <= limit_px {
                        helicoid.add(u, r, along);
                        matches += 1;
                    }
                }
            }
        }
        if matches < LEAST_MATCHES {
            return None;
        }
        limit_px = TRIM * sqrt(squares / found as f32);
        matched = matches as f32 / source.len() as f32;
        let (turn_rad, shift_px) = match residual {
            Residual::FixedAxis => (point.about_origin()?, (0.0, 0.0)),
            Residual::FreeAxis => point.solve()?,
            Residual::Helicoid { .. } => helicoid.solve()?,
        };
        rigid = rigid.then(turn_rad, shift_px);
        yaw_rad += turn_rad;
        if turn_rad.abs() < SETTLED_RAD {
            break;
        }
    }
    Some(Registered { yaw_rad, matched })
}

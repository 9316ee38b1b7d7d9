//! Iterative closest point between two slices of a rotor.

use super::grid::{Grid, Metric};
use super::rigid::{PointToHelicoid, PointToPoint, Rigid};
use super::slice::{Slice, SlicePoint};
use crate::math::{larger, quick_sqrt, sqrt};
use crate::rotors::Disc;

/// Iterations in one direction.
const MOST_ITERATIONS: u8 = 10;
/// A way ends when an iteration turns by less than this. Absolute: the paper's ratio to the accumulated yaw stops early
/// at large angles (a bias of up to 0.8 permille) and never at small ones.
const SETTLED_RAD: f32 = 1e-4;
/// Fewest matches that determine a yaw.
const LEAST_MATCHES: usize = 12;
/// Matches farther than this in pixels are not used: of places only, and of places and times.
const REACH_PX: f32 = 12.0;
const HELICOID_REACH_PX: f32 = 8.0;
/// How a second counts, in speeds of the rim: flat optimum from 0.7, the mean speed of the points, to four times that.
const LAMBDA: f32 = 1.0;
/// Half the side of the neighbour grid in radii of the rotor.
const REACH_RADII: f32 = 1.2;
/// Residuals beyond this many root mean squares of the iteration before are not used.
const TRIM: f32 = 2.5;

/// What is minimised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Residual {
    /// Positions only, turning about the centre: needs no idea of the speed (initial alignment, thin slices).
    FixedAxis,
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
#[derive(Debug)]
pub struct Icp {
    /// The earlier slice.
    pub first: Slice,
    /// The later slice.
    pub second: Slice,
    grid: Grid,
    run: Run,
}

/// A registration in progress.
#[derive(Clone, Copy, Debug)]
struct Run {
    radius_px: f32,
    residual: Residual,
    settled: f32,
    /// Result of the first half, the first slice onto the second; then the second half runs.
    there: Option<Registered>,
    rigid: Rigid,
    /// The yaw is summed besides, as it may pass pi.
    yaw_rad: f32,
    limit_px: f32,
    iterations: u8,
}

/// What a step of a registration left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// More steps to come.
    Running,
    /// Settled, or `None` when too little matched.
    Done(Option<Registered>),
}

impl Run {
    /// All zeros, so that the flash holds no copy of them and of the memory around.
    const EMPTY: Self = Self {
        radius_px: 0.0,
        residual: Residual::FixedAxis,
        settled: 0.0,
        there: None,
        rigid: Rigid::UNSET,
        yaw_rad: 0.0,
        limit_px: 0.0,
        iterations: 0,
    };
}

impl Icp {
    /// Nothing to register. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self =
        Self { first: Slice::new(), second: Slice::new(), grid: Grid::EMPTY, run: Run::EMPTY };

    /// Starts to register [`Icp::first`] onto [`Icp::second`] and back: the average of both ways cancels the bias of
    /// matching a sparse slice to a dense one.
    ///
    /// `start_rad` is the yaw to start from, `radius_px` the rotor's radius. A way also ends when an iteration turns by
    /// less than `settled` of what the scatter of the matches leaves the yaw uncertain by.
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn start(&mut self, start_rad: f32, radius_px: f32, residual: Residual, settled: f32) {
        self.run = Run { radius_px, residual, settled, ..Run::EMPTY };
        self.start_half(start_rad);
    }

    // Nor this.
    #[inline(never)]
    fn start_half(&mut self, yaw_rad: f32) {
        let target = if self.run.there.is_none() { &self.second } else { &self.first };
        let metric = match self.run.residual {
            Residual::FixedAxis => Metric { lambda_px_per_s: 0.0, reach_px: REACH_PX },
            Residual::Helicoid { omega_rad_s } => Metric {
                lambda_px_per_s: LAMBDA * self.run.radius_px * omega_rad_s.abs(),
                reach_px: HELICOID_REACH_PX,
            },
        };
        self.grid.build(target, REACH_RADII * self.run.radius_px, metric);
        self.run.rigid = Rigid::yaw(yaw_rad);
        self.run.yaw_rad = yaw_rad;
        self.run.limit_px = f32::MAX;
        self.run.iterations = 0;
    }

    /// One iteration. Cost: about 400 instructions a point; 5 to 15 iterations in all.
    pub fn step(&mut self) -> Progress {
        let back = self.run.there.is_some();
        let (source, target) =
            if back { (&self.second, &self.first) } else { (&self.first, &self.second) };
        let Some((turn_rad, matches)) = iterate(&mut self.run, source, target, &self.grid) else {
            return Progress::Done(None);
        };
        let matched = matches as f32 / source.len() as f32;
        let run = &mut self.run;
        run.iterations += 1;
        let scatter_px = run.limit_px / TRIM;
        let noise_rad =
            scatter_px / (Disc::MEAN_RADIUS * run.radius_px * quick_sqrt(matches as f32));
        let settled = turn_rad.abs() < (run.settled * noise_rad).max(SETTLED_RAD);
        if !settled && self.run.iterations < MOST_ITERATIONS {
            return Progress::Running;
        }
        let here = Registered { yaw_rad: self.run.yaw_rad, matched };
        let Some(there) = self.run.there else {
            self.run.there = Some(here);
            // From where the way there ended: few iterations are left, and stopping short there is made up for.
            self.start_half(-here.yaw_rad);
            return Progress::Running;
        };
        Progress::Done(Some(Registered {
            yaw_rad: 0.5 * (there.yaw_rad - here.yaw_rad),
            matched: 0.5 * (there.matched + here.matched),
        }))
    }
}

/// Matches the source to the target once and turns it; the turn in radians and the number of matches.
fn iterate(
    run: &mut Run,
    source: &[SlicePoint],
    target: &[SlicePoint],
    grid: &Grid,
) -> Option<(f32, usize)> {
    let mut point = PointToPoint::default();
    let mut helicoid = PointToHelicoid::default();
    let (mut matches, mut found, mut squares) = (0, 0, 0.0_f32);
    for from in source {
        let (x_px, y_px) = run.rigid.apply(from.x_px, from.y_px);
        let query = SlicePoint { x_px, y_px, ..*from };
        let Some((index, distance2)) = grid.nearest(query) else { continue };
        let Some(to) = target.get(index) else { continue };
        found += 1;
        match run.residual {
            Residual::FixedAxis => {
                squares += distance2;
                if distance2 <= run.limit_px * run.limit_px {
                    point.add((x_px, y_px), (to.x_px, to.y_px));
                    matches += 1;
                }
            }
            Residual::Helicoid { omega_rad_s } => {
                let r = larger(quick_sqrt(x_px * x_px + y_px * y_px), 1.0);
                let per_px = 1.0 / r;
                let u = (-y_px * per_px, x_px * per_px);
                let along = (to.x_px - x_px) * u.0 + (to.y_px - y_px) * u.1
                    - r * omega_rad_s * (to.tau_s - from.tau_s);
                squares += along * along;
                if along.abs() <= run.limit_px {
                    helicoid.add(u, r, along);
                    matches += 1;
                }
            }
        }
    }
    if matches < LEAST_MATCHES {
        return None;
    }
    run.limit_px = TRIM * sqrt(squares / found as f32);
    let (turn_rad, shift_px) = match run.residual {
        Residual::FixedAxis => (point.solve()?, (0.0, 0.0)),
        Residual::Helicoid { .. } => helicoid.solve()?,
    };
    run.rigid = run.rigid.then(turn_rad, shift_px);
    run.yaw_rad += turn_rad;
    Some((turn_rad, matches))
}

//! What the blocks of a window say about the path, and the path that suits them.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use super::super::path::{Knot, Path};
use crate::limits::MAX_KNOTS;

/// Fewest events in a block that counts.
const LEAST_IN_BLOCK: u32 = 16;
/// Share of a block's events in step, over that of all, below which the block is not believed, and the least.
pub const BLOCK_SHARE: f32 = 0.4;
pub const LEAST_SHARE: f32 = 0.05;
/// How far the axis is thought to be off the path, in pixels: keeps the shift of a block finite where its events lie to
/// one side of the axis.
const SHIFT_PRIOR_PX: f32 = 2.0;
/// How far the path walks from knot to knot.
pub const WALK_PX: f32 = 0.5;
/// The same for a rotor with a single mark, whose shift and turn look alike.
pub const WALK_SINGLE_PX: f32 = 0.05;
const WALK_RAD: f32 = 0.02;
/// Farthest that a knot is moved at once.
const STRIDE_PX: f32 = 3.0;

/// Sums over the events of a block.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Sums of the products of m, -l sin and l cos, with m the harmonic and l = m / r.
    normal: [f32; 6],
    right: Vector3<f32>,
    /// The same, each event by how far through the block it lies.
    later: Vector3<f32>,
    in_step: f32,
    time_us: f32,
    count: u32,
}

impl Block {
    /// Mean time of the events since the middle of the window.
    pub fn middle_us(&self) -> f32 {
        self.time_us / (self.count as f32).max(1.0)
    }

    /// Share of the events in step.
    pub fn share(&self) -> f32 {
        self.in_step / (self.count as f32).max(1.0)
    }

    /// No events.
    pub const EMPTY: Self = Self {
        normal: [0.0; 6],
        right: Vector3::new(0.0, 0.0, 0.0),
        later: Vector3::new(0.0, 0.0, 0.0),
        in_step: 0.0,
        time_us: 0.0,
        count: 0,
    };

    /// Adds an event: its levers on phase by turn and shift, its phase off the template, and when it came.
    pub fn add(&mut self, a: Vector3<f32>, (sin_psi, cos_psi): (f32, f32), (t_us, f): (f32, f32)) {
        let products = [a.x * a.x, a.x * a.y, a.x * a.z, a.y * a.y, a.y * a.z, a.z * a.z];
        self.normal.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        self.right += a * sin_psi;
        self.later += a * (sin_psi * f);
        self.in_step += cos_psi;
        self.time_us += t_us;
        self.count += 1;
    }

    fn normal(&self) -> Matrix3<f32> {
        let [a, b, c, d, e, f] = self.normal;
        Matrix3::new(a, b, c, b, d, e, c, e, f)
    }

    /// What the block knows about turn and shift.
    fn weight(&self) -> Matrix3<f32> {
        self.normal() * self.share()
    }

    /// Turn in radians by which the block as a whole is off, and its weight.
    pub fn turn_rad(&self) -> Option<(f32, f32)> {
        if self.count < LEAST_IN_BLOCK {
            return None;
        }
        let share = self.share();
        // Events scatter by about 1 / (2 share) in phase squared, which gives the prior its weight.
        let prior = 1.0 / (2.0 * share * SHIFT_PRIOR_PX * SHIFT_PRIOR_PX);
        let damped =
            self.normal() * share + Matrix3::from_diagonal(&Vector3::new(0.0, prior, prior));
        let off_rad = damped.cholesky()?.solve(&self.right)[0];
        off_rad.is_finite().then_some((off_rad, self.count as f32))
    }
}

/// How a path is corrected.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    /// How far the axis walks from knot to knot, in pixels.
    pub step_px: f32,
    /// Share of all events in step.
    pub coherence: f32,
    /// Angular harmonic that the blocks were looked at by.
    pub harmonic: u32,
}

/// Moves the knots to where the blocks want them: least squares with a path that walks rather than jumps, a
/// tridiagonal system of 3 x 3 matrices, solved from end to end.
pub fn correct(path: &mut Path, blocks: &[Block; MAX_KNOTS], walk: Walk) {
    let blocks = &blocks[..path.blocks()];
    let knots = path.knots_mut();
    let scatter = 1.0 / (2.0 * walk.coherence.max(LEAST_SHARE));
    let (px, rad) = (scatter / (walk.step_px * walk.step_px), scatter / (WALK_RAD * WALK_RAD));
    let stiff = Matrix3::from_diagonal(&Vector3::new(rad, px, px));
    let step = |k: usize| -> Option<Vector3<f32>> {
        let (a, b) = (knots.get(k)?, knots.get(k + 1)?);
        Some(Vector3::new(b.turn_rad - a.turn_rad, b.x_px - a.x_px, b.y_px - a.y_px))
    };
    // Events are spread evenly within a block: a third of their weight goes to either knot, a sixth between.
    let link = |block: &Block| block.weight() / 6.0 - stiff;
    let mut inverses = Vec::<Matrix3<f32>, MAX_KNOTS>::new();
    let mut sides = Vec::<Vector3<f32>, MAX_KNOTS>::new();
    for k in 0..knots.len() {
        let mut pivot = Matrix3::identity() * 1e-3;
        let mut side = Vector3::zeros();
        if let (Some(block), Some(step)) = (blocks.get(k), step(k)) {
            pivot += block.weight() / 3.0 + stiff;
            side += block.right - block.later + stiff * step;
        }
        let before = k
            .checked_sub(1)
            .and_then(|i| Some((blocks.get(i)?, step(i)?, inverses.get(i)?, sides.get(i)?)));
        if let Some((block, step, inverse, before)) = before {
            let link = link(block);
            pivot += block.weight() / 3.0 + stiff - link * inverse * link;
            side += block.later - stiff * step - link * (inverse * before);
        }
        let Some(inverse) = pivot.try_inverse() else { return };
        inverses.push(inverse).ok();
        sides.push(side).ok();
    }
    let reach_rad = 1.0 / walk.harmonic as f32;
    let within = |value: f32, reach: f32| value.max(-reach).min(reach);
    let mut off = Vector3::zeros();
    for (k, knot) in knots.iter_mut().enumerate().rev() {
        let (Some(inverse), Some(side)) = (inverses.get(k), sides.get(k)) else { return };
        off = inverse * blocks.get(k).map_or(*side, |block| side - link(block) * off);
        if !off.iter().all(|value| value.is_finite()) {
            return;
        }
        *knot = Knot {
            x_px: knot.x_px + within(off[1], STRIDE_PX),
            y_px: knot.y_px + within(off[2], STRIDE_PX),
            turn_rad: knot.turn_rad + within(off[0], reach_rad),
        };
    }
}

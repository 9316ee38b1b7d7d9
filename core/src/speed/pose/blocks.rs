//! What the blocks of a window say about the path, and the path that suits them.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use super::super::path::{Knot, Path};
use crate::limits::MAX_KNOTS;

/// Fewest events in a block that counts.
const LEAST_IN_BLOCK: f32 = 8.0;
/// Share of a block's events in step, over that of all, below which the block is not believed, and the least.
pub const BLOCK_SHARE: f32 = 0.4;
pub const LEAST_SHARE: f32 = 0.05;
/// How far the axis is thought to be off the path, in pixels: keeps the shift of a block finite where its events lie to
/// one side of the axis.
const SHIFT_PRIOR_PX: f32 = 2.0;
/// How far the path walks from knot to knot that are so far apart, or nearer.
pub const WALK_US: f32 = 5_000.0;
/// Farther apart, it walks as much farther, up to these factors: in the first rounds, and in the fine ones.
pub const MOST_WALK: f32 = 6.0;
pub const MOST_FINE_WALK: f32 = 1.5;
pub const WALK_PX: f32 = 0.5;
/// The same for a rotor with two blades, which hardly show a shift along them: path and template drift there together.
pub const WALK_TWO_PX: f32 = 0.1;
/// The same for a rotor with a single mark, whose shift and turn look alike.
pub const WALK_SINGLE_PX: f32 = 0.05;
/// The same for one at rest: together its knots still go to where it is.
pub const STILL_WALK_PX: f32 = 0.003;
/// Turn beyond an even one from knot to knot, in rad/s: what a hand rolls, and as a share of the speed, what a motor hunts.
const WALK_RAD_S: f32 = 0.2;
const WALK_SHARE: f32 = 0.01;
/// How much farther a drift goes than blocks that know little of it would move it, at most.
const MOST_FREED: f32 = 10.0;
/// Farthest that a knot is moved at once.
const STRIDE_PX: f32 = 3.0;

/// What an event says to its block.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub block: usize,
    /// How its direction changes with a shift: -sin / r and cos / r.
    pub x: f32,
    pub y: f32,
    /// Its phase off the template.
    pub sin_psi: f32,
    pub cos_psi: f32,
    /// How far through the block it lies.
    pub f: f32,
    /// What it weighs, which its phase holds already.
    pub weight: f32,
}

/// Events that are added at once.
pub const SEEN_AT_ONCE: usize = 32;

/// Adds events to their blocks, and forgets them.
// Apart from where they are looked at, where registers are scarce: here a block's sums stay in them from event to event.
#[inline(never)]
pub fn add(blocks: &mut [Block], seen: &mut Vec<Seen, SEEN_AT_ONCE>) {
    for alike in seen.chunk_by(|a, b| a.block == b.block) {
        if let Some(block) = alike.first().and_then(|first| blocks.get_mut(first.block)) {
            let mut sums = *block;
            alike.iter().for_each(|seen| sums.add(seen));
            *block = sums;
        }
    }
    seen.clear();
}

/// Sums over the events of a block. An event's phase changes with turn and shift by m (1, -sin / r, cos / r), with m the
/// harmonic; m is left out of the sums.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    count: f32,
    /// Sums of -sin / r and cos / r, and of their products.
    levers: [f32; 2],
    products: [f32; 3],
    /// Sums of the levers times the sine of the phase that the event is off.
    right: [f32; 3],
    /// The same, each event by how far through the block it lies.
    later: [f32; 3],
    in_step: f32,
    /// Sums of how far through the block the events lie, and of its square.
    way: [f32; 2],
}

impl Block {
    /// How far through the block its events lie on average.
    pub fn way(&self) -> f32 {
        self.way[0] / self.count.max(1.0)
    }

    /// Number of events.
    pub const fn count(&self) -> f32 {
        self.count
    }

    /// Share of the events in step.
    pub fn share(&self) -> f32 {
        self.in_step / self.count.max(1.0)
    }

    /// No events.
    pub const EMPTY: Self = Self {
        count: 0.0,
        levers: [0.0; 2],
        products: [0.0; 3],
        right: [0.0; 3],
        later: [0.0; 3],
        in_step: 0.0,
        way: [0.0; 2],
    };

    #[inline]
    fn add(&mut self, seen: &Seen) {
        let &Seen { x, y, sin_psi, cos_psi, f, weight, .. } = seen;
        let (wx, wy) = (weight * x, weight * y);
        let (x_psi, y_psi, late) = (x * sin_psi, y * sin_psi, f * sin_psi);
        self.count += weight;
        self.levers[0] += wx;
        self.levers[1] += wy;
        self.products[0] += wx * x;
        self.products[1] += wx * y;
        self.products[2] += wy * y;
        self.right[0] += sin_psi;
        self.right[1] += x_psi;
        self.right[2] += y_psi;
        self.later[0] += late;
        self.later[1] += x * late;
        self.later[2] += y * late;
        self.in_step += cos_psi;
        let way = weight * f;
        self.way[0] += way;
        self.way[1] += way * f;
    }

    /// What the block knows about turn and shift.
    fn weight(&self, m: f32) -> Matrix3<f32> {
        let ([x, y], [xx, xy, yy]) = (self.levers, self.products);
        Matrix3::new(self.count, x, y, x, xx, xy, y, xy, yy) * (self.share() * m * m)
    }

    /// Shares of the block's weight in the knot before it, between, and in the knot behind it: bursts of events lie anywhere.
    fn shares(&self) -> (f32, f32, f32) {
        let (way, square) = (self.way(), self.way[1] / self.count.max(1.0));
        (1.0 - 2.0 * way + square, way - square, square)
    }

    /// Turn in radians by which the block as a whole is off at harmonic `m`, and what it knows of that whatever the shift:
    /// as many events in step as would know as much if the shift were known.
    pub fn turn_rad(&self, m: f32) -> Option<(f32, f32)> {
        if self.count < LEAST_IN_BLOCK {
            return None;
        }
        // Events scatter by about 1 / (2 share) in phase squared, which gives the prior its weight.
        let prior = 1.0 / (2.0 * self.share() * SHIFT_PRIOR_PX * SHIFT_PRIOR_PX);
        let damped = self.weight(m) + Matrix3::from_diagonal(&Vector3::new(0.0, prior, prior));
        let turn = damped.cholesky()?.solve(&Vector3::x());
        let off_rad = turn.dot(&Vector3::from(self.right)) * m;
        let weight = 1.0 / (turn[0] * m * m);
        (off_rad.is_finite() && weight.is_finite()).then_some((off_rad, weight))
    }
}

/// Blocks one behind another that chance leaves out of step: in random scenes of steady rotors.
const LEAST_LAPSE: usize = 2;
/// Mean share in step of so many blocks, over that below which one is not believed, from which down there is no rotor in them.
const DEEP: f32 = 0.6;
/// A lapse so deep lasts for a symmetry period, and for this part of the window.
const DEEP_ONE_OF: usize = 8;

/// Whether the rotor was out of step for longer than a symmetry period of so many blocks and than chance makes, as it stood still meanwhile or
/// turned with another speed: blocks one behind another with less than a share in step, or some that hold no rotor on average where each
/// may be in step by chance. All blocks count alike, as they last alike: with the device's memory some have ten times the events of others.
pub fn lapsed(blocks: &[Block], least: f32, in_period: usize) -> bool {
    let together = in_period.max(blocks.len() / DEEP_ONE_OF).max(LEAST_LAPSE);
    let (mut run, mut longest, mut deep) = (0, 0, false);
    let mut shares = 0.0;
    for (index, block) in blocks.iter().enumerate() {
        run = if block.share() < least { run + 1 } else { 0 };
        longest = longest.max(run);
        shares += block.share();
        if let Some(gone) = index.checked_sub(together).and_then(|gone| blocks.get(gone)) {
            shares -= gone.share();
        }
        deep |= index + 1 >= together && shares < DEEP * least * together as f32;
    }
    deep || longest > in_period.max(LEAST_LAPSE)
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
    /// The rotor's radius.
    pub radius_px: f32,
    /// Its speed in rad/s.
    pub omega_rad_s: f32,
    /// Whether the axis may drift as far as it likes, as long as it does so evenly.
    pub drifts: bool,
}

/// A product.
// Not inlined, as it is taken twice: flash is short.
#[inline(never)]
fn times(a: &Matrix3<f32>, b: &Matrix3<f32>) -> Matrix3<f32> {
    a * b
}

/// From one knot to another: turn, and shift along both axes.
fn between(a: &Knot, b: &Knot) -> Vector3<f32> {
    Vector3::new(b.turn_rad - a.turn_rad, b.x_px - a.x_px, b.y_px - a.y_px)
}

/// The same from the first one to the last.
// Not inlined: flash is short.
#[inline(never)]
fn apart(knots: &[Knot]) -> Vector3<f32> {
    knots.first().zip(knots.last()).map_or(Vector3::zeros(), |(first, last)| between(first, last))
}

/// Moves the ends of a path on, as far apart as the blocks want them, which `moved` them so far: they are held back by what the axis walks, the
/// more, the more its `cost` is beside what the blocks know of a drift. Returns by how many pixels an end moved at most.
// Not inlined: flash is short.
#[inline(never)]
fn free_drift(knots: &mut [Knot], blocks: &[Block], moved: Vector3<f32>, cost: f32) -> f32 {
    let per_block = 1.0 / blocks.len().max(1) as f32;
    let mut known = f32::MIN_POSITIVE;
    for (k, block) in blocks.iter().enumerate() {
        let far = (k as f32 + 0.5) * per_block - 0.5;
        let [xx, _, yy] = block.products;
        known += 0.5 * (xx + yy) * block.share() * far * far;
    }
    let more = moved * (cost * per_block / known).min(MOST_FREED);
    let more = more.map(|px| px.clamp(-2.0 * STRIDE_PX, 2.0 * STRIDE_PX));
    for (k, knot) in knots.iter_mut().enumerate() {
        let far = k as f32 * per_block - 0.5;
        knot.x_px += far * more[1];
        knot.y_px += far * more[2];
    }
    0.5 * more[1].abs().max(more[2].abs())
}

/// Moves the knots to where the blocks want them: least squares with a path that walks rather than jumps, a
/// tridiagonal system of 3 x 3 matrices, solved from end to end. Returns how far the rim moved at most, in pixels, or `None`
/// where the blocks give no path.
// Not inlined: flash is short.
#[inline(never)]
pub fn correct(path: &mut Path, blocks: &[Block; MAX_KNOTS], walk: Walk) -> Option<f32> {
    let blocks = &blocks[..path.blocks()];
    let walk_rad = (WALK_RAD_S + WALK_SHARE * walk.omega_rad_s.abs()) * path.step_us() * 1e-6;
    let knots = path.knots_mut();
    let m = walk.harmonic as f32;
    let scatter = 1.0 / (2.0 * walk.coherence.max(LEAST_SHARE));
    let (px, rad) = (scatter / (walk.step_px * walk.step_px), scatter / (walk_rad * walk_rad));
    let costs = Vector3::new(rad, px, px);
    let stiff = Matrix3::from_diagonal(&costs);
    // A speed that is off from the start is no walk, nor is a drift where it is free.
    let free = if walk.drifts { 1.0 } else { 0.0 };
    let per_block = 1.0 / blocks.len().max(1) as f32;
    let was_apart = apart(knots);
    let even = was_apart.component_mul(&Vector3::new(1.0, free, free)) * per_block;
    let step = |k: usize| Some(between(knots.get(k)?, knots.get(k + 1)?) - even);
    let link = |block: &Block| block.weight(m) * block.shares().1 - stiff;
    let mut inverses = Vec::<Matrix3<f32>, MAX_KNOTS>::new();
    let mut sides = Vec::<Vector3<f32>, MAX_KNOTS>::new();
    for k in 0..knots.len() {
        let mut pivot = Matrix3::identity() * 1e-3;
        let mut side = Vector3::zeros();
        if let (Some(block), Some(step)) = (blocks.get(k), step(k)) {
            let (right, later) = (Vector3::from(block.right), Vector3::from(block.later));
            pivot += block.weight(m) * block.shares().0 + stiff;
            side += (right - later) * m + costs.component_mul(&step);
        }
        let before = k
            .checked_sub(1)
            .and_then(|i| Some((blocks.get(i)?, step(i)?, inverses.get(i)?, sides.get(i)?)));
        if let Some((block, step, inverse, before)) = before {
            let link = link(block);
            pivot +=
                block.weight(m) * block.shares().2 + stiff - times(&times(&link, inverse), &link);
            side += Vector3::from(block.later) * m
                - costs.component_mul(&step)
                - link * (inverse * before);
        }
        inverses.push(pivot.try_inverse()?).ok();
        sides.push(side).ok();
    }
    let reach_rad = 1.0 / m;
    let within = |value: f32, reach: f32| value.max(-reach).min(reach);
    let mut off = Vector3::zeros();
    let mut most_px = 0.0_f32;
    for (k, knot) in knots.iter_mut().enumerate().rev() {
        let (inverse, side) = (inverses.get(k)?, sides.get(k)?);
        off = inverse * blocks.get(k).map_or(*side, |block| side - link(block) * off);
        if !off.iter().all(|value| value.is_finite()) {
            return None;
        }
        let (x_px, y_px) = (within(off[1], STRIDE_PX), within(off[2], STRIDE_PX));
        let turn_rad = within(off[0], reach_rad);
        most_px = most_px.max(x_px.abs()).max(y_px.abs()).max(turn_rad.abs() * walk.radius_px);
        knot.x_px += x_px;
        knot.y_px += y_px;
        knot.turn_rad += turn_rad;
    }
    if walk.drifts {
        let moved = apart(knots) - was_apart;
        most_px += free_drift(knots, blocks, moved, px / (m * m));
    }
    Some(most_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of so many events each, with these shares of them in step.
    fn blocks<const N: usize>(count: f32, shares: [f32; N]) -> [Block; N] {
        shares.map(|share| Block { count, in_step: share * count, ..Block::EMPTY })
    }

    #[test]
    fn blocks_out_of_step_one_behind_another_are_a_lapse() {
        let mut shares = [0.8; 12];
        assert!(!lapsed(&blocks(40.0, shares), 0.3, 2));
        [0, 4, 5, 6, 11].into_iter().for_each(|block| shares[block] = 0.2);
        assert!(lapsed(&blocks(40.0, shares), 0.3, 2));
        // Of four blocks each time, which make a period, the others are in step.
        assert!(!lapsed(&blocks(40.0, shares), 0.3, 4));
        assert!(!lapsed(&[], 0.3, 2));
    }

    #[test]
    fn blocks_in_step_by_chance_hold_no_rotor_together() {
        let chance = [0.8, 0.8, 0.8, 0.8, 0.8, 0.8, -0.4, 0.4, -0.1, 0.35, -0.2, 0.4];
        assert!(lapsed(&blocks(4.0, chance), 0.3, 4));
        // The same by themselves are but a period.
        assert!(!lapsed(&blocks(4.0, [0.8, -0.4, 0.4, 0.8]), 0.3, 4));
    }

    const DRIFT_PX: f32 = 8.0;

    /// How far the ends of a path are apart along x after some rounds that saw a mark whose axis drifts so, and may or not.
    fn followed_px(drifts: bool) -> f32 {
        const COUNT: u16 = 40;
        let m = 4;
        let mut path = Path::STILL.divided(-500_000.0, 25_000.0, usize::from(COUNT));
        let walk = Walk {
            step_px: WALK_SINGLE_PX,
            coherence: 0.9,
            harmonic: m,
            radius_px: 40.0,
            omega_rad_s: 19.0,
            drifts,
        };
        for _ in 0..3 {
            let mut seen = [Block::EMPTY; MAX_KNOTS];
            for (k, block) in (0..COUNT).zip(&mut seen) {
                // Three turns in the window.
                let angle = 19.0 * f32::from(k) / f32::from(COUNT);
                for ring in 1..=30_u16 {
                    let r_px = 10.0 + f32::from(ring);
                    let (x, y) = (-libm::sinf(angle) / r_px, libm::cosf(angle) / r_px);
                    let knot = path.at(path.time_us(usize::from(k), 0.5));
                    let left_px =
                        DRIFT_PX * ((f32::from(k) + 0.5) / f32::from(COUNT) - 0.5) - knot.x_px;
                    let psi = m as f32 * (x * left_px - y * knot.y_px - knot.turn_rad);
                    let (sin_psi, cos_psi) = (libm::sinf(psi), libm::cosf(psi));
                    let f = 0.5;
                    block.add(&Seen { block: 0, x, y, sin_psi, cos_psi, f, weight: 1.0 });
                }
            }
            assert!(correct(&mut path, &seen, walk).is_some());
        }
        apart(path.knots())[1]
    }

    #[test]
    fn a_path_that_is_held_back_follows_a_drift_all_the_same() {
        let free_px = followed_px(true);
        assert!((free_px - DRIFT_PX).abs() < 0.1 * DRIFT_PX, "{free_px}");
        let held_px = followed_px(false);
        assert!(held_px < 0.3 * DRIFT_PX, "{held_px}");
    }
}

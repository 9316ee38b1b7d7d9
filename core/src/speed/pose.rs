//! The rotor's pose through the window: where its axis was, and how far it had turned.
//!
//! The polar phase at its sharpest. The rotor is known by a template in its own frame: the phase of one high
//! angular harmonic on each of many narrow rings, for each polarity. The window is cut into blocks of a
//! whole part of the symmetry period; each tells by how much turn and shift its events are off the template, and these
//! corrections, laid through the knots of a [`Path`], bring the events closer, so that the template sharpens
//! and a higher harmonic can be followed. The trend of the turn through the blocks is the speed: all
//! events of the track weigh in it, no slices are matched, and what the hand or the host shakes is taken out.
//!
//! Blocks one symmetry period apart see the same pixels (their place on the grid, their latency), so
//! the trend gets an offset for each place in the period: what is fixed to the pixels cancels.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use super::baseline::Estimate;
use super::path::{Knot, Moving, Path};
use super::statistics::student_over_normal;
use super::trend::{Point, Trend};
use crate::limits::MAX_KNOTS;
use crate::math::{TAU, Turn, TurnRate, sqrt};
use crate::rotors::Disc;
use crate::store::Window;

/// Rings between centre and rim.
const RINGS: usize = 32;
/// Banks: a ring for each polarity.
const BANKS: usize = 2 * RINGS;
/// Events that a block should hold.
const BLOCK_EVENTS: usize = 64;
/// Shortest block: a hand trembles up to 12 Hz, a host shakes up to some 60 Hz.
const SHORTEST_BLOCK_US: f32 = 3_000.0;
/// Most blocks in a symmetry period.
const MOST_IN_PERIOD: f32 = 12.0;
/// Symmetry periods in the window from which on places in the period get offsets of their own.
const FOLDED_PERIODS: usize = 3;
/// Fewest events in a block that counts.
const LEAST_IN_BLOCK: u32 = 16;
/// Share of a block's events in step, over that of all, below which the block is not believed, and the least.
const BLOCK_SHARE: f32 = 0.4;
const LEAST_SHARE: f32 = 0.05;
/// How far the axis is thought to be off the path, in pixels: keeps the shift of a block finite where its events lie to
/// one side of the axis.
const SHIFT_PRIOR_PX: f32 = 2.0;
/// How far the path walks from knot to knot.
const WALK_PX: f32 = 0.5;
const WALK_RAD: f32 = 0.02;
/// Farthest that a knot is moved at once.
const STRIDE_PX: f32 = 3.0;
/// Highest angular harmonic.
const MOST_HARMONIC: u32 = 96;
/// A doubled harmonic must keep this share of the events in step.
const SHARP_COHERENCE: f32 = 0.35;
/// Blocks over which the wandering of the axis is judged.
const DRIFT_BLOCKS: usize = 12;
/// Blocks of the path at first, and once these fit.
const FIRST_BLOCKS: usize = 12;
const SECOND_BLOCKS: usize = 24;
/// Rounds from which on the path has more blocks, as many as the events allow, all events count, and the last.
const SECOND_ROUND: u8 = 4;
const FINE_ROUND: u8 = 5;
const ALL_ROUND: u8 = 10;
const LAST_ROUND: u8 = 13;
/// Events looked at before, and after.
const FIRST_EVENTS: usize = 3_072;
const MOST_EVENTS: usize = 65_536;

/// Template of a rotor: a harmonic by ring and polarity.
#[derive(Clone, Copy, Debug)]
struct Template {
    sums: [(f32, f32); BANKS],
    counts: [u16; BANKS],
}

impl Template {
    const EMPTY: Self = Self { sums: [(0.0, 0.0); BANKS], counts: [0; BANKS] };

    fn add(&mut self, bank: usize, (sin, cos): (f32, f32)) {
        self.sums[bank].0 += cos;
        self.sums[bank].1 += sin;
        self.counts[bank] = self.counts[bank].saturating_add(1);
    }

    /// Share of events in step, 0 to 1, corrected for what chance gives.
    fn coherence(&self) -> f32 {
        let (mut in_step, mut total) = (0.0, 0.0);
        for (sum, count) in self.sums.iter().zip(self.counts) {
            let excess = sum.0 * sum.0 + sum.1 * sum.1 - f32::from(count);
            in_step += sqrt(excess.max(0.0));
            total += f32::from(count);
        }
        in_step / total.max(1.0)
    }

    /// Every bank's phase as (cosine, sine).
    fn phases(&self) -> [(f32, f32); BANKS] {
        self.sums.map(|(re, im)| {
            let length = sqrt(re * re + im * im).max(f32::MIN_POSITIVE);
            (re / length, im / length)
        })
    }
}

#[derive(Clone, Copy, Debug)]
struct Block {
    /// Sums of the products of m, -l sin and l cos, with m the harmonic and l = m / r.
    normal: [f32; 6],
    right: Vector3<f32>,
    /// The same, each event by how far through the block it lies.
    later: Vector3<f32>,
    in_step: f32,
    time_us: f32,
    count: u32,
}

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

/// Sums of one round.
#[derive(Clone, Debug)]
pub struct Sums {
    blocks: [Block; MAX_KNOTS],
    low: Template,
    high: Template,
    /// Events of the rotor so far, those looked at among them.
    index: usize,
}

impl Sums {
    /// Nothing looked at. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self = Self {
        blocks: [Block::EMPTY; MAX_KNOTS],
        low: Template::EMPTY,
        high: Template::EMPTY,
        index: 0,
    };
}

/// What is found of the pose.
#[derive(Clone, Debug)]
pub struct Pose {
    disc: Disc,
    omega_rad_s: f32,
    window_us: f32,
    period_us: f32,
    harmonic: u32,
    path: Path,
    /// Blocks in a symmetry period, 0 when blocks are whole periods.
    in_period: usize,
    phases: Option<[(f32, f32); BANKS]>,
    coherence: f32,
    /// Rotor's events in the window.
    events: usize,
    round: u8,
    /// Segment of the window that is looked at next.
    segment: usize,
    slope: Option<Slope>,
}

impl Pose {
    /// A pose at rest about the disc's centre. `parts` equal parts, `harmonic` a multiple of them that is known
    /// to keep step.
    #[must_use]
    pub const fn new(disc: Disc, omega_rad_s: f32, parts: u32, harmonic: u32, window_us: u32) -> Self {
        Self {
            disc,
            omega_rad_s,
            window_us: window_us as f32,
            period_us: TAU * 1e6 / (omega_rad_s.abs() * parts as f32),
            harmonic,
            path: Path::STILL,
            in_period: 0,
            phases: None,
            coherence: 0.0,
            events: 0,
            round: 0,
            segment: 0,
            slope: None,
        }
    }

    /// Share of the events in step at the last look.
    #[must_use]
    pub const fn coherence(&self) -> f32 {
        self.coherence
    }

    /// Rotor's events in the window.
    #[must_use]
    pub const fn events(&self) -> usize {
        self.events
    }

    /// The way of the axis.
    #[must_use]
    pub const fn path(&self) -> &Path {
        &self.path
    }

    /// The trend of the turn, once all rounds are done; `None` when too few blocks tell.
    #[must_use]
    pub const fn slope(&self) -> Option<&Slope> {
        self.slope.as_ref()
    }

    /// Looks at one more segment of the window, and where that ends a round corrects the path and learns the
    /// template anew; `true` once all rounds are done. Cost: about 400 instructions an event.
    pub fn step(&mut self, window: &Window<'_>, sums: &mut Sums) -> bool {
        if self.round == 0 {
            let disc = Moving::new(self.disc, &self.path, window);
            self.events = window.events().filter(|event| disc.place(*event).is_some()).count();
            self.divide(self.seen(FIRST_EVENTS).min(FIRST_BLOCKS));
            self.round = 1;
        }
        if self.segment == 0 {
            *sums = Sums::EMPTY;
        }
        self.look(window, sums);
        self.segment += 1;
        if self.segment < window.segments() {
            return false;
        }
        self.segment = 0;
        self.sift(sums);
        if self.round > LAST_ROUND {
            self.slope = self.trend(sums);
            return true;
        }
        let (at_low, at_high) = (sums.low.coherence(), sums.high.coherence());
        if self.round > 1 {
            self.correct(&sums.blocks);
        }
        let sharper = self.round > FINE_ROUND
            && 2 * self.harmonic <= MOST_HARMONIC
            && at_high > SHARP_COHERENCE
            && 2.0 * at_high > at_low;
        self.harmonic *= if sharper { 2 } else { 1 };
        self.coherence = if sharper { at_high } else { at_low };
        self.phases = Some(if sharper { &sums.high } else { &sums.low }.phases());
        if std::env::var("DBG").is_ok() { std::println!("  round {} harmonic {} coherence {:.2} blocks {} events {}", self.round, self.harmonic, self.coherence, self.path.blocks(), self.events); }
        self.round += 1;
        match self.round {
            SECOND_ROUND => self.divide(self.seen(FIRST_EVENTS).min(SECOND_BLOCKS)),
            FINE_ROUND => self.divide(self.seen(FIRST_EVENTS)),
            ALL_ROUND => self.divide(self.seen(MOST_EVENTS)),
            _ => {}
        }
        false
    }

    /// Blocks that so many events are enough for.
    fn seen(&self, most: usize) -> usize {
        self.events.min(most) / BLOCK_EVENTS
    }

    /// Lays the path through up to `most` blocks.
    fn divide(&mut self, most: usize) {
        let most = most.clamp(4, MAX_KNOTS - 1) as f32;
        let shortest = (self.window_us / most).max(SHORTEST_BLOCK_US);
        let split = libm::floorf((self.period_us / shortest).min(MOST_IN_PERIOD));
        let step_us = if split >= 1.0 {
            self.period_us / split
        } else {
            self.period_us * libm::ceilf(shortest / self.period_us)
        };
        self.in_period = split as usize;
        let blocks = libm::ceilf(self.window_us / step_us - 0.25) as usize;
        self.path = self.path.divided(-0.5 * self.window_us, step_us, blocks);
    }

    /// Looks at the events of a segment: how far the blocks are off the template, and the templates of this harmonic
    /// and of twice it. Early rounds look at some events only.
    fn look(&self, window: &Window<'_>, sums: &mut Sums) {
        let most = if self.round < ALL_ROUND { FIRST_EVENTS } else { MOST_EVENTS };
        let stride = self.events.div_ceil(most).max(1);
        let disc = Moving::new(self.disc, &self.path, window);
        let rate = TurnRate::from_rad_s(self.omega_rad_s);
        let rings_per_px = RINGS as f32 / self.disc.radius_px.max(1.0);
        let m = self.harmonic as f32;
        let phases = self.phases.as_ref();
        for event in window.segment(self.segment) {
            let Some((x_px, y_px, r2)) = disc.place(*event) else { continue };
            sums.index += 1;
            if sums.index % stride != 0 {
                continue;
            }
            let t_us = disc.since_middle_us(*event);
            let turn = Turn::from_rad(self.path.at(t_us as f32).turn_rad).plus(rate.after(t_us));
            let angle = Turn::of_vector(y_px, x_px);
            let (s, c) = angle.minus(turn).times(self.harmonic).sin_cos();
            let radius_px = sqrt(r2);
            let ring = ((radius_px * rings_per_px) as usize).min(RINGS - 1);
            let bank = 2 * ring + usize::from(event.is_on());
            sums.low.add(bank, (s, c));
            sums.high.add(bank, (2.0 * s * c, c * c - s * s));
            let Some(phases) = phases else { continue };
            let (re, im) = phases[bank];
            let (sin_psi, cos_psi) = (s * re - c * im, c * re + s * im);
            let lever = m / r2;
            let (index, f) = self.path.place(t_us as f32);
            sums.blocks[index].add(
                Vector3::new(m, -y_px * lever, x_px * lever),
                (sin_psi, cos_psi),
                (t_us as f32, f),
            );
        }
    }

    /// Leaves out blocks that are not in step with the rest: the path between their neighbours brings them back.
    fn sift(&self, sums: &mut Sums) {
        let least = (BLOCK_SHARE * self.coherence).max(LEAST_SHARE);
        for block in &mut sums.blocks {
            if block.share() < least {
                *block = Block::EMPTY;
            }
        }
    }

    /// Moves the knots to where the blocks want them: least squares with a path that walks rather than jumps, a
    /// tridiagonal system of 3 x 3 matrices, solved from end to end.
    fn correct(&mut self, blocks: &[Block; MAX_KNOTS]) {
        let blocks = &blocks[..self.path.blocks()];
        let knots = self.path.knots_mut();
        let scatter = 1.0 / (2.0 * self.coherence.max(LEAST_SHARE));
        let (px, rad) = (scatter / (WALK_PX * WALK_PX), scatter / (WALK_RAD * WALK_RAD));
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
            let before = k.checked_sub(1).and_then(|i| {
                Some((blocks.get(i)?, step(i)?, inverses.get(i)?, sides.get(i)?))
            });
            if let Some((block, step, inverse, before)) = before {
                let link = link(block);
                pivot += block.weight() / 3.0 + stiff - link * inverse * link;
                side += block.later - stiff * step - link * (inverse * before);
            }
            let Some(inverse) = pivot.try_inverse() else { return };
            inverses.push(inverse).ok();
            sides.push(side).ok();
        }
        let reach_rad = 1.0 / self.harmonic as f32;
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

    /// The trend of the turn through the blocks, and how the axis wanders; `None` when too few blocks tell.
    fn trend(&self, sums: &Sums) -> Option<Slope> {
        let count = self.path.blocks();
        let periods = count / self.in_period.max(1);
        let fold = if periods >= FOLDED_PERIODS { self.in_period.max(1) } else { 1 };
        let half_us = 0.5 * self.window_us;
        let mut points = Vec::<Point, MAX_KNOTS>::new();
        for block in sums.blocks.iter().take(count) {
            let t_us = block.time_us / (block.count as f32).max(1.0);
            let (off_rad, weight) = block.turn_rad().unwrap_or_default();
            let y = self.path.at(t_us).turn_rad + off_rad;
            points.push(Point { u: t_us / half_us, y, weight }).ok();
        }
        if std::env::var("DBG").is_ok() {
            std::println!("start");
            for p in &points { let k = self.path.at(p.u * half_us); std::println!("K {:.1} {:.3} {:.3} {:.6} {}", p.u * half_us * 1e-3, self.disc.x_px + k.x_px, self.disc.y_px + k.y_px, p.y + self.omega_rad_s * p.u * half_us * 1e-6, p.weight); }
        }
        let trend = Trend::fit(&points, fold)?; if std::env::var("DBG").is_ok() { std::println!("{trend:?} fold {fold}"); }
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

impl Block {
    fn share(&self) -> f32 {
        self.in_step / (self.count as f32).max(1.0)
    }

    const EMPTY: Self = Self {
        normal: [0.0; 6],
        right: Vector3::new(0.0, 0.0, 0.0),
        later: Vector3::new(0.0, 0.0, 0.0),
        in_step: 0.0,
        time_us: 0.0,
        count: 0,
    };

    /// Adds an event: its levers on phase by turn and shift, its phase off the template, and when it came.
    fn add(&mut self, a: Vector3<f32>, (sin_psi, cos_psi): (f32, f32), (t_us, f): (f32, f32)) {
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
    fn turn_rad(&self) -> Option<(f32, f32)> {
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

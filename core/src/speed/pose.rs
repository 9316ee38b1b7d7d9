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

mod blocks;
mod template;

use heapless::Vec;
use nalgebra::Vector3;

use super::baseline::Estimate;
use super::path::{Knot, Moving, Path};
use super::statistics::student_over_normal;
use super::trend::{Point, Trend};
use crate::limits::MAX_KNOTS;
use crate::math::{TAU, Turn, TurnRate, sqrt};
use crate::rotors::Disc;
use crate::store::Window;
use blocks::{BLOCK_SHARE, Block, LEAST_SHARE, WALK_PX, WALK_SINGLE_PX, Walk, correct};
use template::{BANKS, RINGS, Template};

/// Events that a block should hold.
const BLOCK_EVENTS: usize = 64;
/// Shortest block: a hand trembles up to 12 Hz, a host shakes up to some 60 Hz.
const SHORTEST_BLOCK_US: f32 = 3_000.0;
/// Most blocks in a symmetry period.
const MOST_IN_PERIOD: f32 = 12.0;
/// Symmetry periods in the window from which on places in the period get offsets of their own.
const FOLDED_PERIODS: usize = 3;
/// Highest angular harmonic.
const MOST_HARMONIC: u32 = 96;
/// A doubled harmonic must keep this share of the events in step that were so at first.
const SHARP_COHERENCE: f32 = 0.5;
/// Share of the events in step that edges as sharp as can be seen leave there.
const SEEN_COHERENCE: f32 = 0.75;
/// Blocks over which the wandering of the axis is judged.
const DRIFT_BLOCKS: usize = 12;
/// Blocks of the path at first, and once these fit.
const FIRST_BLOCKS: usize = 12;
const SECOND_BLOCKS: usize = 24;

/// What is done in which round.
#[derive(Clone, Copy, Debug)]
struct Schedule {
    /// Rounds from which on the path has more blocks, as many as the events allow, and as many as all of them allow.
    second: u8,
    fine: u8,
    all: u8,
    /// The last that corrects the path; one more look gives the trend.
    last: u8,
    /// Events looked at before `all`, and the share and number of all events looked at from then on.
    first_events: usize,
    share: usize,
    most_events: usize,
}

impl Schedule {
    /// For a rotor of which little is known.
    const NEW: Self = Self {
        second: 4,
        fine: 5,
        all: 11,
        last: 13,
        first_events: 3_072,
        share: 1,
        most_events: 65_536,
    };
    /// For a rotor that was followed in the window before: a third of the events tell it as well.
    const KNOWN: Self =
        Self { second: 2, fine: 3, all: 6, last: 7, first_events: 1_536, share: 3, ..Self::NEW };
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
}

impl Sums {
    /// Nothing looked at. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self =
        Self { blocks: [Block::EMPTY; MAX_KNOTS], low: Template::EMPTY, high: Template::EMPTY };
}

/// What is found of the pose.
#[derive(Clone, Debug)]
pub struct Pose {
    disc: Disc,
    omega_rad_s: f32,
    window_us: f32,
    period_us: f32,
    harmonic: u32,
    first_harmonic: u32,
    most_harmonic: u32,
    walk_px: f32,
    path: Path,
    /// Blocks in a symmetry period, 0 when blocks are whole periods.
    in_period: usize,
    phases: Option<[(f32, f32); BANKS]>,
    coherence: f32,
    /// The same before the harmonic was raised.
    first_coherence: f32,
    /// Rotor's events in the window.
    events: usize,
    round: u8,
    schedule: Schedule,
    /// Segment of the window that is looked at next.
    segment: usize,
    slope: Option<Slope>,
}

impl Pose {
    /// A pose at rest about the disc's centre. `parts` equal parts, `harmonic` a multiple of them that is known
    /// to keep step.
    #[must_use]
    pub const fn new(
        disc: Disc,
        omega_rad_s: f32,
        parts: u32,
        harmonic: u32,
        window_us: u32,
    ) -> Self {
        Self {
            disc,
            omega_rad_s,
            window_us: window_us as f32,
            period_us: TAU * 1e6 / (omega_rad_s.abs() * parts as f32),
            harmonic,
            first_harmonic: harmonic,
            most_harmonic: MOST_HARMONIC,
            walk_px: if parts > 1 { WALK_PX } else { WALK_SINGLE_PX },
            path: Path::STILL,
            in_period: 0,
            phases: None,
            coherence: 0.0,
            first_coherence: 0.0,
            events: 0,
            round: 0,
            schedule: Schedule::NEW,
            segment: 0,
            slope: None,
        }
    }

    /// The same for a rotor whose place and speed are known from the window before: fewer rounds will do.
    #[must_use]
    pub const fn known(mut self) -> Self {
        self.schedule = Schedule::KNOWN;
        self
    }

    /// The same for a rotor whose parts differ: the template takes them for one, so that a high harmonic shows their
    /// differences.
    #[must_use]
    pub const fn unlike(mut self) -> Self {
        self.most_harmonic = 2 * self.harmonic;
        self
    }

    /// Angular harmonic that was followed at last.
    #[must_use]
    pub const fn harmonic(&self) -> u32 {
        self.harmonic
    }

    /// Share of the events in step at the harmonic that the rotor was found by.
    #[must_use]
    pub const fn first_coherence(&self) -> f32 {
        self.first_coherence
    }

    /// How sharply the events show the rotor's edges, in pixels half-way to the rim: the width of what they would be
    /// scattered over evenly.
    #[must_use]
    pub fn sharpness_px(&self) -> f32 {
        0.5 * self.disc.radius_px / (self.harmonic as f32 * self.coherence.max(LEAST_SHARE))
    }

    /// The same for those events that kept step when the rotor was found, where a harmonic twice as high or more shows edges
    /// at all: noise, a lamp and a background among the rotor's events are not blur. Pixels at the rim's half.
    #[must_use]
    pub fn blur_px(&self) -> f32 {
        if self.has_overtone() {
            self.sharpness_px() * self.first_coherence.max(self.coherence)
        } else {
            self.sharpness_px()
        }
    }

    /// Blur in pixels half-way to the rim below which edges could not be seen, where parts differ and the harmonic rose as
    /// far as it may; 0 where it may rise further.
    #[must_use]
    pub fn least_blur_px(&self) -> f32 {
        if self.has_overtone() && self.harmonic == self.most_harmonic {
            0.5 * self.disc.radius_px / (SEEN_COHERENCE * self.harmonic as f32)
        } else {
            0.0
        }
    }

    /// Whether twice the harmonic that the rotor was found by keeps step too.
    #[must_use]
    pub const fn has_overtone(&self) -> bool {
        self.harmonic > self.first_harmonic
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

    /// The disc, its centre the mean place of the axis once all rounds are done.
    #[must_use]
    pub const fn disc(&self) -> Disc {
        self.disc
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
            self.divide(self.blocks().min(FIRST_BLOCKS));
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
        let Schedule { second, fine, all, last, .. } = self.schedule;
        let at_low = sums.low.coherence();
        let astray = at_low < SHARP_COHERENCE * self.first_coherence;
        if self.round > fine && astray && self.harmonic > self.first_harmonic {
            self.step_back();
            return false;
        }
        self.sift(sums);
        if self.round > last {
            self.slope = self.trend(sums);
            let (x_px, y_px) = self.path.centre();
            self.disc.x_px += x_px;
            self.disc.y_px += y_px;
            return true;
        }
        let at_high = sums.high.coherence();
        if self.phases.is_some() {
            let (step_px, coherence) = (self.walk_px, self.coherence);
            let walk = Walk { step_px, coherence, harmonic: self.harmonic };
            correct(&mut self.path, &sums.blocks, walk);
        }
        let worth = at_high > at_low
            || self.round > fine
                && at_high > SHARP_COHERENCE * self.first_coherence
                && 2.0 * at_high > at_low;
        let sharper = worth && 2 * self.harmonic <= self.most_harmonic;
        self.harmonic *= if sharper { 2 } else { 1 };
        self.coherence = if sharper { at_high } else { at_low };
        if self.round <= fine {
            self.first_coherence = self.coherence;
        }
        self.phases = Some(if sharper { &sums.high } else { &sums.low }.phases());
        self.round += 1;
        if self.round == second {
            self.divide(self.blocks().min(SECOND_BLOCKS));
        } else if self.round == fine || self.round == all {
            self.divide(self.blocks());
        }
        false
    }

    /// The harmonic was raised too far: half of it, learnt anew, and no higher again.
    const fn step_back(&mut self) {
        self.harmonic /= 2;
        self.most_harmonic = self.harmonic;
        self.coherence = self.first_coherence;
        self.phases = None;
    }

    /// Events that this round looks at, at most.
    fn most(&self) -> usize {
        let Schedule { all, first_events, share, most_events, .. } = self.schedule;
        if self.round < all {
            first_events
        } else {
            (self.events / share).clamp(first_events, most_events)
        }
    }

    /// Blocks that so many events are enough for.
    fn blocks(&self) -> usize {
        self.events.min(self.most()) / BLOCK_EVENTS
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
        let stride = self.events.div_ceil(self.most()).max(1);
        let disc = Moving::new(self.disc, &self.path, window);
        let rate = TurnRate::from_rad_s(self.omega_rad_s);
        let rings_per_px = RINGS as f32 / self.disc.radius_px.max(1.0);
        let m = self.harmonic as f32;
        let phases = self.phases.as_ref();
        for event in window.segment(self.segment).iter().step_by(stride) {
            let Some((x_px, y_px, r2)) = disc.place(*event) else { continue };
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

    /// The trend of the turn through the blocks, and how the axis wanders; `None` when too few blocks tell.
    fn trend(&self, sums: &Sums) -> Option<Slope> {
        let count = self.path.blocks();
        let periods = count / self.in_period.max(1);
        let fold = if periods >= FOLDED_PERIODS { self.in_period.max(1) } else { 1 };
        let half_us = 0.5 * self.window_us;
        let mut points = Vec::<Point, MAX_KNOTS>::new();
        for block in sums.blocks.iter().take(count) {
            let t_us = block.middle_us();
            let (off_rad, weight) = block.turn_rad().unwrap_or_default();
            let y = self.path.at(t_us).turn_rad + off_rad;
            points.push(Point { u: t_us / half_us, y, weight }).ok();
        }
        let trend = Trend::fit(&points, fold)?;
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

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

mod approach;
mod blocks;
mod divide;
mod look;
mod schedule;
mod sharpness;
mod sides;
mod slope;
mod still;
mod template;
mod tilt;

use super::path::Path;
use super::polar::Annulus;
use crate::limits::MAX_KNOTS;
use crate::math::{TAU, larger};
use crate::rotors::Disc;
use crate::store::{Even, Window};
use approach::{Approach, Growth};
use blocks::{
    BLOCK_SHARE, Block, LEAST_SHARE, MOST_FINE_WALK, MOST_WALK, STILL_WALK_PX, WALK_PX,
    WALK_SINGLE_PX, WALK_TWO_PX, WALK_US, Walk, correct, lapsed,
};
use schedule::{Phase, SETTLED_PX, Schedule};
use sides::{Inverted, Sides};
pub use slope::Slope;
use template::{BANKS, Counts, Template};
pub use tilt::Tilt;
use tilt::TiltSums;

/// Events that a block should hold.
const BLOCK_EVENTS: usize = 32;
/// Highest angular harmonic.
const MOST_HARMONIC: u32 = 96;
/// A doubled harmonic must keep this share of the events in step that were so at first.
const SHARP_COHERENCE: f32 = 0.5;
/// The same where blocks hold few events: a path that went astray at a sparse end does not find back to a harmonic so fine.
const SPARSE_COHERENCE: f32 = 0.7;
/// Share of the events in step with each other that must be in step with the round before: else path and template chase each other.
const TOGETHER: f32 = 0.75;

/// Phase at the rim, in radians of a doubled harmonic, by which the path may still move when it is doubled.
const MOST_OFF_RAD: f32 = 1.0;
/// Phase at the rim by which a correction moves a path that has not arrived: one correction turns a knot by one radian at most.
const UNDER_WAY_RAD: f32 = 0.5;
/// Both, in the rounds that look at all events, where some of them had been taken for the wrong polarity and pulled the path aside: it is
/// learnt together with the template, so each round does a part only of what is left.
const PULLED_OFF_RAD: f32 = 0.5;
const PULLED_UNDER_WAY_RAD: f32 = 0.3;

/// Turns in the window from which on a path that is held back may drift: in fewer, an even drift looks like a turn, too.
const DRIFTING_TURNS: f32 = 2.0;

/// Root mean square speed of the axis in px/s from which on the camera moves: a hand makes some 80, and what few events scatter by
/// looks like 20.
pub const MOVING_PX_S: f32 = 25.0;

/// Sums of one round.
#[derive(Clone, Debug)]
pub struct Sums {
    blocks: [Block; MAX_KNOTS],
    counts: Counts,
    /// At the harmonic that is followed, and at twice it.
    low: Template,
    high: Template,
    tilt: TiltSums,
    sides: Sides,
    growth: Growth,
}

impl Sums {
    /// Nothing looked at. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self = Self {
        blocks: [Block::EMPTY; MAX_KNOTS],
        counts: [0; BANKS],
        low: Template::EMPTY,
        high: Template::EMPTY,
        tilt: TiltSums::EMPTY,
        sides: Sides::EMPTY,
        growth: Growth::EMPTY,
    };

    /// Share of the events in step with the template of the round before.
    fn in_step(&self) -> f32 {
        let (in_step, count) = self.blocks.iter().fold((0.0, 0.0), |(in_step, count), block| {
            (in_step + block.share() * block.count(), count + block.count())
        });
        in_step / larger(count, 1.0)
    }
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
    /// Whether path and template came apart before.
    came_apart: bool,
    /// Parts that have a template of their own.
    sectors: u32,
    walk_px: f32,
    /// How the rotor is tilted, where that is asked.
    tilt: Option<Tilt>,
    path: Path,
    /// Whether the axis is thought to stand still, and whether that is to be decided yet.
    still: bool,
    in_doubt: bool,
    /// Blocks in a symmetry period, 0 when blocks are whole periods.
    in_period: usize,
    phases: Option<[(f32, f32, f32); BANKS]>,
    /// Where polarities are the other way round.
    inverted: Inverted,
    /// By how many radians its edges go round for each factor of e in radius.
    sweep: f32,
    coherence: f32,
    /// The same before the harmonic was raised.
    first_coherence: f32,
    /// Share in step at twice the harmonic, where that shows although it is not followed: 0 where it does not.
    overtone: f32,
    /// Rotor's events in the window.
    events: usize,
    /// Share of them that would be left if all were thinned as the thinnest are: the store keeps dense bursts, and blocks
    /// beside them hold few events.
    even_share: f32,
    started: bool,
    /// Time from the window's start on that a pixel may take to its first events of the stream, and a slow one to get used to the light,
    /// where that is a small part of the window: 0 but where the stream, or what is left of it, begins with the window.
    unsettled_us: f32,
    schedule: Schedule,
    /// Segment of the window that is looked at next.
    segment: usize,
    slope: Option<Slope>,
    approach: Approach,
    /// Whether the trend of what pixels told once they had settled is to come.
    trending: bool,
    lapsed: bool,
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
            came_apart: false,
            sectors: 1,
            walk_px: match parts {
                0 | 1 => WALK_SINGLE_PX,
                2 => WALK_TWO_PX,
                _ => WALK_PX,
            },
            tilt: None,
            path: Path::STILL,
            still: false,
            in_doubt: false,
            in_period: 0,
            phases: None,
            inverted: Inverted::UPRIGHT,
            sweep: 0.0,
            coherence: 0.0,
            first_coherence: 0.0,
            overtone: 0.0,
            events: 0,
            even_share: 1.0,
            started: false,
            unsettled_us: 0.0,
            schedule: Schedule::NEW,
            segment: 0,
            slope: None,
            approach: Approach::NONE,
            trending: false,
            lapsed: false,
        }
    }

    /// The same for a rotor whose place and speed are known from the window before, in which it `moved` or not, and polarities were
    /// the other way round in parts of it or nowhere: fewer rounds will do.
    #[must_use]
    pub const fn known(mut self, moved: bool, sided: bool) -> Self {
        self.schedule = if moved { Schedule::moved(sided) } else { Schedule::KNOWN };
        self
    }

    /// Whether polarities are the other way round in parts of the rotor.
    #[must_use]
    pub fn sided(&self) -> bool {
        self.inverted.any()
    }

    /// The same for a rotor of so many parts that differ: each has its own template, on fewer rings.
    #[must_use]
    pub const fn unlike(mut self, parts: u32) -> Self {
        if parts > 1 {
            self.sectors = parts;
        }
        // Of two that differ, one may be none: then there is a single mark.
        if parts > 2 {
            self.walk_px = WALK_PX;
        }
        self
    }

    /// The same for a rotor that may be tilted, as far as it is known. With less than three blades a tilt and an uneven turn look
    /// alike, and in doubt a neighbour of the harmonic may look like a tilt.
    #[must_use]
    pub const fn tilted(mut self, tilt: Tilt) -> Self {
        self.tilt = Some(tilt);
        self
    }

    /// How the rotor comes nearer or goes away, once all rounds are done.
    #[must_use]
    pub const fn approach(&self) -> Approach {
        self.approach
    }

    /// How the rotor is tilted, if that was asked.
    #[must_use]
    pub const fn tilt(&self) -> Option<Tilt> {
        self.tilt
    }

    /// Angular harmonic that was followed at last.
    #[must_use]
    pub const fn harmonic(&self) -> u32 {
        self.harmonic
    }

    /// Whether the rotor was out of step for a part of the window, as it stood still meanwhile or turned with another speed.
    #[must_use]
    pub const fn lapsed(&self) -> bool {
        self.lapsed
    }

    /// Share of the events in step at the harmonic that the rotor was found by.
    #[must_use]
    pub const fn first_coherence(&self) -> f32 {
        self.first_coherence
    }

    /// Blocks in a symmetry period, 0 when blocks are whole periods.
    #[must_use]
    pub const fn in_period(&self) -> usize {
        self.in_period
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

    /// Weighs one more segment of the window, or looks at it, or ends a round: corrects the path and learns the template anew;
    /// `true` once all rounds are done. Cost: about 60 instructions an event that is
    /// looked at, 270 more for one of the rotor's, or half a million.
    pub fn step(
        &mut self,
        window: &Window<'_>,
        sums: &mut Sums,
        walked: &mut Path,
        even: &mut Even,
    ) -> bool {
        if !self.started {
            // The axis is thought to be at rest yet.
            let annulus = Annulus::of(self.disc);
            if even.weigh(window, |event| annulus.place(event).is_some()) {
                self.started = true;
                self.unsettled_us = self.settling_us(window);
                self.events = even.count();
                self.even_share = even.share();
                *even = Even::EMPTY;
                self.divide();
            }
            return false;
        }
        if self.segment == 0 {
            *sums = Sums::EMPTY;
        }
        if self.segment < window.segments() {
            self.look(window, sums);
            self.segment += 1;
            return false;
        }
        if core::mem::take(&mut self.trending) {
            self.slope = self.settled_trend(sums, window);
        } else if !self.end_round(sums, walked) {
            self.segment = 0;
            return false;
        } else if self.unsettled_us > 0.0 {
            // A second trend is as much work again: a step of its own.
            self.trending = true;
            return false;
        }
        self.segment = 0;
        self.end()
    }

    /// Corrects the path by what a round saw; `true` when it was the last.
    // Not inlined: flash is short.
    #[inline(never)]
    fn end_round(&mut self, sums: &mut Sums, walked: &mut Path) -> bool {
        let fine = self.schedule.is_fine();
        let at_low = sums.low.coherence(&sums.counts);
        if self.moves_after_all(at_low, walked) {
            self.reach_out();
            return false;
        }
        let blurred = at_low < SHARP_COHERENCE * self.first_coherence;
        // Path and template chase each other: too few events for so high a harmonic, or they met at a wrong one.
        let apart = fine && self.phases.is_some() && sums.in_step() < TOGETHER * at_low;
        if fine && (blurred || apart) && self.harmonic > self.first_harmonic {
            // Once it is raised again, from where the template reaches farther.
            self.halve(blurred || self.came_apart);
            self.came_apart = true;
            return false;
        }
        if self.schedule.asks_sides() && !self.inverted.learn(&sums.sides) {
            self.schedule.ask_no_sides();
        }
        let last = self.schedule.phase() == Phase::Last;
        if last {
            let blocks = sums.blocks.get(..self.path.blocks()).unwrap_or_default();
            self.lapsed = lapsed(blocks, self.least_share(), self.in_period);
        }
        self.sift(sums);
        if last {
            self.slope = self.trend_after(0.0, sums);
            self.approach = self.approaches(&sums.growth);
            return true;
        }
        let corrected = self.phases.is_some();
        let moved_px = if corrected { self.correct_path(sums) } else { f32::MAX };
        let at_high = sums.high.coherence(&sums.counts);
        let least = if self.is_sparse() { SPARSE_COHERENCE } else { SHARP_COHERENCE };
        let shows =
            |least: f32| fine && at_high > least * self.first_coherence && 2.0 * at_high > at_low;
        // The path comes first: all events correct it by this template before one of twice the harmonic is believed.
        let waits = self.schedule.phase() >= Phase::All && self.phases.is_none();
        // Nor while the path still moves by more than it reaches.
        let moved_rad = moved_px * self.harmonic as f32 / self.disc.radius_px;
        let pulled = self.inverted.any() && self.schedule.learns();
        let (most_off_rad, under_way_rad) = if pulled {
            (PULLED_OFF_RAD, PULLED_UNDER_WAY_RAD)
        } else {
            (MOST_OFF_RAD, UNDER_WAY_RAD)
        };
        let strays = corrected && moved_px >= SETTLED_PX && 2.0 * moved_rad > most_off_rad;
        let sharper = (at_high > at_low || shows(least)) && self.may_double() && !waits && !strays;
        // Few events show it as well as many, but a path does not follow them.
        self.overtone = if shows(SHARP_COHERENCE) && !sharper { at_high } else { 0.0 };
        self.harmonic *= if sharper { 2 } else { 1 };
        self.coherence = if sharper { at_high } else { at_low };
        if !fine {
            self.first_coherence = self.coherence;
        }
        let learnt = if sharper { &sums.high } else { &sums.low };
        self.sweep = learnt.sweep(self.sectors, self.harmonic as f32, self.sweep);
        self.phases = Some(learnt.phases(&sums.counts, self.coherence));
        let under_way = corrected && moved_rad > under_way_rad;
        if self.schedule.advance(if sharper { f32::MAX } else { moved_px }, under_way) {
            self.divide();
            if self.schedule.phase() == Phase::All && !self.tries_still(walked) {
                self.reach_out();
            }
        }
        false
    }

    /// Corrects path and tilt by what a round saw. Returns by how many pixels the path moved at most: `f32::MAX` where no block tells.
    fn correct_path(&mut self, sums: &Sums) -> f32 {
        // Between the few knots of the first rounds a hand goes far.
        let coarse = self.schedule.phase() < Phase::Fine;
        let most = if coarse { MOST_WALK } else { MOST_FINE_WALK };
        let longer = (self.path.step_us() / WALK_US).max(1.0).min(most);
        let walk = Walk {
            step_px: if self.still { STILL_WALK_PX } else { self.walk_px * longer },
            coherence: self.coherence,
            harmonic: self.harmonic,
            radius_px: self.disc.radius_px,
            omega_rad_s: self.omega_rad_s,
            drifts: !self.still && self.walk_px < WALK_PX && self.turns() > DRIFTING_TURNS,
        };
        let moved_px = correct(&mut self.path, &sums.blocks, walk).unwrap_or(f32::MAX);
        if self.schedule.samples()
            && let Some(tilt) = &mut self.tilt
        {
            let share = self.coherence.max(LEAST_SHARE);
            tilt.correct(&sums.tilt, share, self.harmonic as f32);
        }
        moved_px
    }

    /// Takes the trend for the answer; `false` where there is none, and a lower harmonic may give one.
    fn end(&mut self) -> bool {
        if self.slope.is_none() && self.harmonic > self.first_harmonic {
            // Too few blocks are in step, or the path slipped.
            self.halve(true);
            return false;
        }
        let (x_px, y_px) = self.path.centre();
        self.disc.x_px += x_px;
        self.disc.y_px += y_px;
        true
    }

    /// Turns in the window.
    fn turns(&self) -> f32 {
        self.omega_rad_s.abs() * self.window_us * (1e-6 / TAU)
    }

    /// Whether blocks are as long as few events make them.
    fn is_sparse(&self) -> bool {
        (self.events as f32 * self.even_share) < (BLOCK_EVENTS * MAX_KNOTS) as f32
    }

    const fn may_double(&self) -> bool {
        2 * self.harmonic <= self.most_harmonic
    }

    /// Learns the template of half the harmonic about the path as it is; for good, it goes no higher again.
    // Not inlined: flash is short.
    #[inline(never)]
    const fn halve(&mut self, for_good: bool) {
        self.harmonic /= 2;
        if for_good {
            self.most_harmonic = self.harmonic;
        }
        self.coherence = self.first_coherence;
        self.phases = None;
        self.schedule.again();
    }

    /// Share of a block's events in step below which it is not believed.
    fn least_share(&self) -> f32 {
        (BLOCK_SHARE * self.coherence).max(LEAST_SHARE)
    }

    /// Leaves out blocks that are not in step with the rest: the path between their neighbours brings them back.
    fn sift(&self, sums: &mut Sums) {
        let least = self.least_share();
        for block in &mut sums.blocks {
            if block.share() < least {
                *block = Block::EMPTY;
            }
        }
    }
}

//! Registration at ever longer baselines: refinement, lock, and the test that tells an alias.

use super::super::baseline::{Effort, Estimate, Pace, Pairs};
use super::coarse::COARSE_AGREEMENT;
use super::verdict::LOCK_AGREEMENT;
use super::{Measurement, Stage};
use crate::limits::SLICE_POINTS;
use crate::reading::Reason;
use crate::registration::Icp;
use crate::settings::Settings;
use crate::speed::pose::Slope;
use crate::store::Window;

/// Slice pairs: refinement, lock, fractional-baseline test.
const REFINEMENT: Effort = Effort { pairs: 12, points: SLICE_POINTS, settled: 0.1 };
/// The paper's further refinement, kept to show what it gains.
const FURTHER: Effort = Effort { pairs: 6, ..REFINEMENT };
const LOCK: Effort = Effort { pairs: 8, settled: 0.2, ..REFINEMENT };
/// A baseline that is not the longest only has to bear the next.
const ON_THE_WAY: Effort = Effort { pairs: 4, ..LOCK };
/// A baseline that is longer by less than this factor is not worth a lock of its own.
const MORE: f32 = 1.5;
const FRACTIONAL: Effort = Effort { pairs: 3, ..LOCK };
/// The same where these few deviate: scatter goes, an alias stays.
const FRACTIONAL_AGAIN: Effort = Effort { pairs: 9, ..LOCK };
/// The lock of a rotor that is followed: the phase tells its speed, and these bear it out, for which they need not settle as far.
const FOLLOWING: Effort = Effort { pairs: 3, points: 3 * SLICE_POINTS / 8, settled: 0.7 };
/// An alias is off by ten times what a pair of few points scatters by.
const FRACTIONAL_FOLLOWING: Effort = Effort { pairs: 1, points: SLICE_POINTS / 4, settled: 1.0 };
/// Where there are more events than this for each pair, more pairs are registered, up to [`crate::limits::MAX_PAIRS`].
const PAIR_EVENTS: usize = 1_536;
/// The same of the refinement, whose pairs are short and gain by overlapping.
const REFINEMENT_EVENTS: usize = SLICE_POINTS;
/// Step of the refinement in symmetry periods (paper: eta x half an angle of symmetry, eta = 0.8).
pub(super) const REFINEMENT_PERIODS: f32 = 0.4;
/// Standard errors of the refinement by which it contradicts a harmonic in doubt.
const REFINED_SIGMAS: f32 = 4.0;
/// Part of a symmetry period that the fractional-baseline test stops short by.
pub(super) const FRACTION: f32 = 0.35;
/// Shortest baseline of that test in symmetry periods, and how much shorter it is where few events match.
const LEAST_FRACTIONAL: f32 = 1.0 - FRACTION;
const SHORTER: f32 = 0.25;
/// Baseline of the lock as a share of the window.
const LOCK_SHARE: f32 = 2.0 / 3.0;
/// Relative error that the speed is thought to have before the lock: what refinement says, within these.
const LEAST_START: f32 = 1e-3;
const MOST_START: f32 = 1e-2;
/// A step to m periods is safe while three standard errors stay below this share of a period.
const SAFE_SLIP: f32 = 0.33;

impl Measurement {
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn pace(&self) -> Pace {
        Pace {
            disc: self.disc,
            omega_rad_s: self.omega_rad_s,
            parts: u32::from(self.parts.unwrap_or(1)).max(1),
        }
    }

    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn plan(&mut self, window: &Window<'_>, periods: f32, effort: Effort) {
        let plan = Pairs::plan(self.pace(), periods, effort, self.events, window.duration_us);
        self.pairs = Some(plan);
    }

    /// The slope whose path the lock's yaws are brought to: where the speed swings, or what the window begins with is not believed. By
    /// less than witnesses may differ it does not matter, and a path that went astray, as in a hand, would bear itself out.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn leading(&self) -> Option<&Slope> {
        let least_rad_s = LOCK_AGREEMENT * self.omega_rad_s.abs();
        let leads = |slope: &&Slope| slope.swing_rad_s > least_rad_s || slope.unsettled_us > 0.0;
        self.pose.slope().filter(leads).filter(|_| !self.moves())
    }

    /// Plans pairs of the lock. Where a slope leads, they lie behind what is not believed, and their yaws are made those of the window's
    /// mean speed wherever in the window they lie. Elsewhere they lie all over the window, and a steady acceleration cancels.
    // Not inlined: flash is short.
    #[inline(never)]
    fn plan_lock_pairs(&mut self, window: &Window<'_>, periods: f32, effort: Effort) {
        self.plan(window, periods, effort);
        let leading = self.leading().map(|slope| (slope.unsettled_us, slope.beyond_rad_s));
        if let (Some(pairs), Some((unsettled_us, beyond_rad_s))) = (&mut self.pairs, leading) {
            pairs.settle(unsettled_us, window.duration_us as f32);
            pairs.along(beyond_rad_s);
        }
    }

    /// As many pairs as the events are worth, so many of them for each.
    fn worth(&self, least: Effort, pair_events: usize) -> Effort {
        Effort { pairs: least.pairs.max((self.events / pair_events) as u32), ..least }
    }

    /// Plans the refinement.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn plan_refinement(&mut self, window: &Window<'_>) {
        self.plan(window, REFINEMENT_PERIODS, self.worth(REFINEMENT, REFINEMENT_EVENTS));
        self.stage = Stage::Refinement;
    }

    /// Advances the planned pairs; the finished set once all are registered.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn advance(&mut self, window: &Window<'_>, icp: &mut Icp) -> Option<Pairs> {
        let pairs = self.pairs.as_mut()?;
        if pairs.step(window, self.pose.path(), icp) { self.pairs.take() } else { None }
    }

    /// The paper's refinement: step extended to 0.8 of half an angle of symmetry.
    pub(super) fn refinement(&mut self, window: &Window<'_>, settings: &Settings, icp: &mut Icp) {
        let Some(pairs) = self.advance(window, icp) else { return };
        let Some(refined) = pairs.middle() else {
            self.stage = Stage::Queue;
            return;
        };
        self.evidence.refined_rad_s = Some(refined.omega_rad_s);
        self.evidence.refined_sigma_rad_s = Some(refined.sigma_rad_s);
        if self.contradicts(refined) {
            if self.registers() {
                return self.refuse(Reason::Ambiguous);
            }
            self.stage = Stage::Queue;
            return;
        }
        if !settings.all_stages {
            return self.begin_lock(window, refined);
        }
        self.plan(window, REFINEMENT_PERIODS, self.worth(FURTHER, PAIR_EVENTS));
        if let Some(pairs) = &mut self.pairs {
            pairs.retarget(refined.omega_rad_s);
        }
        self.stage = Stage::Further;
    }

    /// Whether a registration within a part of a period gives another speed than the harmonic: by more than the first coarse witness
    /// may be off; or, where the harmonic is in doubt, by what a neighbour of it would show, and by more than its own scatter.
    fn contradicts(&self, refined: Estimate) -> bool {
        let whole = self.omega_rad_s.abs();
        let off = (refined.omega_rad_s - self.omega_rad_s).abs();
        let neighbour = 0.5 * whole / (self.windings as f32 + 1.0);
        off > COARSE_AGREEMENT * whole
            || self.doubted() && off > neighbour.max(REFINED_SIGMAS * refined.sigma_rad_s)
    }

    /// The paper's further refinement, kept to show what it gains.
    pub(super) fn further(&mut self, window: &Window<'_>, icp: &mut Icp) {
        let Some(pairs) = self.advance(window, icp) else { return };
        self.evidence.further_rad_s = pairs.middle().map(|found| found.omega_rad_s);
        let omega_rad_s = self.evidence.refined_rad_s.unwrap_or(self.omega_rad_s);
        let sigma_rad_s = self.evidence.refined_sigma_rad_s.unwrap_or(f32::MAX);
        self.begin_lock(window, Estimate { omega_rad_s, sigma_rad_s });
    }

    /// Plans the first step of the lock of a rotor whose speed is as sure as refinement says.
    fn begin_lock(&mut self, window: &Window<'_>, refined: Estimate) {
        let off_rad_s = (refined.omega_rad_s - self.omega_rad_s).abs();
        let whole = self.omega_rad_s.abs();
        let sigma = refined.sigma_rad_s.max(off_rad_s).max(LEAST_START * whole);
        self.plan_lock(window, sigma.min(MOST_START * whole));
        self.stage = Stage::Lock;
    }

    /// Plans the lock at the longest baseline that cannot slip a period while the speed is known to `sigma_rad_s`.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn plan_lock(&mut self, window: &Window<'_>, sigma_rad_s: f32) {
        let pace = self.pace();
        let periods = window.duration_us as f32 / pace.period_us();
        let safe = SAFE_SLIP * pace.omega_rad_s.abs() / (3.0 * sigma_rad_s);
        let longest = LOCK_SHARE * periods;
        let mut m = crate::math::floor(longest.min(safe)).max(1.0);
        // Where the parts differ, only a whole revolution brings back the same picture.
        let parts = pace.parts as f32;
        if !self.alike && m >= parts {
            m = crate::math::floor(m / parts) * parts;
        }
        let effort = if self.follows {
            FOLLOWING
        } else if longest > MORE * m {
            ON_THE_WAY
        } else {
            self.worth(LOCK, PAIR_EVENTS)
        };
        self.plan_lock_pairs(window, m, effort);
    }

    /// Long-baseline lock.
    pub(super) fn lock(&mut self, window: &Window<'_>, icp: &mut Icp) {
        let Some(pairs) = self.advance(window, icp) else { return };
        let longest = pairs.periods();
        if let Some(found) = pairs.mean() {
            self.lock_baseline_s = pairs.baseline_s();
            self.evidence.lock_rad_s = Some(found.omega_rad_s);
            self.evidence.lock_sigma_rad_s = Some(found.sigma_rad_s);
            self.omega_rad_s = found.omega_rad_s;
            let sigma = found.sigma_rad_s.max(found.omega_rad_s.abs() * 1e-5);
            self.plan_lock(window, sigma);
            if self.pairs.as_ref().is_some_and(|next| next.periods() > MORE * longest) {
                return;
            }
        }
        let effort = if self.follows { FRACTIONAL_FOLLOWING } else { FRACTIONAL };
        self.turn = 0;
        self.plan_lock_pairs(window, (longest - FRACTION).max(LEAST_FRACTIONAL), effort);
        self.stage = Stage::Fractional;
    }

    /// Fractional-baseline test: an alias fits at whole periods and nowhere between.
    pub(super) fn fractional(&mut self, window: &Window<'_>, icp: &mut Icp) {
        let Some(pairs) = self.advance(window, icp) else { return };
        self.evidence.fractional_deviation = pairs.deviation();
        if self.turn == 0 && !self.follows && !self.fits_between() {
            self.turn = 1;
            let mut periods = pairs.periods();
            if pairs.deviation().is_none() {
                // Too few events match: a shorter baseline leaves room for more periods in a slice.
                let parts = self.pace().parts as f32;
                let whole = crate::math::floor(SHORTER * periods / parts) * parts;
                periods = (whole - FRACTION).max(LEAST_FRACTIONAL);
            }
            self.plan_lock_pairs(window, periods, FRACTIONAL_AGAIN);
            return;
        }
        self.stage = Stage::Queue;
    }
}

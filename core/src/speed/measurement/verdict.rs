//! The verdict on a rotor: what the witnesses say together, or why they do not.

use super::super::baseline::Estimate;
use super::baselines::FRACTION;
use super::error_bar::{MOST_ERROR, MOST_LOCK_SIGMA, QUEUE_SIGMA, STILL_PX_S};
use super::{ENOUGH, Measurement, Stage};
use crate::math::{TAU, larger, sqrt};
use crate::reading::{Reason, Status};
use crate::settings::Settings;
use crate::speed::angular::AngularSums;
use crate::speed::filling::Filling;
use crate::speed::folding::{comes_in_bursts, looks_seldom};
use crate::speed::queue::{Busy, busy, held};
use crate::speed::statistics::root_sum_square;
use crate::store::Window;

/// Farthest deviation of the fractional-baseline test where the harmonic is in doubt, as a share of the angle of symmetry; or
/// half of what a speed by one winding more would show, where that is more: this fraction of the difference of the two angles.
const MOST_DEVIATION: f32 = 0.03;
/// The same where no other harmonic keeps step: a third of what a pattern shows that does not turn at all. Jitter of a tenth of a
/// fast rotor's period makes its registrations scatter by as much as the next winding would.
const MOST_CLEAR_DEVIATION: f32 = 0.35 * FRACTION;
/// Witnesses of the lock may differ by this much, or by eight standard errors.
pub(super) const LOCK_AGREEMENT: f32 = 2e-3;
const LOCK_SIGMAS: f32 = 8.0;
/// The refinement may differ from them by this much, or by five standard errors: the next harmonic of eight would by a ninth, and thin
/// slices of a fast rotor that is looked at from aside fall short by a twentieth.
const REFINED_AGREEMENT: f32 = 0.1;
const REFINED_SIGMAS: f32 = 5.0;
/// Standard errors by which it denies a speed all the same, where it is within the other of the next harmonic's.
const REFINED_OFF_SIGMAS: f32 = 1.5;
const REFINED_RIVAL_SIGMAS: f32 = 1.0;
/// Standard error of a lock in symmetry periods from which on it may have slipped one: half a period is three of it. In random scenes of small
/// rotors in a hand four in a thousand right ones reach it, and seven of eight that bore out a wrong speed.
const MOST_SLIP: f32 = 0.15;
/// Relative error to which a lock that does not go along the phase's path is believed whatever the phase's is.
const OWN_SIGMA: f32 = 1e-3;
/// Correlation of the witnesses' errors, as seen where both are known: the lock registers a part of the events that the phase is
/// followed by.
const IN_COMMON: f32 = 0.2;
/// So many standard errors apart, witnesses of a lock are nothing unusual.
const USUAL_SIGMAS: f32 = 2.0;
/// Share of a coarse reading's error that is left where the witnesses of the lock agree.
const ALIKE_SIGMA: f32 = 0.2;
/// A coarse reading's phase must give its speed and be straight within these shares, and the initial alignment of
/// every segment must give it within the last.
const COARSE_PHASE: f32 = 0.05;
const COARSE_PHASE_SIGMA: f32 = 0.03;
const COARSE_SPREAD: f32 = 0.5;
/// What shadows, flicker and folded slices may bias a registration by, in radians: a fifth of a pixel half-way to the rim.
const BIAS_RAD: f32 = 5e-3;
/// Patterns that pass more slowly are told by any sensor that tells anything: one that looks every 2 ms.
const SLOW_HZ: f32 = 250.0;

impl Measurement {
    /// Asks how the queue of a readout filled that is busy from the start of the stream on.
    pub(super) fn queue(
        &mut self,
        window: &Window<'_>,
        filling: &mut Filling,
        angular: &mut AngularSums,
    ) {
        if window.is_first() && busy(window) == Busy::AllThrough {
            let omega_rad_s = self.evidence.phase_rad_s.unwrap_or(self.omega_rad_s);
            let filled =
                filling.step(window, self.disc, omega_rad_s, self.harmonic, &mut angular.sums[0]);
            let Some(filled) = filled else { return };
            self.filling = filled;
        }
        self.stage = Stage::Verdict;
    }

    /// Combines the witnesses of the lock, or says why the reading stays coarse.
    pub(super) fn verdict(&mut self, window: &Window<'_>, settings: &Settings) {
        let witness = |omega: Option<f32>, sigma: Option<f32>| {
            Some(Estimate { omega_rad_s: omega?, sigma_rad_s: sigma? })
        };
        let lock = witness(self.evidence.lock_rad_s, self.evidence.lock_sigma_rad_s)
            .map(|lock| self.with_bias(lock));
        // One that may be farther off than any reading may be bears nothing out.
        let phase = witness(self.evidence.phase_rad_s, self.evidence.phase_sigma_rad_s)
            .filter(|phase| phase.sigma_rad_s < MOST_ERROR * phase.omega_rad_s.abs());
        let window_s = window.duration_us as f32 * 1e-6;
        // Parts that differ may be miscounted: at least one blade passes in a turn.
        let parts = self.parts.filter(|_| self.alike).unwrap_or(1);
        let passes = f32::from(parts) * self.omega_rad_s.abs() * window_s / TAU;
        let held = held(window, self.disc, passes, self.filling);
        // Of late events, the speed is that of as long before.
        let changed = self.alpha_rad_s2.unwrap_or(0.0) * window_s * held.late / self.omega_rad_s;
        // Where its path goes astray as the queue fills, the speed seems to swing.
        let swing_rad_s = self.evidence.swing_rad_s.filter(|_| held.late > 0.0).unwrap_or(0.0);
        let stretch = larger(held.stretch, swing_rad_s / self.omega_rad_s.abs());
        let held_up = QUEUE_SIGMA * (stretch + changed.abs());
        self.filled = held.filled;
        // What jitter leads astray says nothing, nor does what agrees with anything.
        let lock = lock.filter(|lock| {
            !self.is_vague(*lock)
                && !self.slips(*lock)
                && (self.registers() || self.bears_out(*lock, phase))
        });
        if let (Some(lock), Some(phase)) = (lock, phase) {
            // The phase follows all the events that the lock registers some of, and shows how the speed changed meanwhile, which the
            // lock's scatter does not: the lock is no surer. But a path that goes astray where half the window shows no rotor says
            // nothing against a lock that does not go along it.
            let own = if self.leading().is_some() { 1.0 } else { OWN_SIGMA };
            let least = phase.sigma_rad_s.min(own * lock.omega_rad_s.abs());
            let witness = Estimate { sigma_rad_s: lock.sigma_rad_s.max(least), ..lock };
            let both = combine(witness, phase, 1.0);
            let sharp = both.sigma_rad_s.max(held_up * both.omega_rad_s.abs())
                < MOST_LOCK_SIGMA * both.omega_rad_s.abs();
            let long = self.wanted_us <= ENOUGH * window.duration_us as f32;
            let denied = self.registers() && self.refinement_denies(phase.omega_rad_s);
            // A neighbour of the right harmonic, too, is borne out by few turns, and so is what moves behind a rotor in a hand, where
            // another harmonic keeps step almost as well; the next window shows more.
            let early =
                !long && (self.doubted() && !self.pose.has_overtone() || self.closely_rivalled());
            if denied || early || !self.bears_out(lock, Some(phase)) {
                self.status = Status::Refused(Reason::Ambiguous);
            } else if sharp && long {
                self.estimate = combine(witness, phase, USUAL_SIGMAS);
                self.status = Status::Locked;
            } else if sharp {
                // Right if the parts are as alike as they look: the window shows too few to be sure.
                let spread = ALIKE_SIGMA * self.estimate.sigma_rad_s;
                let sigma_rad_s = root_sum_square(both.sigma_rad_s, spread);
                self.estimate = Estimate { sigma_rad_s, ..both };
            } else {
                // Too rough for a lock, and no better than either.
                let spread = self.estimate.sigma_rad_s;
                let sigma_rad_s = root_sum_square(both.sigma_rad_s, spread);
                self.estimate = Estimate { sigma_rad_s, ..both };
            }
        }
        if phase.is_none() || (lock.is_none() && !self.coarse_stands(phase)) {
            self.status = Status::Refused(Reason::Ambiguous);
        }
        if let (None, Some(phase)) = (lock, phase) {
            // Both follow the same events: neither is surer than the phase, whose scatter shows how few there are.
            let sigma_rad_s = self.estimate.sigma_rad_s.max(phase.sigma_rad_s);
            let both = combine(Estimate { sigma_rad_s, ..self.estimate }, phase, 1.0);
            self.estimate = Estimate { sigma_rad_s: both.sigma_rad_s.max(sigma_rad_s), ..both };
        }
        self.take_out_growth();
        self.widen(window, settings, held_up, lock.is_some());
        if self.is_folded(window) {
            self.status = Status::Refused(Reason::Ambiguous);
        }
    }

    /// Takes the turn out that growth makes of curved blades: all witnesses follow edges at a given distance from the axis.
    fn take_out_growth(&mut self) {
        let Estimate { omega_rad_s, sigma_rad_s } = self.pose.approach().speed;
        if sigma_rad_s > 0.0 {
            self.estimate.omega_rad_s += omega_rad_s;
            self.estimate.sigma_rad_s = root_sum_square(self.estimate.sigma_rad_s, sigma_rad_s);
        }
    }

    /// Whether the sensor looks too seldom to tell how fast the pattern passes.
    // Not inlined: flash is short.
    #[inline(never)]
    fn is_folded(&self, window: &Window<'_>) -> bool {
        let windings = self.parts.filter(|_| self.alike).map_or(self.windings, u32::from);
        let passes_hz = windings as f32 * self.omega_rad_s.abs() / TAU;
        let most_us = 0.5e6 / passes_hz;
        comes_in_bursts(window, most_us)
            || passes_hz > SLOW_HZ && looks_seldom(window, self.disc, most_us)
    }

    /// Whether the lock bears the phase out, and the rotor is where it should be between whole periods.
    // Not inlined: flash is short.
    #[inline(never)]
    fn bears_out(&self, lock: Estimate, phase: Option<Estimate>) -> bool {
        phase.is_some_and(|phase| {
            let apart = (lock.omega_rad_s - phase.omega_rad_s).abs();
            let (a, b) = (lock.sigma_rad_s, phase.sigma_rad_s);
            let most = LOCK_SIGMAS * sqrt(a * a + b * b);
            apart < (LOCK_AGREEMENT * lock.omega_rad_s.abs()).max(most) && self.fits_between()
        })
    }

    /// Whether the lock scatters so far, beyond what jitter makes, that it may have slipped a period. Then it agrees with any phase, that of
    /// an axis that went astray in a hand, too.
    fn slips(&self, lock: Estimate) -> bool {
        let parts = (self.pace().parts * self.uncounted()) as f32;
        let scatter_rad = lock.sigma_rad_s * self.lock_baseline_s * parts;
        scatter_rad > MOST_SLIP * TAU + self.scatter_rad()
    }

    /// Whether the lock of what may stray may be farther off than any reading may be. Then the phase stands alone, which takes what a hand
    /// moves the axis by for a mark's own turn, or that of blurred edges.
    fn is_vague(&self, lock: Estimate) -> bool {
        (self.parts == Some(1) || self.may_stray())
            && lock.sigma_rad_s > MOST_ERROR * lock.omega_rad_s.abs()
    }

    /// Whether the path may have gone astray in a hand: edges are blurred, noise and all. Those of a motor that hunts are not, along its own.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn may_stray(&self) -> bool {
        self.drift_px_s > STILL_PX_S && !self.clearly_sharp()
    }

    /// Whether the refinement, which knows nothing of harmonics, saw another speed: about a wrong centre a neighbour of the right
    /// harmonic keeps step, and leads the lock to its own speed.
    // Not inlined, as other things that are asked once a reading: flash is short.
    #[inline(never)]
    fn refinement_denies(&self, omega_rad_s: f32) -> bool {
        let (Some(refined), Some(sigma)) =
            (self.evidence.refined_rad_s, self.evidence.refined_sigma_rad_s)
        else {
            return false;
        };
        let off = refined / omega_rad_s - 1.0;
        let sigma = sigma / omega_rad_s.abs();
        // The speed by one winding less is higher, by one more lower.
        let rival = 1.0 / (self.windings as f32 - 1.0_f32.copysign(off));
        let is_rival = off.abs() > REFINED_OFF_SIGMAS * sigma
            && (off.abs() - rival).abs() < REFINED_RIVAL_SIGMAS * sigma;
        // What is left of a flickering lamp's events leads astray what else tells a harmonic from its neighbour.
        let vague = self.by_lamp && sigma > 0.5 / (self.windings as f32 + 1.0);
        is_rival
            || vague && self.closely_rivalled()
            || off.abs() > (REFINED_SIGMAS * sigma).max(REFINED_AGREEMENT)
    }

    /// Whether the rotor is also where it should be between whole periods, where an alias is not.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn fits_between(&self) -> bool {
        let half_way = 0.5 * FRACTION / (self.windings as f32 + 1.0);
        let most = if self.doubted() { half_way.max(MOST_DEVIATION) } else { MOST_CLEAR_DEVIATION };
        self.evidence.fractional_deviation.is_some_and(|d| d * (self.uncounted() as f32) < most)
    }

    /// Parts in what counts as one: where they were not counted, at least as many as the windings of the line.
    fn uncounted(&self) -> u32 {
        if self.parts.is_none() { self.windings.max(1) } else { 1 }
    }

    /// Adds to the lock's error what may bias all its registrations alike.
    fn with_bias(&self, lock: Estimate) -> Estimate {
        let bias = BIAS_RAD / self.lock_baseline_s.max(f32::MIN_POSITIVE);
        Estimate { sigma_rad_s: root_sum_square(lock.sigma_rad_s, bias), ..lock }
    }

    /// Whether all segments turn alike, as far as registration tells.
    fn rates_alike(&self, omega: f32) -> bool {
        let alike = |rate: &f32| (rate - omega).abs() < COARSE_SPREAD * omega.abs();
        !self.rates.is_empty() && self.rates.iter().all(alike)
    }

    /// Whether a reading without a lock may stand: it has no long baseline to contradict it, so the phase must advance
    /// evenly through the window, and all segments must turn alike.
    fn coarse_stands(&self, phase: Option<Estimate>) -> bool {
        let omega = self.estimate.omega_rad_s;
        let even = phase.is_some_and(|phase| {
            (phase.omega_rad_s - omega).abs() < COARSE_PHASE * omega.abs()
                && phase.sigma_rad_s < COARSE_PHASE_SIGMA * omega.abs()
        });
        even && !self.doubted() && (self.rates_alike(omega) || self.sharp())
    }
}

/// Mean weighted by the inverse variances, of witnesses whose errors have something in common, and which may be so many standard
/// errors apart.
// Not inlined: flash is short.
#[inline(never)]
pub(super) fn combine(a: Estimate, b: Estimate, usual_sigmas: f32) -> Estimate {
    let (va, vb) = (a.sigma_rad_s * a.sigma_rad_s, b.sigma_rad_s * b.sigma_rad_s);
    let (wa, wb) = (vb / (va + vb), va / (va + vb));
    // Where they are farther apart than their errors say, these are too small by as much (Birge's ratio).
    let apart = (a.omega_rad_s - b.omega_rad_s) / usual_sigmas;
    let (ea, eb) = (wa * a.sigma_rad_s, wb * b.sigma_rad_s);
    let variance = ea * ea + eb * eb + 2.0 * IN_COMMON * ea * eb;
    Estimate {
        omega_rad_s: a.omega_rad_s * wa + b.omega_rad_s * wb,
        sigma_rad_s: sqrt(variance * (apart * apart / (va + vb)).max(1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotors::Found;

    #[test]
    fn witnesses_that_contradict_each_other_are_less_sure_together() {
        let told = |omega_rad_s, sigma_rad_s| Estimate { omega_rad_s, sigma_rad_s };
        let alike = combine(told(100.0, 1.0), told(100.5, 1.0), 1.0);
        assert!((alike.omega_rad_s - 100.25).abs() < 1e-3 && alike.sigma_rad_s < 1.0);
        let apart = combine(told(100.0, 1.0), told(110.0, 1.0), 1.0);
        assert!((apart.omega_rad_s - 105.0).abs() < 1e-3 && apart.sigma_rad_s > 4.0);
        let rough = combine(told(100.0, 1.0), told(110.0, 100.0), 1.0);
        assert!((rough.omega_rad_s - 100.0).abs() < 0.01 && rough.sigma_rad_s < 1.1);
    }

    #[test]
    fn by_a_lamp_the_refinement_must_tell_a_harmonic_from_its_rival() {
        let denies = |lamp_hz, dark, refined_sigma_rad_s| {
            let found = Found { omega_rad_s: 20.0, windings: 2, ..Found::default() };
            let mut rivalled = Measurement::new(&found, lamp_hz, dark);
            rivalled.evidence.scan_standing = Some(0.74);
            rivalled.evidence.refined_rad_s = Some(18.0);
            rivalled.evidence.refined_sigma_rad_s = Some(refined_sigma_rad_s);
            rivalled.refinement_denies(20.0)
        };
        assert!(denies(120.0, true, 5.0) && denies(120.0, false, 5.0) && denies(0.0, true, 5.0));
        assert!(!denies(120.0, true, 2.0) && !denies(0.0, false, 5.0));
    }
}

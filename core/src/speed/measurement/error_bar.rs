//! The error bar: what the witnesses of a speed do not know of, and may be off by all the same.

use super::super::baseline::Estimate;
use super::verdict::combine;
use super::{ACCELERATION_SIGMAS, ENOUGH, Measurement};
use crate::math::{TAU, sqrt};
use crate::reading::{Evidence, Reason, Status};
use crate::settings::Settings;
use crate::speed::statistics::root_sum_square;
use crate::store::Window;
use crate::tachometer::BASE_WINDOW_US;

/// Own standard errors beyond which a lock's two witnesses contradict each other from a moving camera: one of them went astray with the axis.
const ASTRAY_SIGMAS: f32 = 4.0;
/// A lock with a larger relative error is only coarse.
pub(super) const MOST_LOCK_SIGMA: f32 = 3e-3;
/// No reading may be farther off than this, relative. All that a busy readout's queue may stretch the window by fits into it, and so
/// many standard errors: of a coarse one, the camera's roll among them, and of a lock, where what a single mark's axis may do at most is
/// among them.
pub(super) const MOST_ERROR: f32 = 0.01;
const COARSE_SIGMAS: f32 = 3.0;
const LOCK_FITS_SIGMAS: f32 = 2.5;
/// Standard error of a coarse reading as a share of how much its speed seems to swing; and what of that counts as error of a mark's lock
/// before a hand that sways as fast as the mark turns.
const UNEVEN_SHARE: f32 = 0.5;
const MARK_SWING: f32 = 0.35;
/// The largest relative error where the stream ended before its first window was full: no other will tell.
const MOST_SHORT_SIGMA: f32 = 0.012;
/// What a hand shakes, in pixels, and blocks of a turn from which on a single mark's axis is told from the mark.
const SHAKE_PX: f32 = 3.0;
const MARK_BLOCKS: usize = 4;
/// What a hand sways at a frequency near the turn's, in pixels, and the speed in rad/s up to which it does: 15 Hz. Faster, it sways less,
/// as the square of that: muscles shake what has a mass. Of a single mark, it looks like a turn that is not even, however closely it is
/// followed.
const SWAY_PX: f32 = 2.0;
const SWAYING_RAD_S: f32 = 15.0 * TAU;
/// Standard deviation of the error by a busy readout, as a share of how far its queue may stretch the window.
pub(super) const QUEUE_SIGMA: f32 = 0.5;
/// Roll of a hand-held camera for each pixel of shift, which has two directions where roll has one: tremor turns the camera by about
/// one milliradian as it shifts the image by one pixel along either.
const ROLL_RAD_PER_PX: f32 = 1e-3 / core::f32::consts::SQRT_2;
/// Slower wandering of the centre than this in px/s is the measurement's own noise.
pub(super) const STILL_PX_S: f32 = 6.0;
/// The same of a single mark, whose path may take a part of the hand's motion for its turn.
const MARK_STILL_PX_S: f32 = 4.0;
/// Window over which the mean roll rate of a tremor of 1 to 12 Hz, from which longer ones keep the less, is what it is at an instant.
const ROLL_LASTS_S: f32 = 0.067;
/// Each half of a window holds twice the roll of the whole, so the halves differ by the root of eight of it, half a window apart.
const ROLL_APART: f32 = 5.7;

impl Measurement {
    /// Adds what the witnesses do not know of to the error, clock, camera and readout, or refuses where that is too much.
    pub(super) fn widen(
        &mut self,
        window: &Window<'_>,
        settings: &Settings,
        held_up: f32,
        locks: bool,
    ) {
        let window_s = window.duration_us as f32 * 1e-6;
        let clock = settings.clock_sigma_ppm * 1e-6 * self.estimate.omega_rad_s;
        let roll = if self.drift_px_s > STILL_PX_S {
            ROLL_RAD_PER_PX * self.drift_px_s * roll_share(window_s)
        } else {
            0.0
        };
        // What a hand makes of a steady speed is no acceleration.
        let by_hand = ACCELERATION_SIGMAS * ROLL_APART * roll / window_s;
        self.alpha_rad_s2 = self.alpha_rad_s2.filter(|alpha| alpha.abs() > by_hand);
        if roll > 0.0 && locks {
            self.widen_astray();
        }
        let start_rad_s = self.pose.start_rad_s(window);
        self.estimate.sigma_rad_s = root_sum_square(self.estimate.sigma_rad_s, start_rad_s);
        match self.status {
            Status::Coarse => self.widen_coarse(window, held_up / QUEUE_SIGMA, roll),
            Status::Locked if self.pose.in_period() < MARK_BLOCKS => self.widen_mark(SHAKE_PX),
            // Blurred edges tell of an axis that moves and was not followed.
            Status::Locked if self.drift_px_s > MARK_STILL_PX_S || !self.sharp() => {
                self.steady_mark();
            }
            _ => {}
        }
        // What an axis that is not followed may do counts for less, the more turns there are: a longer window tells.
        let rough = self.estimate.sigma_rad_s / self.omega_rad_s.abs();
        let most = MOST_ERROR / LOCK_FITS_SIGMAS;
        if self.status == Status::Locked && rough > most {
            self.status = Status::Refused(Reason::TooSlow);
            self.wanted_us = rough / most * window.duration_us as f32;
        }
        let own = self.estimate.sigma_rad_s;
        let late = held_up * self.estimate.omega_rad_s;
        self.estimate.sigma_rad_s = sqrt(own * own + late * late + clock * clock);
        self.roll_sigma_rad_s = roll;
    }

    /// Adds half of what the witnesses of the lock are apart where that is more than their own scatter explains: the truth may be with
    /// either.
    fn widen_astray(&mut self) {
        let Evidence { lock_rad_s, lock_sigma_rad_s, phase_rad_s, phase_sigma_rad_s, .. } =
            self.evidence;
        let apart_rad_s = lock_rad_s.zip(phase_rad_s).map_or(0.0, |(a, b)| (a - b).abs());
        let scatter = lock_sigma_rad_s.zip(phase_sigma_rad_s).map_or(0.0, |(a, b)| a * a + b * b);
        if apart_rad_s > ASTRAY_SIGMAS * sqrt(scatter) {
            let Estimate { omega_rad_s, sigma_rad_s: own } = self.estimate;
            self.estimate.sigma_rad_s = root_sum_square(own, 0.5 * apart_rad_s);
            let sharp = self.estimate.sigma_rad_s < MOST_LOCK_SIGMA * omega_rad_s.abs();
            if self.status == Status::Locked && !sharp {
                self.status = Status::Coarse;
            }
        }
    }

    /// Whether it may be a single mark: two parts that differ may be one, and so may what could not be counted.
    pub(super) fn may_be_mark(&self) -> bool {
        self.parts == Some(1) || !self.alike && self.parts.is_none_or(|parts| parts == 2)
    }

    /// From a hand, both witnesses of a mark's lock go along a path that takes part of the hand's motion for the mark's turn, and its speed
    /// seems to swing by that. The refinement goes along none: it is a third one, and no surer than they are where it does not
    /// swing, however little its few pairs scatter.
    // Not inlined: flash is short.
    #[inline(never)]
    fn steady_mark(&mut self) {
        if !self.may_be_mark() {
            return;
        }
        let swaying = SWAYING_RAD_S / self.estimate.omega_rad_s.abs().max(SWAYING_RAD_S);
        let swaying = swaying * swaying;
        self.widen_mark(SWAY_PX * swaying);
        let Evidence { refined_rad_s, refined_sigma_rad_s, swing_rad_s, .. } = self.evidence;
        let steady = self.estimate.sigma_rad_s;
        let swing = MARK_SWING * swaying * swing_rad_s.unwrap_or(0.0);
        self.estimate.sigma_rad_s = root_sum_square(steady, swing);
        if let (Some(omega_rad_s), Some(own)) = (refined_rad_s, refined_sigma_rad_s) {
            let refined = Estimate { omega_rad_s, sigma_rad_s: own.max(steady) };
            self.estimate = combine(self.estimate, refined, 1.0);
        }
    }

    /// The reading of a single mark is as good as its axis holds still: what the mark does and what the camera does look alike, where it
    /// is not followed around the turn, or a hand sways as fast as it turns.
    // Not inlined: flash is short.
    #[inline(never)]
    fn widen_mark(&mut self, shake_px: f32) {
        if self.may_be_mark() {
            let shake = self.shaken_share(shake_px) * self.omega_rad_s;
            self.estimate.sigma_rad_s = root_sum_square(self.estimate.sigma_rad_s, shake);
        }
    }

    /// By what share a shake of the axis across so many pixels changes the speed of a single mark.
    fn shaken_share(&self, shake_px: f32) -> f32 {
        let turn_rad = self.evidence.periods.unwrap_or(0.0) * TAU;
        shake_px / (self.disc.radius_px * turn_rad)
    }

    /// Whether no reading of it will stand in this window, however it is registered: a single mark in too few turns for a lock, where a
    /// coarse reading would be too rough.
    pub(super) fn is_mark_too_slow(&self, window: &Window<'_>) -> bool {
        self.may_be_mark()
            && self.wanted_us > ENOUGH * window.duration_us as f32
            && self.shaken_share(SHAKE_PX) > most_coarse(window)
    }

    /// A coarse reading that may be farther off than any reading may be is none, as the next window will show more; but where the
    /// stream ended before one was full, it is all there is. `stretch` is the share by which the window may be stretched, the roll
    /// what the camera may turn by.
    fn widen_coarse(&mut self, window: &Window<'_>, stretch: f32, roll_rad_s: f32) {
        self.widen_mark(SHAKE_PX);
        if self.may_be_mark() || self.parts == Some(2) || self.may_stray() {
            // Two blades may be tilted: then they seem to turn unevenly, and parts of a turn tell another speed than whole ones.
            let swing_rad_s = UNEVEN_SHARE * self.evidence.swing_rad_s.unwrap_or(0.0);
            self.estimate.sigma_rad_s = root_sum_square(self.estimate.sigma_rad_s, swing_rad_s);
        }
        let stretched = stretch > MOST_ERROR;
        let sigma_rad_s = root_sum_square(self.estimate.sigma_rad_s, roll_rad_s);
        let rough = sigma_rad_s > most_coarse(window) * self.omega_rad_s.abs();
        if stretched || rough {
            let slow = !stretched && self.wanted_us > window.duration_us as f32;
            let reason = if slow { Reason::TooSlow } else { Reason::Ambiguous };
            self.status = Status::Refused(reason);
        }
    }
}

/// Largest relative standard error of a coarse reading.
fn most_coarse(window: &Window<'_>) -> f32 {
    let short = window.is_first() && window.duration_us < BASE_WINDOW_US;
    if short { MOST_SHORT_SIGMA } else { MOST_ERROR / COARSE_SIGMAS }
}

/// Share of the tremor's roll rate that is left in the mean over a window: tremor swings back and forth at a
/// few hertz, so a longer window averages more of it.
fn roll_share(window_s: f32) -> f32 {
    (ROLL_LASTS_S / window_s).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{MOST_SEGMENTS, MOST_SPARE, Store, StoredEvent};

    #[test]
    fn only_a_stream_that_is_shorter_than_a_window_may_be_told_roughly() {
        let mut memory = [StoredEvent::default(); 16 * MOST_SEGMENTS];
        let mut store = Store::new(&mut memory, MOST_SPARE, 25_000);
        for _ in 0..6 {
            store.close_segment();
        }
        assert_eq!(most_coarse(&store.window(6, 70_000)), MOST_SHORT_SIGMA);
        assert!(most_coarse(&store.window(6, u64::MAX)) < 0.5 * MOST_ERROR);
        store.drop_oldest();
        assert!(most_coarse(&store.window(5, 70_000)) < 0.5 * MOST_ERROR, "one went before");
    }
}

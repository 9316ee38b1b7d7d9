//! Refinement and long-baseline lock: registration of slices a known number of angles of symmetry apart.
//!
//! With the coarse speed and the angle of symmetry, the baseline is extended (paper, "Estimation
//! Refinement") to 0.8 of half an angle of symmetry; and, beyond the paper, to a whole number m of symmetry
//! periods, where the yaw that is left is only m times the error of the speed so far. Pixels then see the same
//! edge twice, so that what is fixed to the pixel (its latency, its place on the grid) cancels.

use heapless::Vec;

use super::initial::median;
use super::path::{Moving, Path};
use super::statistics::{mean_and_error, student_over_normal};
use crate::limits::MAX_PAIRS;
use crate::math::{TAU, ceil, sqrt};
use crate::order::sort_few;
use crate::registration::{Cut, Icp, Progress, Residual};
use crate::rotors::Disc;
use crate::store::Window;

/// Length of a slice in symmetry periods.
const SLICE_PERIODS: f32 = 0.25;
/// Events that a slice should hold; thinner ones are folded over several periods.
const SLICE_EVENTS: f32 = 400.0;
/// Most periods folded into a slice.
const MOST_FOLDS: u32 = 32;
/// Fewest pairs of folded slices, even where fewer lie side by side; no more than are asked for.
const LEAST_PAIRS: u32 = 4;
/// Share of its noise within which a registration of folded slices is settled.
const FOLDED_SETTLED: f32 = 0.3;

/// How much work goes into slice pairs.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Pairs.
    pub pairs: u32,
    /// Events in a slice at most.
    pub points: usize,
    /// A registration ends when an iteration turns by less than this share of its noise.
    pub settled: f32,
}

/// What is known of a rotor when its slices are cut.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Axis and radius.
    pub disc: Disc,
    /// Speed so far in rad/s.
    pub omega_rad_s: f32,
    /// Equal parts of the rotor.
    pub parts: u32,
}

impl Pace {
    /// Symmetry period in microseconds.
    #[must_use]
    pub fn period_us(&self) -> f32 {
        TAU * 1e6 / (self.omega_rad_s.abs() * self.parts as f32)
    }

    /// Angle of symmetry with the sign of the rotation, in radians.
    fn signed_angle_rad(&self) -> f32 {
        TAU / self.parts as f32 * if self.omega_rad_s < 0.0 { -1.0 } else { 1.0 }
    }
}

/// A speed with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Speed in rad/s.
    pub omega_rad_s: f32,
    /// Standard error in rad/s: +/- 1.96 of it covers 95 %.
    pub sigma_rad_s: f32,
}

/// Slice pairs at one baseline, spread over the window, registered one a step.
#[derive(Debug)]
pub struct Pairs {
    pace: Pace,
    /// Baseline in symmetry periods.
    periods: f32,
    effort: Effort,
    next: u32,
    folds: u32,
    /// Whether the next pair is being registered.
    registering: bool,
    /// Mean rate of the path's turn over the window, as the phase tells it, in rad/s; `None`: yaws are taken as they are.
    even_rad_s: Option<f32>,
    /// Time at the window's start that no pair is cut from, where there is room.
    unsettled_us: f32,
    yaws: Vec<f32, MAX_PAIRS>,
    /// How many of the pairs share no slice with another.
    independent: f32,
}

impl Pairs {
    /// Plans slice pairs `periods` symmetry periods apart. `events` is the number of the rotor's events in the window.
    #[must_use]
    pub fn plan(pace: Pace, periods: f32, effort: Effort, events: usize, window_us: u32) -> Self {
        let period_us = pace.period_us();
        let in_slice = events as f32 * SLICE_PERIODS * period_us / window_us.max(1) as f32;
        let room = (window_us as f32 / period_us - periods - SLICE_PERIODS).max(0.0);
        let folds = (SLICE_EVENTS / in_slice.max(1.0)) as u32;
        let folds = folds.clamp(1, MOST_FOLDS).min(1 + (0.5 * room) as u32);
        let span = folds as f32 - 1.0 + SLICE_PERIODS;
        let independent = 1.0 + room / span;
        let mut effort = Effort { pairs: effort.pairs.min(MAX_PAIRS as u32), ..effort };
        if folds > 1 {
            // More pairs than lie side by side look at the same events again.
            effort.pairs = effort.pairs.min((independent as u32).max(LEAST_PAIRS));
            effort.settled = effort.settled.max(FOLDED_SETTLED);
        }
        let independent = independent.min(effort.pairs as f32);
        Self {
            pace,
            periods,
            effort,
            next: 0,
            folds,
            registering: false,
            even_rad_s: None,
            unsettled_us: 0.0,
            yaws: Vec::new(),
            independent,
        }
    }

    /// Cuts the next pair, or advances its registration by one iteration; `true` once all are done.
    /// Cost: at most a million instructions.
    pub fn step(&mut self, window: &Window<'_>, path: &Path, icp: &mut Icp) -> bool {
        if self.next >= self.effort.pairs {
            return true;
        }
        let angle_rad = self.pace.signed_angle_rad();
        let start_rad = (self.periods - crate::math::round(self.periods)) * angle_rad;
        if !self.registering {
            self.cut(window, path, icp);
            let residual = Residual::Helicoid { omega_rad_s: self.pace.omega_rad_s };
            let radius_px = self.pace.disc.radius_px;
            icp.start(start_rad, radius_px, residual, self.effort.settled);
            self.registering = true;
            return false;
        }
        let Progress::Done(found) = icp.step() else { return false };
        if let Some(found) = found {
            self.yaws.push(found.yaw_rad - start_rad - self.bent_rad(window, path)).ok();
        }
        self.registering = false;
        self.next += 1;
        self.next >= self.effort.pairs
    }

    /// Time from one pair's start to the next's: the pairs fill the window. Where they overlap, the second slice of one is the
    /// first of another, so that what its events are off by cancels.
    fn apart_us(&self, room_us: f32) -> f32 {
        let apart_us = room_us / (self.effort.pairs.max(2) - 1) as f32;
        let baseline_us = self.periods * self.pace.period_us();
        if apart_us > 0.0 && apart_us < baseline_us && baseline_us < room_us {
            baseline_us / ceil(baseline_us / apart_us)
        } else {
            apart_us
        }
    }

    /// Takes from each yaw what the pair turned by beyond the mean over the window, where the speed changes: by the path, whose turn has
    /// this mean rate.
    pub const fn along(&mut self, even_rad_s: f32) {
        self.even_rad_s = Some(even_rad_s);
    }

    /// Cuts no pair from so long a time at the window's start, where there is room for two that share no slice.
    pub fn settle(&mut self, unsettled_us: f32, window_us: f32) {
        let span = self.folds as f32 - 1.0 + SLICE_PERIODS;
        let room = (window_us - unsettled_us) / self.pace.period_us() - self.periods - span;
        if room >= span {
            self.unsettled_us = unsettled_us;
            self.independent = (1.0 + room / span).min(self.effort.pairs as f32);
        }
    }

    /// Baseline and span of a slice, in microseconds, and when the next pair starts.
    // Not inlined: flash is short.
    #[inline(never)]
    fn times_us(&self, window: &Window<'_>) -> (f32, f32, f32) {
        let period_us = self.pace.period_us();
        let baseline_us = self.periods * period_us;
        let span_us = (self.folds as f32 - 1.0 + SLICE_PERIODS) * period_us;
        let settled_us = window.duration_us as f32 - self.unsettled_us;
        let room_us = (settled_us - baseline_us - span_us).max(0.0);
        (baseline_us, span_us, self.unsettled_us + self.apart_us(room_us) * self.next as f32)
    }

    /// By how much the pair turns beyond the window's mean speed, along the path.
    fn bent_rad(&self, window: &Window<'_>, path: &Path) -> f32 {
        let Some(even_rad_s) = self.even_rad_s else { return 0.0 };
        let (baseline_us, span_us, start_us) = self.times_us(window);
        let first_us = start_us + 0.5 * (span_us - window.duration_us as f32);
        let turned_rad = path.at(first_us + baseline_us).turn_rad - path.at(first_us).turn_rad;
        turned_rad - even_rad_s * baseline_us * 1e-6
    }

    /// Cuts the two slices of the next pair.
    fn cut(&self, window: &Window<'_>, path: &Path, icp: &mut Icp) {
        let period_us = self.pace.period_us();
        let (baseline_us, _, start_us) = self.times_us(window);
        let disc = Moving::new(self.pace.disc, path, window);
        let mut cut = Cut {
            start_us,
            length_us: SLICE_PERIODS * period_us,
            period_us,
            folds: self.folds,
            most: self.effort.points,
        };
        cut.collect(window, disc, &mut icp.first);
        cut.start_us += baseline_us;
        cut.collect(window, disc, &mut icp.second);
    }

    /// Starts the registrations from another speed, at the same baseline.
    pub fn retarget(&mut self, omega_rad_s: f32) {
        self.pace.omega_rad_s = omega_rad_s;
    }

    /// Baseline in symmetry periods.
    #[must_use]
    pub const fn periods(&self) -> f32 {
        self.periods
    }

    /// Baseline in seconds.
    #[must_use]
    pub fn baseline_s(&self) -> f32 {
        self.periods * self.pace.period_us() * 1e-6
    }

    /// Factor on the standard error of the mean: Student's t, and pairs that share events.
    fn widening(&self) -> f32 {
        // Pairs that did not register bear nothing out.
        let registered = self.yaws.len() as f32;
        let independent = self.independent.min(registered);
        let shared = sqrt(registered / independent.max(1.0));
        shared * student_over_normal((independent as usize).saturating_sub(1))
    }

    /// Speed from the mean of the yaws; its error from their scatter.
    #[must_use]
    pub fn mean(&self) -> Option<Estimate> {
        let (mean, error) = mean_and_error(&self.yaws)?;
        Some(Estimate {
            omega_rad_s: self.pace.omega_rad_s + mean / self.baseline_s(),
            sigma_rad_s: self.widening() * error / self.baseline_s(),
        })
    }

    /// Speed from the mean of the middle half of the yaws, which a slice pair gone astray does not move: the median would
    /// waste a third of them.
    #[must_use]
    pub fn middle(&self) -> Option<Estimate> {
        let mut yaws = self.yaws.clone();
        sort_few(&mut yaws, |a, b| a < b);
        let outer = yaws.len() / 4;
        let (middle, _) = mean_and_error(yaws.get(outer..yaws.len() - outer)?)?;
        let (_, error) = mean_and_error(&self.yaws)?;
        // Of normal errors it scatters 1.1 times as much as the mean of all.
        Some(Estimate {
            omega_rad_s: self.pace.omega_rad_s + middle / self.baseline_s(),
            sigma_rad_s: 1.1 * self.widening() * error / self.baseline_s(),
        })
    }

    /// Mean deviation from the predicted yaw, as a share of the angle of symmetry.
    #[must_use]
    pub fn deviation(&self) -> Option<f32> {
        let mut yaws = self.yaws.clone();
        Some(median(&mut yaws)?.abs() * self.pace.parts as f32 / TAU)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 pairs of 0.4 symmetry periods in a window of ten: a speed of 60 rpm in three parts.
    fn pairs() -> Pairs {
        let disc = Disc { x_px: 100.0, y_px: 100.0, radius_px: 50.0 };
        let pace = Pace { disc, omega_rad_s: TAU, parts: 3 };
        let effort = Effort { pairs: 40, points: 512, settled: 0.1 };
        Pairs::plan(pace, 0.4, effort, 100_000, (10.0 * pace.period_us()) as u32)
    }

    #[test]
    fn the_second_slice_of_a_pair_is_the_first_of_a_later_one() {
        let pairs = pairs();
        let baseline_us = 1e6 * pairs.baseline_s();
        let room_us = 9.0 * pairs.pace.period_us();
        let apart_us = pairs.apart_us(room_us);
        let later = baseline_us / apart_us;
        assert!((later - crate::math::round(later)).abs() < 1e-3, "{later}");
        assert!(39.0 * apart_us <= room_us, "{apart_us}");
        // Where the window holds no later one, the pairs fill it.
        let short_us = 0.5 * baseline_us;
        assert!((39.0 * pairs.apart_us(short_us) - short_us).abs() < 1.0);
    }

    #[test]
    fn pairs_lie_behind_what_has_not_settled_and_fewer_are_independent() {
        let (mut behind, mut nowhere) = (pairs(), pairs());
        let (before, period_us) = (behind.independent, behind.pace.period_us());
        let window_us = 10.0 * period_us;
        behind.settle(8.0 * period_us, window_us);
        // Slices of a quarter of a period, 0.4 apart, begin within 1.35 periods.
        assert!(before > 30.0 && (behind.independent - 6.4).abs() < 0.01, "{behind:?}");
        nowhere.settle(9.3 * period_us, window_us);
        assert!(nowhere.unsettled_us == 0.0 && nowhere.independent == before, "{nowhere:?}");
    }

    #[test]
    fn pairs_that_did_not_register_bear_nothing_out() {
        let mut pairs = pairs();
        let independent = pairs.independent;
        assert!(independent > 3.0, "{independent}");
        for yaw in [-1e-3, 1e-3] {
            pairs.yaws.push(yaw).ok();
        }
        // Two tell no more than two, however many were planned: one degree of freedom.
        assert_eq!(pairs.widening(), student_over_normal(1));
        assert!(pairs.widening() > 6.0);
    }

    #[test]
    fn pairs_gone_astray_do_not_move_the_middle() {
        let mut pairs = pairs();
        for n in 0..16_i8 {
            pairs.yaws.push(1e-3 * f32::from(n % 5 - 2)).ok();
        }
        let straight = pairs.middle().unwrap_or_default();
        for _ in 0..4 {
            pairs.yaws.push(0.5).ok();
        }
        let with_astray = pairs.middle().unwrap_or_default();
        let off_rad = (with_astray.omega_rad_s - straight.omega_rad_s).abs() * pairs.baseline_s();
        assert!(off_rad < 1e-3, "{off_rad}");
    }
}

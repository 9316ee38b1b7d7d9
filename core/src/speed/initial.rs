//! Initial alignment (paper, "Initial Estimation"): the speed of a rotor nothing is known about, by registration.
//!
//! The paper steps by a fixed 1 ms, which is right for one range of speeds. Here slices hold a fixed *number* of
//! events, so that the time they take fits the rotor by itself, and the first slice of a segment is registered to the
//! second, third, ...: as the store thins a segment octave by octave, the baseline grows
//! geometrically, each step started from the rate before.
//!
//! The axis is held *fixed*: then a single mark on a disc is enough to see.

use core::ops::Range;

use heapless::Vec;

use super::path::{Moving, Path};
use crate::order::sort_few;
use crate::registration::{Icp, Progress, Registered, Residual, Slice, SlicePoint};
use crate::rotors::Disc;
use crate::store::{WINDOW_SEGMENTS, Window};
use crate::thinning::Thinning;

/// Events in a slice at best.
const MOST_EVENTS: usize = 512;
/// Events in a slice at least.
const LEAST_EVENTS: usize = 24;
/// Slices that a segment should hold.
const SLICES: usize = 8;
/// Most levels.
const MOST_LEVELS: u8 = 16;
/// A later slice is cut from this share of the events before it, so that the baseline grows geometrically.
const GROWTH: f32 = 0.4;
/// A level may change the rate by this factor at most, else the match jumped to another blade.
const MOST_CHANGE: f32 = 0.5;
/// Motion of the rim between the slices that is larger than the noise of a registration.
const SEEN_PX: f32 = 3.0;
/// Farthest turn between the slices, and farthest turn within the later slice, in radians.
const MOST_TURN_RAD: f32 = 1.2;
const MOST_BLUR_RAD: f32 = 0.5;

/// Share of a registration's noise below which a turn is the last.
const SETTLED: f32 = 0.1;

/// Speed by each burst, in rad/s.
pub type Rates = Vec<f32, WINDOW_SEGMENTS>;

/// A ladder on one segment, one level a step.
#[derive(Clone, Copy, Debug)]
pub struct Ladder {
    segment: usize,
    disc: Disc,
    /// Events in a slice.
    size: usize,
    /// Events that the slices so far were cut from.
    passed: usize,
    level: u8,
    first_us: f32,
    /// Baseline of the level that is being registered; 0 between levels.
    baseline_s: f32,
    rate: Option<f32>,
    /// Whether the rate rests on a motion large enough to judge the next by.
    seen: bool,
}

impl Ladder {
    /// A ladder at the bottom.
    #[must_use]
    pub const fn new(segment: usize, disc: Disc) -> Self {
        Self {
            segment,
            disc,
            size: 0,
            passed: 0,
            level: 0,
            first_us: 0.0,
            baseline_s: 0.0,
            rate: None,
            seen: false,
        }
    }

    /// The rate so far in rad/s, positive = clockwise.
    #[must_use]
    pub const fn rate_rad_s(&self) -> Option<f32> {
        self.rate
    }

    /// Moves a range of the rotor's events of the segment, placed and thinned to about `most`, into a slice.
    // Not inlined: flash is short.
    #[inline(never)]
    fn take(
        &self,
        window: &Window<'_>,
        path: &Path,
        range: Range<usize>,
        most: usize,
        slice: &mut Slice,
    ) -> Taken {
        slice.clear();
        let mut disc = Moving::new(self.disc, path, window);
        let mut thinning = Thinning::new(most, range.len());
        let (mut count, mut sum_us, mut from_us, mut to_us) = (0, 0.0_f32, None, 0);
        for event in window.segment(self.segment) {
            let Some((x_px, y_px, _)) = disc.place(*event) else { continue };
            if count == range.end {
                break;
            }
            count += 1;
            if count > range.start && thinning.keeps_next() {
                let t_us = event.since(window.start_us);
                slice.push(SlicePoint { x_px, y_px, tau_s: 0.0, on: window.is_on(*event) }).ok();
                sum_us += t_us as f32;
                from_us = from_us.or(Some(t_us));
                to_us = t_us;
            }
        }
        Taken {
            count,
            mean_us: sum_us / slice.len().max(1) as f32,
            span_us: (to_us - from_us.unwrap_or(to_us)) as f32,
        }
    }

    /// Cuts the slices of the next level, or advances their registration by one iteration; `true` at the top.
    /// Cost: at most half a million instructions.
    pub fn step(&mut self, window: &Window<'_>, path: &Path, icp: &mut Icp) -> bool {
        if self.baseline_s > 0.0 {
            return match icp.step() {
                Progress::Running => false,
                Progress::Done(found) => found.is_none_or(|found| !self.climb(found)),
            };
        }
        if self.level == 0 {
            // Counted only.
            let all = self.take(window, path, 0..usize::MAX, 0, &mut icp.first);
            self.size = (all.count / SLICES).min(MOST_EVENTS);
            if self.size < LEAST_EVENTS {
                return true;
            }
            let first = self.take(window, path, 0..self.size, self.size, &mut icp.first);
            self.first_us = first.mean_us;
            self.passed = self.size;
        }
        self.level += 1;
        self.level > MOST_LEVELS || !self.cut(window, path, icp)
    }

    /// Cuts the later slice of the next level and starts its registration; `false` when the ladder ends.
    fn cut(&mut self, window: &Window<'_>, path: &Path, icp: &mut Icp) -> bool {
        let length = self.size.max((GROWTH * self.passed as f32) as usize);
        let range = self.passed..self.passed + length;
        self.passed += length;
        let second = self.take(window, path, range, self.size, &mut icp.second);
        let baseline_s = (second.mean_us - self.first_us) * 1e-6;
        let rate_so_far = if self.seen { self.rate.unwrap_or(0.0).abs() } else { 0.0 };
        if icp.second.len() < self.size / 2
            || baseline_s <= 0.0
            || rate_so_far * baseline_s > MOST_TURN_RAD
            || rate_so_far * second.span_us * 1e-6 > MOST_BLUR_RAD
        {
            return false;
        }
        let start_rad = self.rate.map_or(0.0, |rate| rate * baseline_s);
        icp.start(start_rad, self.disc.radius_px, Residual::FixedAxis, SETTLED);
        self.baseline_s = baseline_s;
        true
    }

    /// Takes the rate of a level; `false` when the match jumped to another blade.
    fn climb(&mut self, found: Registered) -> bool {
        let next = found.yaw_rad / self.baseline_s;
        self.baseline_s = 0.0;
        let jumped = |before: f32| {
            self.seen && (next - before).abs() > MOST_CHANGE * before.abs().max(next.abs())
        };
        if self.rate.is_some_and(jumped) {
            return false;
        }
        self.seen = found.yaw_rad.abs() * self.disc.radius_px > SEEN_PX;
        self.rate = Some(next);
        true
    }
}

/// What is in a slice.
struct Taken {
    /// Events of the segment up to its end.
    count: usize,
    /// Their mean time in it, and what it spans, in microseconds.
    mean_us: f32,
    span_us: f32,
}

/// The median of values, which it sorts.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn median(values: &mut [f32]) -> Option<f32> {
    sort_few(values, |a, b| a < b);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 {
        values.get(middle).copied()
    } else {
        Some(0.5 * (values.get(middle.checked_sub(1)?)? + values.get(middle)?))
    }
}

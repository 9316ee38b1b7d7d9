//! What turns too slowly to pass anywhere twice within the window.
//!
//! Events that move rigidly at the angular speed w have a density rho(angle - w t). Its m-th angular harmonic, as a
//! function of time, is one line at m w / 2 pi, whether the rotor completes a turn or not. Seen from a point
//! *beside* the rotor's centre the lines of all harmonics show. Only the lowest frequencies are looked at: above
//! them [`super::lines`] sees more.

use heapless::Vec;

use crate::math::{TAU, Turn, TurnRate};
use crate::order::sort_few;
use crate::speed::polar::PolarEvent;

/// Angular harmonics that are looked at.
const HARMONICS: u32 = 3;
/// Frequencies in halves of a period in the window: the first, and how many. Below, what drifts by hides what there is.
const FIRST: usize = 3;
const FREQUENCIES: usize = 14;
/// Events that are looked at, and those in one step: half a million instructions.
const MOST_EVENTS: usize = 1_024;
const EVENTS_A_STEP: usize = 512;
/// Power over that of unrelated events from which on a frequency is looked into.
const LEAST_POWER: f32 = 12.0;
/// Frequencies given.
pub const PEAKS: usize = 4;

/// The search for the frequencies at which the angular harmonics of a track turn: a harmonic and sense after the other, some
/// events a step.
#[derive(Clone, Debug, Default)]
pub struct Sweep {
    /// Harmonics and senses looked at so far.
    looked: u32,
    /// Events that the sums of this one hold so far.
    added: usize,
    sums: [(f32, f32); FREQUENCIES],
    /// Their power at chance.
    chance: f32,
    /// Power and frequency in Hz of the highest peaks so far.
    peaks: Vec<(f32, f32), PEAKS>,
}

impl Sweep {
    /// Adds some events; `true` once all harmonics and senses were looked at.
    pub fn step(&mut self, track: &[PolarEvent], window_us: u32) -> bool {
        let step_hz = 0.5e6 / window_us.max(1) as f32;
        if self.add(track, window_us, step_hz) {
            return false;
        }
        let line = self.sums.map(|(re, im)| (re * re + im * im) / self.chance.max(1e-6));
        for (index, power) in line.iter().enumerate() {
            let beside = |index: usize| line.get(index).copied().unwrap_or(0.0);
            let highest = *power > beside(index + 1) && *power >= beside(index.wrapping_sub(1));
            if highest && *power >= LEAST_POWER {
                self.enter((*power, (index + FIRST) as f32 * step_hz), step_hz);
            }
        }
        *self = Self {
            looked: self.looked + 1,
            peaks: core::mem::take(&mut self.peaks),
            ..Self::default()
        };
        self.looked >= 2 * HARMONICS
    }

    /// Adds some events to the harmonic and sense at hand; `true` when more are to come.
    fn add(&mut self, track: &[PolarEvent], window_us: u32, step_hz: f32) -> bool {
        let (m, clockwise) = (self.looked / 2 + 1, self.looked.is_multiple_of(2));
        let kept = || track.iter().step_by(track.len().div_ceil(MOST_EVENTS).max(1));
        let count = kept().count().max(1) as f32;
        let mut mean = (0.0_f32, 0.0_f32);
        for event in kept() {
            let (sin, cos) = event.angle().times(m).sin_cos();
            mean.0 += cos / count;
            mean.1 += sin / count;
        }
        let rate = TurnRate::from_rad_s(step_hz * TAU);
        let per_us = u32::MAX / window_us.max(1);
        let sense = if clockwise { 1.0 } else { -1.0 };
        for event in kept().skip(self.added).take(EVENTS_A_STEP) {
            // Hann window: zero at both ends, one in the middle, where the time is zero.
            let (_, cos) = Turn((event.t_us as u32).wrapping_mul(per_us)).sin_cos();
            let weight = 0.5 + 0.5 * cos;
            let (step_sin, step_cos) = rate.after(event.t_us).sin_cos();
            let (mut s, mut c) = rate.after(event.t_us).times(FIRST as u32).sin_cos();
            let (sin, cos) = event.angle().times(m).sin_cos();
            let (re, im) = (weight * (cos - mean.0), weight * (sin - mean.1));
            self.chance += re * re + im * im;
            let (across_re, across_im) = (sense * re, sense * im);
            for sum in &mut self.sums {
                sum.0 += re * c + across_im * s;
                sum.1 += im * c - across_re * s;
                (c, s) = (c * step_cos - s * step_sin, s * step_cos + c * step_sin);
            }
        }
        self.added += EVENTS_A_STEP;
        self.added < kept().count()
    }

    fn enter(&mut self, peak: (f32, f32), step_hz: f32) {
        let known = self.peaks.iter_mut().find(|known| (known.1 - peak.1).abs() < 0.1 * step_hz);
        if let Some(known) = known {
            known.0 = known.0.max(peak.0);
        } else if let Err(peak) = self.peaks.push(peak)
            && let Some(least) = self.peaks.iter_mut().min_by(|a, b| a.0.total_cmp(&b.0))
            && peak.0 > least.0
        {
            *least = peak;
        }
    }

    /// The frequencies in Hz, the highest power first.
    pub fn hz(mut self) -> Vec<f32, PEAKS> {
        sort_few(&mut self.peaks, |a, b| a.0.total_cmp(&b.0).is_gt());
        self.peaks.into_iter().map(|(_, hz)| hz).collect()
    }
}

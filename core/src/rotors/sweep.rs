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
const HARMONICS: usize = 3;
/// Frequencies in halves of a period in the window: the first, and how many. Below, what drifts by hides what there is.
const FIRST: usize = 3;
const FREQUENCIES: usize = 14;
/// Events that are looked at.
const MOST_EVENTS: usize = 1_024;
/// Power over that of unrelated events from which on a frequency is looked into.
const LEAST_POWER: f32 = 12.0;
/// Frequencies given.
pub const PEAKS: usize = 4;

/// Powers by harmonic, sense and frequency.
type Powers = [[[f32; FREQUENCIES]; 2]; HARMONICS];

/// The frequencies in Hz at which the angular harmonics of a track turn, the highest power first.
/// Cost: a million instructions.
#[must_use]
pub fn sweep(track: &[PolarEvent], window_us: u32) -> Vec<f32, PEAKS> {
    let step_hz = 0.5e6 / window_us.max(1) as f32;
    let powers = powers(track, window_us, step_hz);
    let mut peaks = Vec::<(f32, f32), PEAKS>::new();
    for line in powers.iter().flatten() {
        for (index, power) in line.iter().enumerate() {
            let beside = |index: usize| line.get(index).copied().unwrap_or(0.0);
            let highest = *power > beside(index + 1) && *power >= beside(index.wrapping_sub(1));
            let peak = (*power, (index + FIRST) as f32 * step_hz);
            let known = peaks.iter_mut().find(|known| (known.1 - peak.1).abs() < 0.1 * step_hz);
            if !highest || *power < LEAST_POWER {
                continue;
            } else if let Some(known) = known {
                known.0 = known.0.max(peak.0);
            } else if let Err(peak) = peaks.push(peak)
                && let Some(least) = peaks.iter_mut().min_by(|a, b| a.0.total_cmp(&b.0))
                && peak.0 > least.0
            {
                *least = peak;
            }
        }
    }
    sort_few(&mut peaks, |a, b| a.0.total_cmp(&b.0).is_gt());
    peaks.into_iter().map(|(_, hz)| hz).collect()
}

fn powers(track: &[PolarEvent], window_us: u32, step_hz: f32) -> Powers {
    let kept = || track.iter().step_by(track.len().div_ceil(MOST_EVENTS).max(1));
    let count = kept().count().max(1) as f32;
    let mut means = [(0.0_f32, 0.0_f32); HARMONICS];
    for event in kept() {
        for (m, mean) in means.iter_mut().enumerate() {
            let (sin, cos) = event.angle().times(m as u32 + 1).sin_cos();
            mean.0 += cos / count;
            mean.1 += sin / count;
        }
    }
    let rate = TurnRate::from_rad_s(step_hz * TAU);
    let per_us = u32::MAX / window_us.max(1);
    let mut sums = [[[(0.0_f32, 0.0_f32); FREQUENCIES]; 2]; HARMONICS];
    let mut chance = [0.0_f32; HARMONICS];
    for event in kept() {
        // Hann window: zero at both ends, one in the middle, where the time is zero.
        let (_, cos) = Turn((event.t_us as u32).wrapping_mul(per_us)).sin_cos();
        let weight = 0.5 + 0.5 * cos;
        let (step_sin, step_cos) = rate.after(event.t_us).sin_cos();
        let (first_sin, first_cos) = rate.after(event.t_us).times(FIRST as u32).sin_cos();
        for (m, lines) in sums.iter_mut().enumerate() {
            let (sin, cos) = event.angle().times(m as u32 + 1).sin_cos();
            let (re, im) = (weight * (cos - means[m].0), weight * (sin - means[m].1));
            chance[m] += re * re + im * im;
            let (mut c, mut s) = (first_cos, first_sin);
            let [clockwise, counter] = lines;
            for (clockwise, counter) in clockwise.iter_mut().zip(counter) {
                clockwise.0 += re * c + im * s;
                clockwise.1 += im * c - re * s;
                counter.0 += re * c - im * s;
                counter.1 += im * c + re * s;
                (c, s) = (c * step_cos - s * step_sin, s * step_cos + c * step_sin);
            }
        }
    }
    core::array::from_fn(|m| {
        sums[m].map(|line| line.map(|(re, im)| (re * re + im * im) / chance[m].max(1e-6)))
    })
}

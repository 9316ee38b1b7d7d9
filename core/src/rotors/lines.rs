//! The frequencies at which the cells of the image are visited, from their summed autocorrelation.

use heapless::Vec;
use microfft::Complex32;

use super::visits::Chance;
use crate::math::{Turn, smaller, sqrt};
use crate::order::sort_few;

/// Bins of the autocorrelation over the window's length: 150 ms / 1 024 = 146 us, so 3.4 kHz is the highest frequency.
pub const LAGS: usize = 1_024;
/// As many again stay empty, so that the spectrum has two samples a line and no peak falls between them.
const PADDED: usize = 2 * LAGS;
/// Samples of the spectrum for each period in the window.
const SAMPLES_A_LINE: usize = 2;
/// Lowest frequency looked at, in samples: below two periods in the window nothing tells a rotor from a passer-by.
const LOWEST: usize = 2 * SAMPLES_A_LINE;
/// A peak rises over the lowest of this many samples to both sides.
const FLANK: usize = 4 * SAMPLES_A_LINE;
/// Height of a peak over its flanks in standard deviations of unrelated events: the highest of a thousand samples rises
/// three of them above the mean, and the lowest of a flank falls two below.
const LEAST_SIGMAS: f32 = 6.0;
/// Peaks kept.
pub const PEAKS: usize = 12;
/// A lower peak is the fundamental of a higher one when it has at least this share of its height.
const LEAST_FUNDAMENTAL: f32 = 0.7;

/// A frequency that cells are visited at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    /// Frequency in Hz.
    pub hz: f32,
    /// Height over the flanks in standard deviations of unrelated events.
    pub sigmas: f32,
}

/// The lines of a spectrum, the highest first.
pub type Lines = Vec<Line, PEAKS>;

/// The autocorrelation, and its transform in the same memory.
#[derive(Debug)]
pub struct Spectrum {
    bins: [[f32; LAGS]; 2],
}

impl Spectrum {
    /// Nothing in it.
    pub const EMPTY: Self = Self { bins: [[0.0; LAGS]; 2] };

    /// Starts over.
    pub fn clear(&mut self) {
        self.bins = [[0.0; LAGS]; 2];
    }

    /// The histogram of time differences, from zero to the window's length.
    pub const fn lags(&mut self) -> &mut [f32; LAGS] {
        &mut self.bins[0]
    }

    /// Transforms the histogram and finds its peaks. `chance` is what the summed power would be without any.
    /// Cost: about 300 000 instructions.
    pub fn lines(&mut self, chance: Chance, window_us: u32) -> Lines {
        let mut lines = Lines::new();
        let bins = self.bins.as_flattened_mut().first_chunk_mut::<PADDED>();
        let Some(bins) = bins else { return lines };
        let transform = microfft::real::rfft_2048(bins);
        for (sample, value) in transform.iter_mut().enumerate() {
            // A bin stands for its middle, half a bin later than the transform takes it for.
            let (sin, cos) = Turn((sample << 20) as u32).sin_cos();
            value.re = 2.0 * (value.re * cos + value.im * sin);
        }
        let power = |sample: usize| transform.get(sample).map_or(f32::MAX, |value| value.re);
        let hz = 1e6 / (SAMPLES_A_LINE as f32 * window_us.max(1) as f32);
        for sample in LOWEST..LAGS {
            let (before, here, after) = (power(sample - 1), power(sample), power(sample + 1));
            if here < before || here <= after {
                continue;
            }
            let left = lowest(transform, sample.saturating_sub(FLANK).max(1), sample);
            let right = lowest(transform, sample + 1, sample + 1 + FLANK);
            let flank = left.max(right);
            // Where events come in clumps, chance grows with them.
            let sigma =
                sqrt(chance.variance.max(1.0)) * (1.0 + flank.max(0.0) / chance.mean.max(1.0));
            let sigmas = (here - flank) / sigma;
            if sigmas < LEAST_SIGMAS {
                continue;
            }
            // Vertex of the parabola through the three powers.
            let offset = 0.5 * (before - after) / (before - 2.0 * here + after);
            let line = Line { hz: (sample as f32 + offset) * hz, sigmas };
            if let Err(line) = lines.push(line)
                && let Some(least) = lines.iter_mut().min_by(|a, b| a.sigmas.total_cmp(&b.sigmas))
                && line.sigmas > least.sigmas
            {
                *least = line;
            }
        }
        sort_few(&mut lines, |a, b| a.sigmas.total_cmp(&b.sigmas).is_gt());
        fundamental_first(&mut lines, hz);
        lines
    }
}

/// Lowest power of some samples.
// Not inlined: flash is short.
#[inline(never)]
fn lowest(transform: &[Complex32], from: usize, to: usize) -> f32 {
    let samples = transform.get(from..to.min(transform.len())).unwrap_or(&[]);
    samples.iter().map(|value| value.re).fold(f32::MAX, smaller)
}

/// Puts the fundamental of the highest peak first, where it is among the peaks: it winds least around its axis, and so is
/// told apart best on few cells.
fn fundamental_first(lines: &mut Lines, sample_hz: f32) {
    let Some(highest) = lines.first().copied() else { return };
    let below = |line: &Line| {
        let ratio = crate::math::round(highest.hz / line.hz);
        let off_hz = (highest.hz - ratio * line.hz).abs();
        ratio > 1.0
            && off_hz < (0.5 + 0.25 * ratio) * sample_hz
            && line.sigmas > LEAST_FUNDAMENTAL * highest.sigmas
    };
    let lowest = lines
        .iter()
        .enumerate()
        .filter(|(_, line)| below(line))
        .min_by(|a, b| a.1.hz.total_cmp(&b.1.hz))
        .map(|(index, _)| index);
    if let Some(lowest) = lowest {
        lines.swap(0, lowest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_visited_evenly_show_one_line_however_their_phases_lie() {
        let mut spectrum = Spectrum::EMPTY;
        // 100 cells with 15 visits each, 62 bins apart: time differences at the multiples of the period.
        for periods in 1..15_usize {
            spectrum.lags()[62 * periods] = 100.0 * (15 - periods) as f32 / 15.0;
        }
        let lines = spectrum.lines(Chance { mean: 100.0, variance: 100.0 }, 150_000);
        // The middle of a bin is half a bin later.
        let expected_hz = 1e6 / 150_000.0 * LAGS as f32 / 62.0;
        assert!(lines.iter().any(|line| (line.hz / expected_hz - 1.0).abs() < 0.02), "{lines:?}");
    }

    #[test]
    fn an_empty_histogram_has_no_lines() {
        let mut spectrum = Spectrum::EMPTY;
        assert!(spectrum.lines(Chance::default(), 150_000).is_empty());
    }
}

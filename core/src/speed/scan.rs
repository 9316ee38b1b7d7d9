//! Scan over angular harmonic and frequency: the first of the two blind coarse estimators.
//!
//! Events that move rigidly at the angular speed w have a density rho(angle - w t). Its m-th angular harmonic,
//! as a function of time, is one line at m w / 2 pi. A Fourier transform over time for each m shows the
//! line; its frequency over m is the shaft speed, whichever harmonic it is found in, so that the blade count is
//! not needed. A standing pattern (lamp flicker, vibration) has its line at +f and -f alike and is told from a
//! rotor by that.

use heapless::Vec;
use microfft::Complex32;

use super::polar::{PolarEvent, PolarTrack};
use crate::limits::SCAN_BINS;
use crate::math::{TAU, Turn, TurnRate};

/// Highest angular harmonic that is scanned.
const HARMONICS: u32 = 12;
/// Peaks kept for each harmonic.
const PEAKS: usize = 2;
/// Lowest frequency looked at, in lines of the spectrum: below it the window holds under two periods and
/// the Hann window's own skirt hides what there is.
const LOWEST_LINE: usize = 2;
/// Candidates whose harmonics are summed.
const CANDIDATES: usize = 6;

/// What the scan found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scan {
    /// Speed in rad/s, positive = clockwise on the screen.
    pub omega_rad_s: f32,
    /// Power of all harmonics over what unrelated events would give (1 per harmonic).
    pub score: f32,
    /// Power at the opposite frequency over power at the peak: 1 for a standing pattern.
    pub standing: f32,
    /// Frequency of the strongest line in Hz.
    pub line_hz: f32,
    /// Angular harmonic of the strongest line.
    pub harmonic: u32,
}

/// A peak of the spectrum of one angular harmonic.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// Power over the mean of the spectrum.
    pub power: f32,
    /// Power at the opposite frequency over power at the peak.
    pub standing: f32,
    /// Frequency in Hz, positive = clockwise.
    pub line_hz: f32,
    /// Angular harmonic.
    pub harmonic: u32,
}

impl Peak {
    fn omega_rad_s(&self) -> f32 {
        self.line_hz * TAU / self.harmonic as f32
    }
}

/// A scan in progress, one angular harmonic a step.
#[derive(Debug)]
pub struct Scanner {
    spectrum: [Complex32; SCAN_BINS],
    peaks: Vec<Peak, { HARMONICS as usize * PEAKS }>,
    harmonic: u32,
}

impl Default for Scanner {
    fn default() -> Self {
        Self { spectrum: [Complex32::new(0.0, 0.0); SCAN_BINS], peaks: Vec::new(), harmonic: 0 }
    }
}

impl Scanner {
    /// Starts over.
    pub fn restart(&mut self) {
        self.peaks.clear();
        self.harmonic = 0;
    }

    /// Harmonics scanned so far.
    #[must_use]
    pub const fn harmonic(&self) -> u32 {
        self.harmonic
    }

    /// The peaks found so far, up to two for each harmonic.
    #[must_use]
    pub fn peaks(&self) -> &[Peak] {
        &self.peaks
    }

    /// Scans the next harmonic; `true` once all are scanned.
    /// Cost: about 60 instructions an event and 150 000 for the transform.
    pub fn step(&mut self, track: &PolarTrack, window_us: u32) -> bool {
        self.harmonic += 1;
        let harmonic = self.harmonic;
        self.spectrum.fill(Complex32::new(0.0, 0.0));
        let half_us = (window_us / 2) as i32;
        for event in track {
            let bin = ((event.t_us + half_us).max(0) as u64 * SCAN_BINS as u64
                / u64::from(window_us.max(1))) as usize;
            let (sin, cos) = event.angle().times(harmonic).sin_cos();
            if let Some(sum) = self.spectrum.get_mut(bin) {
                sum.re += cos;
                sum.im += sin;
            }
        }
        self.window_and_transform(window_us, harmonic);
        harmonic >= HARMONICS
    }

    /// Takes out the mean, applies a Hann window, transforms, and keeps the highest peaks.
    fn window_and_transform(&mut self, window_us: u32, harmonic: u32) {
        let n = SCAN_BINS as f32;
        let mut mean = Complex32::new(0.0, 0.0);
        for value in &self.spectrum {
            mean.re += value.re / n;
            mean.im += value.im / n;
        }
        for (index, value) in self.spectrum.iter_mut().enumerate() {
            let weight = hann(index as u32 * (u32::MAX / SCAN_BINS as u32));
            value.re = (value.re - mean.re) * weight;
            value.im = (value.im - mean.im) * weight;
        }
        let spectrum = microfft::complex::cfft_1024(&mut self.spectrum);
        let power = |line: usize| {
            let value = spectrum[line % SCAN_BINS];
            value.re * value.re + value.im * value.im
        };
        let mean_power: f32 = (0..SCAN_BINS).map(power).sum::<f32>() / n;
        let hz_per_line = 1e6 / window_us.max(1) as f32;
        let mut best = [Peak::default(); PEAKS];
        for line in LOWEST_LINE..=SCAN_BINS - LOWEST_LINE {
            let here = power(line);
            let (before, after) = (power(line - 1), power(line + 1));
            if here < before || here <= after || mean_power <= 0.0 {
                continue;
            }
            let Some(lowest) = best.iter_mut().min_by(|a, b| a.power.total_cmp(&b.power)) else {
                continue;
            };
            if here / mean_power > lowest.power {
                // Vertex of the parabola through the three powers: within 0.1 line under a Hann window.
                let offset = 0.5 * (before - after) / (before - 2.0 * here + after);
                let signed =
                    if line > SCAN_BINS / 2 { line as f32 - n } else { line as f32 } + offset;
                let mirror = SCAN_BINS - line;
                let opposite =
                    power(mirror).max(power(mirror + 1)).max(power(mirror.saturating_sub(1)));
                *lowest = Peak {
                    power: here / mean_power,
                    standing: opposite / here,
                    line_hz: signed * hz_per_line,
                    harmonic,
                };
            }
        }
        for peak in best {
            if peak.power > 0.0 {
                self.peaks.push(peak).ok();
            }
        }
    }

    /// The speed that explains most harmonics, once [`Self::step`] has returned `true`.
    /// Cost: about 15 sums over the track.
    #[must_use]
    pub fn finish(&mut self, track: &PolarTrack, window_us: u32) -> Option<Scan> {
        self.peaks.sort_unstable_by(|a, b| b.power.total_cmp(&a.power));
        let mut candidates: Vec<Peak, CANDIDATES> = Vec::new();
        let hz_per_line = 1e6 / window_us.max(1) as f32;
        for peak in &self.peaks {
            let same = |other: &Peak| {
                let apart_hz = (peak.omega_rad_s() - other.omega_rad_s()).abs() / TAU
                    * peak.harmonic.max(other.harmonic) as f32;
                apart_hz < 1.5 * hz_per_line
            };
            if !candidates.iter().any(same) {
                candidates.push(*peak).ok();
            }
        }
        let mut best: Option<Scan> = None;
        for peak in &candidates {
            let score: f32 = (1..=HARMONICS)
                .map(|m| coherent_power(track, window_us, m, peak.omega_rad_s()))
                .sum();
            if best.is_none_or(|scan| score > scan.score) {
                best = Some(Scan {
                    omega_rad_s: peak.omega_rad_s(),
                    score,
                    standing: peak.standing,
                    line_hz: peak.line_hz,
                    harmonic: peak.harmonic,
                });
            }
        }
        best
    }
}

/// Power of harmonic `m` at the speed, with exact times, over what unrelated events would give.
fn coherent_power(track: &[PolarEvent], window_us: u32, m: u32, omega_rad_s: f32) -> f32 {
    let rate = TurnRate::from_rad_s(omega_rad_s);
    let per_us = u32::MAX / window_us.max(1);
    let half_us = (window_us / 2) as i32;
    let (mut re, mut im, mut norm) = (0.0_f32, 0.0_f32, 0.0_f32);
    for event in track {
        let weight = hann((event.t_us + half_us).max(0) as u32 * per_us);
        let (sin, cos) = event.angle().minus(rate.after(event.t_us)).times(m).sin_cos();
        re += weight * cos;
        im += weight * sin;
        norm += weight * weight;
    }
    (re * re + im * im) / norm.max(1.0)
}

/// Hann window at a phase of 0 to 2^32 through the window.
fn hann(phase: u32) -> f32 {
    0.5 - 0.5 * Turn(phase).sin_cos().1
}

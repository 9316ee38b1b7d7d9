//! Scan over frequency: at which rates do blades pass?
//!
//! Events that move rigidly at the angular speed w have a density rho(angle - w t). Its m-th angular harmonic,
//! as a function of time, is one line at m w / 2 pi. A Fourier transform over time for low m, about a point *beside*
//! the rotor's centre, shows the lines of all harmonics. Which m a line belongs to is for the phase over the
//! image to say ([`crate::rotors::winding`], [`super::phase::harmonics`]); its frequency over m is the shaft speed,
//! whichever harmonic it is, so that the blade count is not needed.

use heapless::Vec;
use microfft::Complex32;

use super::polar::PolarTrack;
use crate::limits::SCAN_BINS;
use crate::math::Turn;

/// Highest angular harmonic that is scanned.
pub const HARMONICS: u32 = 3;
/// Peaks kept for each harmonic.
const PEAKS: usize = 2;
/// Lowest frequency looked at, in lines of the spectrum: below it the window holds under two periods and
/// the Hann window's own skirt hides what there is.
const LOWEST_LINE: usize = 2;

/// A peak of the spectrum of one angular harmonic.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// Power over the mean of the spectrum.
    pub power: f32,
    /// Frequency in Hz, positive = clockwise.
    pub line_hz: f32,
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
        self.window_and_transform(window_us);
        harmonic >= HARMONICS
    }

    /// Takes out the mean, applies a Hann window, transforms, and keeps the highest peaks.
    fn window_and_transform(&mut self, window_us: u32) {
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
                *lowest = Peak { power: here / mean_power, line_hz: signed * hz_per_line };
            }
        }
        for peak in best {
            if peak.power > 0.0 {
                self.peaks.push(peak).ok();
            }
        }
    }
}

/// Hann window at a phase of 0 to 2^32 through the window.
fn hann(phase: u32) -> f32 {
    0.5 - 0.5 * Turn(phase).sin_cos().1
}

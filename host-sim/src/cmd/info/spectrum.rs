//! Dominant periodicities of a recording: lines in the spectrum of brighter less darker events over the whole sensor.
//!
//! A lamp makes all pixels brighter and darker together. A rotor may show too, where its blades differ from each other or
//! from the background; its blades come to different places at different times, and by that it is told from a lamp.

use rustfft::FftPlanner;
use rustfft::num_complex::{Complex32, Complex64};

/// A period: a line in the spectrum, with those at whole multiples of its frequency taken together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    pub hz: f64,
    /// Power over the background around it, the best of its harmonics.
    pub over_background: f64,
    /// Further lines at multiples of the frequency.
    pub harmonics: u32,
    power: f64,
}

/// A line counts from this power over its background on: noise of this many bins hardly ever reaches it.
const LEAST_OVER_BACKGROUND: f64 = 40.0;
/// Below, a recording is too short to tell a period from a drift.
const LEAST_PERIODS: usize = 4;
/// Periods that are told.
const MOST_LINES: usize = 3;
/// Lines that are looked at.
const MOST_CANDIDATES: usize = 64;

/// The strongest lines, strongest first.
pub fn lines(balance: &[f32], step_us: u64) -> Vec<Line> {
    if balance.len() < 64 {
        return Vec::new();
    }
    let mean = balance.iter().sum::<f32>() / balance.len() as f32;
    let turn = std::f32::consts::TAU / balance.len() as f32;
    let mut data: Vec<Complex32> = balance
        .iter()
        .enumerate()
        // A Hann window: strong lines do not leak far.
        .map(|(index, value)| {
            Complex32::new((value - mean) * (1.0 - (turn * index as f32).cos()), 0.0)
        })
        .collect();
    FftPlanner::new().plan_fft_forward(data.len()).process(&mut data);
    let power: Vec<f64> =
        data[..data.len() / 2].iter().map(|value| f64::from(value.norm_sqr())).collect();
    let hz_per_bin = 1e6 / (step_us as f64 * balance.len() as f64);
    let mut found: Vec<Line> = (LEAST_PERIODS..power.len() - 1)
        .filter(|&bin| power[bin] >= power[bin - 1] && power[bin] > power[bin + 1])
        .filter_map(|bin| {
            let over_background = power[bin] / background(&power, bin).max(f64::MIN_POSITIVE);
            let hz = (bin as f64 + peak_offset(&power[bin - 1..=bin + 1])) * hz_per_bin;
            (over_background > LEAST_OVER_BACKGROUND).then_some(Line {
                hz,
                over_background,
                harmonics: 0,
                power: power[bin],
            })
        })
        .collect();
    found.sort_by(|a, b| b.power.total_cmp(&a.power));
    found.truncate(MOST_CANDIDATES);
    found.sort_by(|a, b| a.hz.total_cmp(&b.hz));
    families(&found, hz_per_bin)
}

/// Takes lines at whole multiples of a lower one together; the strongest families, strongest first.
fn families(lines: &[Line], hz_per_bin: f64) -> Vec<Line> {
    let mut families: Vec<Line> = Vec::new();
    for line in lines {
        let family = families.iter_mut().find(|family| {
            let multiple = (line.hz / family.hz).round();
            // The fundamental is known to a part of a bin, its multiples so much worse.
            (line.hz - multiple * family.hz).abs() < hz_per_bin * (0.25 * multiple).clamp(0.5, 1.5)
                && family.power > 1e-3 * line.power
        });
        match family {
            Some(family) => {
                family.harmonics += 1;
                family.power += line.power;
                family.over_background = family.over_background.max(line.over_background);
            }
            None => families.push(*line),
        }
    }
    families.sort_by(|a, b| b.power.total_cmp(&a.power));
    let strongest = families.first().map_or(0.0, |family| family.power);
    families.retain(|family| family.power > 1e-2 * strongest);
    families.truncate(MOST_LINES);
    families
}

/// Median power around a bin, the bin's own line left out.
fn background(power: &[f64], bin: usize) -> f64 {
    const REACH: usize = 64;
    const LINE: usize = 3;
    let mut around: Vec<f64> = (bin.saturating_sub(REACH).max(1)..(bin + REACH).min(power.len()))
        .filter(|&at| at.abs_diff(bin) > LINE)
        .map(|at| power[at])
        .collect();
    let middle = around.len() / 2;
    if around.is_empty() { 0.0 } else { *around.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// How far cells of the sensor agree on the phase of a line: 1 when all pulse together, near 0 when their phases are
/// spread. Each cell counts by its amplitude.
pub fn coherence(cells: &[Vec<f32>], hz: f64, step_us: u64) -> f64 {
    let step = std::f64::consts::TAU * hz * step_us as f64 * 1e-6;
    let (mut sum, mut total) = (Complex64::default(), 0.0);
    for cell in cells.iter().filter(|cell| !cell.is_empty()) {
        let mut value = Complex64::default();
        for (index, &balance) in cell.iter().enumerate().filter(|(_, balance)| **balance != 0.0) {
            value += Complex64::from_polar(f64::from(balance), step * index as f64);
        }
        sum += value;
        total += value.norm();
    }
    if total > 0.0 { sum.norm() / total } else { 0.0 }
}

/// Where between the bins a line peaks, by a parabola through the logarithms of three powers.
fn peak_offset(three: &[f64]) -> f64 {
    let log = |value: f64| value.max(f64::MIN_POSITIVE).ln();
    let (left, middle, right) = (log(three[0]), log(three[1]), log(three[2]));
    let curvature = left - 2.0 * middle + right;
    if curvature < 0.0 { (0.5 * (left - right) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Mains frequency of a lamp whose brightness pulses at `hz`: lamps pulse at twice the mains, some at a multiple.
pub fn mains_hz(hz: f64, duration_s: f64) -> Option<u32> {
    // Mains keep within 0.5 %; a short recording resolves no better than a part of its inverse length.
    [50_u32, 60].into_iter().find(|&mains| {
        let pulse = 2.0 * f64::from(mains);
        let harmonic = (hz / pulse).round();
        let tolerance = (0.005 * hz).max(0.25 / duration_s);
        (1.0..=3.0).contains(&harmonic) && (hz - harmonic * pulse).abs() < tolerance
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steady pseudo-random noise between -1 and 1.
    fn noise(index: usize) -> f32 {
        let mixed = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32 / (1 << 23) as f32
            - 1.0
    }

    #[test]
    fn lamp_is_found_and_named() {
        let balance: Vec<f32> = (0..4000)
            .map(|index| {
                let t = index as f32 * 250e-6;
                (std::f32::consts::TAU * 100.3 * t).sin() + noise(index)
            })
            .collect();
        let lines = lines(&balance, 250);
        assert!((lines[0].hz - 100.3).abs() < 0.2, "{lines:?}");
        assert_eq!(lines.len(), 1);
        assert_eq!(mains_hz(lines[0].hz, 1.0), Some(50));
    }

    #[test]
    fn harmonics_belong_to_their_fundamental() {
        // Pulses, 125 a second: whole steps.
        let balance: Vec<f32> = (0..8000)
            .map(|index| {
                let phase = (index as f32 * 250e-6 * 125.0 + 1e-3).fract();
                let pulse = if phase < 0.1 { 5.0 } else { 0.0 };
                pulse + 0.1 * noise(index)
            })
            .collect();
        let lines = lines(&balance, 250);
        assert!((lines[0].hz - 125.0).abs() < 0.1 && lines[0].harmonics >= 8, "{lines:?}");
        assert_eq!(lines.len(), 1, "{lines:?}");
    }

    #[test]
    fn a_lamp_is_coherent_and_a_rotor_is_not() {
        let cell = |phase: f32| -> Vec<f32> {
            (0..4000).map(|index| (index as f32 * 250e-6 * 628.3 + phase).sin()).collect()
        };
        let lamp: Vec<Vec<f32>> = (0..8).map(|_| cell(1.0)).collect();
        let rotor: Vec<Vec<f32>> = (0..8).map(|index| cell(index as f32 * 0.785)).collect();
        assert!(coherence(&lamp, 100.0, 250) > 0.99);
        assert!(coherence(&rotor, 100.0, 250) < 0.05);
    }

    #[test]
    fn noise_has_no_lines() {
        let balance: Vec<f32> = (0..40_000).map(noise).collect();
        assert_eq!(lines(&balance, 250), []);
    }

    #[test]
    fn other_periods_are_no_lamps() {
        assert_eq!(mains_hz(120.1, 10.0), Some(60));
        assert_eq!(mains_hz(300.2, 10.0), Some(50));
        assert_eq!(mains_hz(87.0, 10.0), None);
        assert_eq!(mains_hz(50.0, 10.0), None);
    }
}

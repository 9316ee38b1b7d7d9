//! The trend of the turn through the window: how far the rotor turned from its first instant to its last.
//!
//! The mean speed over a window is the turn between its ends, and the slope of a straight line only while the speed
//! holds still: the hand that rolls the camera and the motor that hunts bend the line. So polynomials are added, each
//! orthogonal to those before; hence its coefficient and its error stand by themselves, and no system of equations is
//! solved. What bends the line is smooth: coefficients are thought to be the smaller the higher their degree, and how large
//! they are at all the points tell. Each then counts by the share of it that is no noise, so that a line stays one before a
//! tripod, and what may be left of the others is in the error.

use crate::math::{ln, sqrt};

/// Most points of a trend.
pub const MOST_POINTS: usize = crate::limits::MAX_KNOTS;
/// Highest degree.
const MOST_DEGREE: usize = 16;
/// Degree from which on coefficients fall, and this power of their degree that the variance falls by: hands tremble up to
/// 12 Hz, and a sine of so few turns in a window has little beyond.
const FIRST_BEND: usize = 3;
const FALLS_BY: usize = 8;
/// Variances of the third coefficient that are tried, in that of the noise: none, and powers of four from this on.
const LEAST_BEND: f32 = 0.25;
const BENDS: usize = 17;
/// What is left of a polynomial beside those before, below which it says nothing new.
const LEAST_REST: f32 = 1e-3;

/// A point of the trend.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Time since the middle of the window, in units of half its length: -1 to 1.
    pub u: f32,
    /// What is to be explained.
    pub y: f32,
    /// Weight; 0 for a point that does not count.
    pub weight: f32,
}

/// A trend through points, in units of half a window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trend {
    /// Change of y over the window, over two: the mean slope.
    pub slope: f32,
    /// Its standard error from the scatter about the trend, and from what the trend may not show.
    pub slope_error: f32,
    /// Second derivative of the parabola.
    pub bend: f32,
    /// Its standard error as a parabola beside all else that bends the trend.
    pub bend_error: f32,
    /// Mean square by which the trend is bent away from a straight line.
    pub bent: f32,
    /// The same from the parabola.
    pub bent_beside: f32,
    /// Points beyond those that the fit takes up.
    pub degrees_of_freedom: usize,
}

/// A polynomial made orthogonal: its values at the points.
type Values = [f32; MOST_POINTS];

/// Points with weights, some of which share an offset.
struct Points<'p> {
    points: &'p [Point],
    fold: usize,
}

impl Points<'_> {
    /// Takes from every value the mean over the points that share its offset; how many offsets there are.
    // Not inlined, like the product: flash is short.
    #[inline(never)]
    fn take_offsets(&self, values: &mut Values) -> usize {
        let mut offsets = 0;
        for first in 0..self.fold {
            let places = || (first..self.points.len()).step_by(self.fold);
            let weight: f32 = places().map(|i| self.points[i].weight).sum();
            if weight <= 0.0 {
                continue;
            }
            offsets += 1;
            let mean = places().map(|i| self.points[i].weight * values[i]).sum::<f32>() / weight;
            places().for_each(|i| values[i] -= mean);
        }
        offsets
    }

    #[inline(never)]
    fn product(&self, a: &Values, b: &Values) -> f32 {
        self.points.iter().zip(a.iter().zip(b)).map(|(p, (a, b))| p.weight * a * b).sum()
    }
}

impl Trend {
    /// Fits a trend, with an offset of its own for every `fold`-th point: points i and i + fold share one. `None` when
    /// too few points are left. At most [`MOST_POINTS`] count. Cost: about 10 instructions a point and degree squared.
    #[must_use]
    pub fn fit(points: &[Point], fold: usize) -> Option<Self> {
        let points = &points[..points.len().min(MOST_POINTS)];
        let points = Points { points, fold: fold.max(1) };
        let used = points.points.iter().filter(|p| p.weight > 0.0).count();
        let mut rest: Values = [0.0; MOST_POINTS];
        // Legendre's polynomials at the points, of the degree before and of this one, by their recurrence.
        let mut legendre = [(1.0_f32, 0.0_f32); MOST_POINTS];
        for ((value, (_, here)), point) in rest.iter_mut().zip(&mut legendre).zip(points.points) {
            (*value, *here) = (point.y, point.u);
        }
        let free = used.checked_sub(points.take_offsets(&mut rest))?;
        let mut basis = [[0.0_f32; MOST_POINTS]; MOST_DEGREE];
        // Mean slope over the window of each polynomial, and its coefficient.
        let (mut slopes, mut coefficients) = ([0.0_f32; MOST_DEGREE], [0.0_f32; MOST_DEGREE]);
        let (mut bend, mut degrees) = (0.0, 0);
        for degree in 1..=MOST_DEGREE.min(free / 3) {
            let index = degree - 1;
            let (before, after) = basis.split_at_mut(index);
            let values = &mut after[0];
            let k = degree as f32;
            for ((value, point), (before, here)) in
                values.iter_mut().zip(points.points).zip(&mut legendre)
            {
                *value = *here;
                let next = ((2.0 * k + 1.0) * point.u * *here - k * *before) / (k + 1.0);
                (*before, *here) = (*here, next);
            }
            points.take_offsets(values);
            let whole = points.product(values, values);
            // Odd polynomials go from -1 to 1, even ones return.
            let mut slope = if degree % 2 == 1 { 1.0 } else { 0.0 };
            for (other, other_slope) in before.iter().zip(slopes) {
                let share = points.product(values, other);
                values.iter_mut().zip(other).for_each(|(v, o)| *v -= share * o);
                slope -= share * other_slope;
            }
            let length2 = points.product(values, values);
            if length2 <= LEAST_REST * whole || whole <= 0.0 {
                break;
            }
            let scale = 1.0 / sqrt(length2);
            values.iter_mut().for_each(|value| *value *= scale);
            slopes[index] = slope * scale;
            if degree == 2 {
                // The second derivative of (3 u^2 - 1) / 2.
                bend = 3.0 * scale;
            }
            let coefficient = points.product(values, &rest);
            rest.iter_mut().zip(values.iter()).for_each(|(r, v)| *r -= coefficient * v);
            coefficients[index] = coefficient;
            degrees = degree;
        }
        if degrees < 2 {
            return None;
        }
        let squares = points.product(&rest, &rest);
        let terms = (&slopes[..degrees], &coefficients[..degrees]);
        let [slope, square, variance, bend_variance, bent_beside, degrees_of_freedom] =
            over_sizes(terms, squares, free);
        let weight: f32 = points.points.iter().map(|p| p.weight).sum();
        Some(Self {
            slope,
            slope_error: sqrt(variance + (square - slope * slope).max(0.0)),
            bend: bend * coefficients[1],
            bend_error: bend * sqrt(bend_variance),
            bent: (bent_beside + coefficients[1] * coefficients[1]) / weight,
            bent_beside: bent_beside / weight,
            degrees_of_freedom: degrees_of_freedom as usize,
        })
    }
}

/// Slope, its square, its variance, that of the bend, what bends beside it and the degrees of freedom, over all sizes that the coefficients
/// may have, each as likely as the points make it.
fn over_sizes(terms: (&[f32], &[f32]), squares: f32, free: usize) -> [f32; 6] {
    let mut tried = [(0.0, Trend::default()); BENDS];
    let (mut size, mut least) = (0.0, f32::INFINITY);
    for trend in &mut tried {
        *trend = shrunk(terms, squares, free, size);
        least = least.min(trend.0);
        size = (4.0 * size).max(LEAST_BEND);
    }
    let mut whole = 0.0;
    let mut mean = [0.0_f32; 6];
    for (cost, trend) in &tried {
        // exp(-x / 2), but for what is hardly likely.
        let likely = (0..4).fold(1.0 / (1.0 + (cost - least) / 32.0), |x, _| x * x);
        whole += likely;
        let Trend { slope, slope_error, bend_error, bent_beside, .. } = *trend;
        let moments = [
            slope,
            slope * slope,
            slope_error * slope_error,
            bend_error * bend_error,
            bent_beside,
            trend.degrees_of_freedom as f32,
        ];
        mean.iter_mut().zip(moments).for_each(|(mean, moment)| *mean += likely * moment);
    }
    mean.map(|m| m / whole)
}

/// The trend where the third coefficient's variance is `size` times that of the noise, and by how much the points speak against that:
/// twice the negative logarithm of their likelihood. `terms` are slopes and coefficients by degree, `squares` what they leave of
/// `free` points. The bend's error is that of the second coefficient.
fn shrunk(terms: (&[f32], &[f32]), squares: f32, free: usize, size: f32) -> (f32, Trend) {
    let (mut sum, mut cost, mut slope, mut share, mut taken) = (squares, 0.0, 0.0, 0.0, 0.0);
    let mut bent_beside = 0.0;
    for (index, (s, c)) in terms.0.iter().zip(terms.1).enumerate() {
        // A parabola always: its bend is asked for.
        let kept = if index + 1 < FIRST_BEND {
            1.0
        } else {
            let fall = FIRST_BEND as f32 / (index + 1) as f32;
            let ratio = size * (0..FALLS_BY).fold(1.0, |power, _| power * fall);
            sum += c * c / (1.0 + ratio);
            cost += ln(1.0 + ratio);
            ratio / (1.0 + ratio)
        };
        slope += kept * s * c;
        share += kept * s * s;
        taken += kept;
        bent_beside += if index > 1 { kept * c * c } else { 0.0 };
    }
    let n = (free + 1 - FIRST_BEND) as f32;
    let variance = sum / n;
    let found = Trend {
        slope,
        slope_error: sqrt(variance * share),
        bend: 0.0,
        bend_error: sqrt(variance * (1.0 + size)),
        bent: 0.0,
        bent_beside,
        degrees_of_freedom: (free as f32 - taken) as usize,
    };
    (cost + n * ln(sum.max(f32::MIN_POSITIVE)), found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of y(u) with a sawtooth of noise.
    fn points(noise: f32, y: impl Fn(f32) -> f32) -> Vec<Point> {
        (0..40)
            .map(|i| {
                let u = (i as f32 - 19.5) / 20.0;
                let off = noise * ((i * 7 % 11) as f32 - 5.0) / 5.0;
                Point { u, y: y(u) + off, weight: 1.0 }
            })
            .collect()
    }

    #[test]
    fn a_parabola_is_found_with_its_error() {
        let found = Trend::fit(&points(1e-3, |u| 1.0 + 2.0 * u + 3.0 * u * u), 1);
        let found = found.unwrap_or_default();
        assert!((found.slope - 2.0).abs() < 3.0 * found.slope_error, "{found:?}");
        assert!(found.slope_error < 1e-3, "{found:?}");
        assert!((found.bend - 6.0).abs() < 3.0 * found.bend_error, "{found:?}");
    }

    #[test]
    fn the_mean_slope_of_a_bent_line_is_the_way_between_its_ends() {
        let wave = |u: f32| 0.3 * u + 0.05 * libm::sinf(5.0 * u + 0.7);
        let found = Trend::fit(&points(1e-3, wave), 1).unwrap_or_default();
        let mean = 0.5 * (wave(1.0) - wave(-1.0));
        assert!((found.slope - mean).abs() < 3.0 * found.slope_error, "{mean} {found:?}");
    }

    #[test]
    fn a_bent_line_is_bent_by_so_much_and_a_straight_one_is_not() {
        let wave = |u: f32| 0.3 * u + 0.05 * libm::sinf(core::f32::consts::PI * u);
        let found = Trend::fit(&points(1e-3, wave), 1).unwrap_or_default();
        // What is left of sin(pi u) beside its own slope of 3 / pi.
        let bent = 0.05 * 0.05 * 0.196;
        assert!((found.bent / bent - 1.0).abs() < 0.2, "{found:?}");
        let parabola = Trend::fit(&points(1e-3, |u| 0.3 * u + 0.1 * u * u), 1).unwrap_or_default();
        assert!(parabola.bent > 4e-4 && parabola.bent_beside < 1e-5, "{parabola:?}");
        let straight = Trend::fit(&points(1e-3, |u| 0.3 * u), 1).unwrap_or_default();
        assert!(straight.bent < 1e-7, "{straight:?}");
    }

    #[test]
    fn what_repeats_in_every_period_is_an_offset() {
        let mut points = points(1e-4, |u| 2.0 * u);
        for (i, point) in points.iter_mut().enumerate() {
            point.y += if i % 4 == 0 { 0.5 } else { 0.0 };
        }
        let found = Trend::fit(&points, 4).unwrap_or_default();
        assert!((found.slope - 2.0).abs() < 3.0 * found.slope_error, "{found:?}");
        assert!(found.slope_error < 1e-3, "{found:?}");
    }

    #[test]
    fn too_few_points_give_none() {
        assert_eq!(Trend::fit(&points(0.1, |u| u)[..6], 1), None);
        assert_eq!(Trend::fit(&[], 3), None);
    }
}

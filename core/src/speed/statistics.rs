//! The little statistics that an error bar needs.

use nalgebra::{Matrix3, Vector3};

use crate::math::sqrt;

/// Mean and its standard error from the scatter; `None` for fewer than two values.
#[must_use]
pub fn mean_and_error(values: &[f32]) -> Option<(f32, f32)> {
    if values.len() < 2 {
        return None;
    }
    let n = values.len() as f32;
    let mean = values.iter().sum::<f32>() / n;
    let squares: f32 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    Some((mean, sqrt(squares / (n - 1.0) / n)))
}

/// 97.5 % point of Student's t over that of the normal distribution, so that +/- 1.96 sigma covers 95 %
/// although sigma itself was estimated from few values.
#[must_use]
pub fn student_over_normal(degrees_of_freedom: usize) -> f32 {
    const FACTORS: [f32; 12] =
        [6.483, 2.195, 1.624, 1.416, 1.312, 1.248, 1.206, 1.177, 1.154, 1.137, 1.123, 1.112];
    match degrees_of_freedom {
        0 => FACTORS[0],
        n => FACTORS.get(n - 1).copied().unwrap_or(1.0 + 1.22 / n as f32),
    }
}

/// A parabola y = c + slope x + curve x^2 by least squares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parabola {
    /// Slope at x = 0.
    pub slope: f32,
    /// Standard error of the slope from the scatter about the parabola.
    pub slope_error: f32,
    /// Coefficient of x^2.
    pub curve: f32,
    /// Its standard error.
    pub curve_error: f32,
}

/// Fits a parabola to (x, y, weight); `None` for fewer than five points.
#[must_use]
pub fn fit_parabola(points: &[(f32, f32, f32)]) -> Option<Parabola> {
    if points.len() < 5 {
        return None;
    }
    // Scaled to the unit interval, so that f32 holds the normal equations.
    let scale = points.iter().map(|p| p.0.abs()).fold(0.0, f32::max).max(1e-9);
    let weight: f32 = points.iter().map(|p| p.2).sum::<f32>() / points.len() as f32;
    let mut normal = Matrix3::<f32>::zeros();
    let mut right = Vector3::<f32>::zeros();
    for (x, y, w) in points {
        let u = x / scale;
        let a = Vector3::new(1.0, u, u * u);
        normal.ger(w / weight, &a, &a, 1.0);
        right += a * (w / weight * y);
    }
    let factor = normal.cholesky()?;
    let solved = factor.solve(&right);
    let squares: f32 = points
        .iter()
        .map(|(x, y, w)| {
            let u = x / scale;
            let off = y - solved[0] - solved[1] * u - solved[2] * u * u;
            w / weight * off * off
        })
        .sum();
    let variance = squares / (points.len() - 3) as f32;
    let inverse = factor.inverse();
    Some(Parabola {
        slope: solved[1] / scale,
        slope_error: sqrt(variance * inverse.m22) / scale,
        curve: solved[2] / (scale * scale),
        curve_error: sqrt(variance * inverse.m33) / (scale * scale),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_with_its_error() {
        let points: Vec<_> = (0..20)
            .map(|i| {
                let x = (i - 10) as f32 * 0.01;
                (x, 1.0 + 2.0 * x + 3.0 * x * x + if i % 2 == 0 { 1e-3 } else { -1e-3 }, 1.0)
            })
            .collect();
        let fit = fit_parabola(&points).unwrap_or_default();
        assert!(
            (fit.slope - 2.0).abs() < 3.0 * fit.slope_error && fit.slope_error < 0.01,
            "{fit:?}"
        );
        assert!(
            (fit.curve - 3.0).abs() < 3.0 * fit.curve_error && fit.curve_error < 0.2,
            "{fit:?}"
        );
    }

    #[test]
    fn few_values_widen_the_error_bar() {
        assert!(student_over_normal(1) > student_over_normal(7));
        assert!((student_over_normal(7) - 2.365 / 1.96).abs() < 1e-3);
        assert!((student_over_normal(1_000) - 1.0).abs() < 2e-3);
    }
}

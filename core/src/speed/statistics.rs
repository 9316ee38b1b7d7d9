//! The little statistics that an error bar needs.

use crate::math::sqrt;

/// Mean and its standard error from the scatter; `None` for fewer than two values.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn mean_and_error(values: &[f32]) -> Option<(f32, f32)> {
    if values.len() < 2 {
        return None;
    }
    let n = values.len() as f32;
    let mean = values.iter().sum::<f32>() / n;
    let squares: f32 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    Some((mean, sqrt(squares / (n - 1.0) / n)))
}

/// Root mean square of two values.
#[must_use]
pub fn root_mean_square(a: f32, b: f32) -> f32 {
    sqrt(0.5 * (a * a + b * b))
}

/// Standard error of what has two that know nothing of each other.
#[must_use]
// Nor this.
#[inline(never)]
pub fn root_sum_square(a: f32, b: f32) -> f32 {
    sqrt(a * a + b * b)
}

/// 97.5 % point of Student's t over that of the normal distribution, so that +/- 1.96 sigma covers 95 %
/// although sigma itself was estimated from few values.
#[must_use]
// Nor this.
#[inline(never)]
pub fn student_over_normal(degrees_of_freedom: usize) -> f32 {
    const FACTORS: [f32; 12] =
        [6.483, 2.195, 1.624, 1.416, 1.312, 1.248, 1.206, 1.177, 1.154, 1.137, 1.123, 1.112];
    match degrees_of_freedom {
        0 => FACTORS[0],
        n => FACTORS.get(n - 1).copied().unwrap_or(1.0 + 1.22 / n as f32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_widen_the_error_bar() {
        assert!(student_over_normal(1) > student_over_normal(7));
        assert!((student_over_normal(7) - 2.365 / 1.96).abs() < 1e-3);
        assert!((student_over_normal(1_000) - 1.0).abs() < 2e-3);
    }
}

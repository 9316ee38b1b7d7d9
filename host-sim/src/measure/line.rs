//! The straight line through a series, and how a speed changed over a recording.

use super::piece::{Piece, seconds, weighted_mean};

/// Readings follow each other by a third of a window: every third is independent.
const OVERLAP: f64 = 3.0;
/// Sigmas by which a slope stands out.
const SLOPE_SIGMAS: f64 = 4.0;
/// How many independent values there are at most in what readings scatter by beyond their own errors. That is what a speed truly does, as
/// of a motor that hunts, and lasts for nobody knows how long. A line explains three fifths of a wave that is as long as the recording: with
/// so many values it stands out if it explains two thirds.
const MOST_INDEPENDENT: f64 = 8.0;
/// Error of the slope of a window over that of its speed, times its length: sqrt(720) over sqrt(12), as of a line and a parabola
/// through phases that are spread evenly.
const SLOPE_PER_SPEED: f64 = 7.746;

/// A straight line through all readings, each with the weight of its error; less than three are no line, and what they
/// tell of acceleration is its slope.
pub struct Line {
    origin_us: u64,
    t_mean_s: f64,
    pub mean_rad_s: f64,
    /// Only where it stands out of what the readings scatter by, or where these told it themselves.
    pub slope_rad_s2: Option<f64>,
    pub slope_variance: f64,
}

impl Line {
    pub fn through(pieces: &[Piece], origin_us: u64) -> Self {
        let t_s = |piece: &Piece| seconds(origin_us, piece.middle_us());
        let t_mean_s = weighted_mean(pieces, t_s);
        let mean_rad_s = weighted_mean(pieces, Piece::omega_rad_s);
        let sum =
            |of: &dyn Fn(&Piece) -> f64| pieces.iter().map(|p| p.weight() * of(p)).sum::<f64>();
        let tt = sum(&|p| (t_s(p) - t_mean_s).powi(2));
        let ty = sum(&|p| (t_s(p) - t_mean_s) * (p.omega_rad_s() - mean_rad_s));
        let (slope_rad_s2, slope_variance) = if pieces.len() >= 3 && tt > 0.0 {
            let (slope_rad_s2, count) = (ty / tt, pieces.len() as f64);
            let off = |p: &Piece| p.omega_rad_s() - mean_rad_s - slope_rad_s2 * (t_s(p) - t_mean_s);
            let scatter = sum(&|p| off(p).powi(2)) / (count - 2.0);
            let beyond = (scatter - 1.0).max(0.0) * OVERLAP.max(count / MOST_INDEPENDENT);
            let variance = (OVERLAP + beyond) / tt;
            let stands_out = slope_rad_s2.abs() > SLOPE_SIGMAS * variance.sqrt();
            (stands_out.then_some(slope_rad_s2), variance)
        } else {
            let told = pieces.iter().filter_map(|p| p.speed.alpha_rad_s2).map(f64::from);
            let sum: f64 = told.sum();
            let length_s = |p: &Piece| p.length_us().max(1) as f64 * 1e-6;
            let variance = weighted_mean(pieces, |p| {
                SLOPE_PER_SPEED.powi(2) * p.variance() / length_s(p).powi(2)
            });
            ((sum != 0.0).then(|| sum / pieces.len() as f64), variance)
        };
        Self { origin_us, t_mean_s, mean_rad_s, slope_rad_s2, slope_variance }
    }

    pub fn at(&self, us: u64) -> f64 {
        let slope_rad_s2 = self.slope_rad_s2.unwrap_or(0.0);
        self.mean_rad_s + slope_rad_s2 * (seconds(self.origin_us, us) - self.t_mean_s)
    }
}

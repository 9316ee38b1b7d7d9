//! Rigid transformations of the plane and the two ways of solving for them.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use crate::math::{Turn, atan2};

/// Rotation about the rotor's centre, then a shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    rotation: Matrix2<f32>,
    shift_px: Vector2<f32>,
}

impl Rigid {
    /// None yet: all zeros, which moves every point to the centre.
    pub(super) const UNSET: Self =
        Self { rotation: Matrix2::new(0.0, 0.0, 0.0, 0.0), shift_px: Vector2::new(0.0, 0.0) };

    /// The rotation by `yaw_rad`, positive = clockwise on the screen.
    #[must_use]
    pub fn yaw(yaw_rad: f32) -> Self {
        let (sin, cos) = Turn::from_rad(yaw_rad).sin_cos();
        Self { rotation: Matrix2::new(cos, -sin, sin, cos), shift_px: Vector2::zeros() }
    }

    /// Where a point goes.
    #[must_use]
    pub fn apply(&self, x_px: f32, y_px: f32) -> (f32, f32) {
        let moved = self.rotation * Vector2::new(x_px, y_px) + self.shift_px;
        (moved.x, moved.y)
    }

    /// This transformation, then a further yaw and shift.
    #[must_use]
    pub fn then(&self, yaw_rad: f32, shift_px: (f32, f32)) -> Self {
        let turn = Self::yaw(yaw_rad).rotation;
        Self {
            rotation: turn * self.rotation,
            shift_px: turn * self.shift_px + Vector2::new(shift_px.0, shift_px.1),
        }
    }
}

/// Sums over matched points that give the best rotation about the origin (paper, "Initial Estimation": covariance of
/// the points, its singular value decomposition, R = V U^T; the axis stands in for the points' means).
#[derive(Clone, Copy, Debug)]
pub struct PointToPoint {
    products: Matrix2<f32>,
}

impl Default for PointToPoint {
    fn default() -> Self {
        Self { products: Matrix2::zeros() }
    }
}

impl PointToPoint {
    /// Adds a match.
    pub fn add(&mut self, source: (f32, f32), target: (f32, f32)) {
        let (p, q) = (Vector2::new(source.0, source.1), Vector2::new(target.0, target.1));
        self.products += p * q.transpose();
    }

    /// Yaw in radians.
    #[must_use]
    pub fn solve(&self) -> Option<f32> {
        let rotation = rotation(self.products)?;
        Some(atan2(rotation.m21, rotation.m11))
    }
}

/// R = V U^T of a covariance U S V^T: in the plane the two orthogonal factors of the singular value decomposition
/// multiply to one turn, whose angle is in closed form. nalgebra's own decomposition gives the same (tested
/// below), but takes sine and cosine in f64, which the device would have to emulate.
fn rotation(covariance: Matrix2<f32>) -> Option<Matrix2<f32>> {
    let sin = covariance.m12 - covariance.m21;
    let cos = covariance.m11 + covariance.m22;
    let determined = sin.is_finite() && cos.is_finite() && (sin != 0.0 || cos != 0.0);
    determined.then(|| Rigid::yaw(atan2(sin, cos)).rotation)
}

/// Sums over matched points that give yaw and shift from the distance *along the motion* ("sliding", or
/// point-to-helicoid residual): e = (q - p) . u - r w (t_q - t_p), with u the direction of motion at p.
///
/// The helicoid swept by a blade is its own tangent plane, so no normals are needed; fewer iterations and less
/// stop bias than point-to-point.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointToHelicoid {
    /// Sums of the products of radius and direction: the upper half of the normal matrix, row by row.
    normal: [f32; 6],
    right: [f32; 3],
}

/// Weight of "no shift" in matches: keeps the solution finite where a slice shows one edge only.
const SHIFT_PRIOR: f32 = 2.0;
const YAW_PRIOR: f32 = 1e-3;

impl PointToHelicoid {
    /// Adds a match: its direction of motion, radius, and the residual along it, in pixels.
    pub fn add(&mut self, (x, y): (f32, f32), radius_px: f32, residual_px: f32) {
        let products = [radius_px * radius_px, radius_px * x, radius_px * y, x * x, x * y, y * y];
        self.normal.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        self.right[0] += radius_px * residual_px;
        self.right[1] += x * residual_px;
        self.right[2] += y * residual_px;
    }

    /// Further yaw in radians and shift in pixels.
    #[must_use]
    pub fn solve(&self) -> Option<(f32, (f32, f32))> {
        let [rr, rx, ry, xx, xy, yy] = self.normal;
        let prior = Vector3::new(YAW_PRIOR, SHIFT_PRIOR, SHIFT_PRIOR);
        let normal = Matrix3::new(rr, rx, ry, rx, xx, xy, ry, xy, yy);
        let normal = normal + Matrix3::from_diagonal(&prior);
        let solved = normal.cholesky()?.solve(&Vector3::from(self.right));
        let finite = solved.iter().all(|value| value.is_finite());
        finite.then_some((solved.x, (solved.y, solved.z)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_clockwise_on_the_screen_is_a_positive_yaw() {
        // From 3 o'clock to half past four on a screen with y down: down and left.
        let (x, y) = Rigid::yaw(core::f32::consts::FRAC_PI_4).apply(10.0, 0.0);
        assert!(y > 7.0 && x > 7.0 && x < 7.2);
        let mut sums = PointToPoint::default();
        for (px, py) in [(10.0, 0.0), (0.0, 7.0), (-4.0, 3.0)] {
            let (qx, qy) = Rigid::yaw(0.3).apply(px, py);
            sums.add((px, py), (qx, qy));
        }
        assert!((sums.solve().unwrap_or_default() - 0.3).abs() < 1e-5);
    }

    #[test]
    fn the_closed_form_is_the_singular_value_decomposition() {
        for (yaw_rad, stretch) in [(0.3, 1.0), (-2.5, 0.2), (3.0, 5.0), (1.5, 0.1)] {
            let turned = Rigid::yaw(yaw_rad).rotation;
            let covariance = Matrix2::new(2.0, 0.3, 0.3, stretch) * turned.transpose();
            let svd = covariance.svd(true, true);
            let product = svd.v_t.zip(svd.u).map(|(v_t, u)| v_t.transpose() * u.transpose());
            let ours = rotation(covariance);
            assert!(product.zip(ours).is_some_and(|(a, b)| (a - b).norm() < 1e-5), "{yaw_rad}");
        }
    }

    #[test]
    fn the_yaw_survives_accumulation() {
        let mut rigid = Rigid::yaw(0.0);
        for _ in 0..20 {
            rigid = rigid.then(0.1, (0.0, 0.0));
        }
        let (x_px, y_px) = rigid.apply(1.0, 0.0);
        assert!((x_px - 2.0_f32.cos()).abs() < 1e-5 && (y_px - 2.0_f32.sin()).abs() < 1e-5);
    }

    #[test]
    fn nothing_matched_gives_no_wild_answer() {
        assert!(PointToHelicoid::default().solve().is_some_and(|(yaw, _)| yaw == 0.0));
        assert_eq!(PointToPoint::default().solve(), None);
    }
}

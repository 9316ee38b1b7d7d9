//! A rotor that is not faced squarely: the picture shows its circle as an ellipse, on which its blades go fast and slow in turn.
//!
//! To first order that is a stretch that leaves areas as they are. It moves directions by twice their angle, which no shift and
//! no turn does, so the events' phases tell it.

use nalgebra::{Matrix2, Vector2};

/// Standard deviation of the stretch: 0.1 is a rotor seen from 35 degrees off its axis.
const STRETCH: f32 = 0.1;
/// Largest stretch, of a rotor seen from 53 degrees off its axis.
const MOST_STRETCH: f32 = 0.25;

/// Stretch of the picture of a rotor, along x (and the less along y) and along the diagonal: 0 when faced squarely.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tilt {
    along: f32,
    across: f32,
}

impl Tilt {
    /// Where an event that lies there, relative to the axis, lies in the rotor's own circle, and its squared distance.
    #[inline]
    pub fn undone(self, (x_px, y_px, _): (f32, f32, f32)) -> (f32, f32, f32) {
        let x = x_px - self.along * x_px - self.across * y_px;
        let y = y_px - self.across * x_px + self.along * y_px;
        (x, y, x * x + y * y)
    }

    /// Corrects the stretch by what events say; `share` of them are in step at harmonic `m`.
    pub fn correct(&mut self, sums: &TiltSums, share: f32, m: f32) {
        let [aa, ab, bb] = sums.products;
        let prior = 1.0 / (2.0 * share * STRETCH * STRETCH);
        let normal = Matrix2::new(aa, ab, ab, bb) * (share * m * m) + Matrix2::identity() * prior;
        let now = Vector2::new(self.along, self.across);
        let right = Vector2::from(sums.right) * m - now * prior;
        let Some(solved) = normal.cholesky().map(|root| now + root.solve(&right)) else { return };
        if solved.norm() < MOST_STRETCH {
            *self = Self { along: solved[0], across: solved[1] };
        }
    }
}

/// Sums over events of how their direction changes with the stretch, its products, and the same times the sine of the phase
/// that they are off.
#[derive(Clone, Copy, Debug)]
pub struct TiltSums {
    products: [f32; 3],
    right: [f32; 2],
}

impl TiltSums {
    /// No events.
    pub const EMPTY: Self = Self { products: [0.0; 3], right: [0.0; 2] };

    /// Adds an event at (x, y) pixels from the axis.
    pub fn add(&mut self, (x_px, y_px): (f32, f32), per_r2: f32, sin_psi: f32) {
        let a = -2.0 * x_px * y_px * per_r2;
        let b = (x_px * x_px - y_px * y_px) * per_r2;
        self.products[0] += a * a;
        self.products[1] += a * b;
        self.products[2] += b * b;
        self.right[0] += a * sin_psi;
        self.right[1] += b * sin_psi;
    }
}

//! The one place where maths comes from, so that device and PC agree to the bit.
//!
//! Everything is f32 or integer, in a fixed order, with no fused operations. Three sources:
//! * `libm` (correct to about one unit in the last place) for what is not computed for every event;
//! * polynomials of our own for sine, cosine and the direction of a vector: `libm::sinf` computes in f64, which a
//!   single-precision FPU must emulate, and `libm::atan2f` takes four times as long; their error (2e-7) is tested below;
//! * `micromath` in [`rough`], where an error of several percent is harmless.
//!
//! Angles that are accumulated or scaled live in [`Turn`]: a 32-bit binary angle wraps by itself and
//! holds 1.5e-9 rad however large the total angle grows.

/// Full circle in radians.
pub const TAU: f32 = core::f32::consts::TAU;

/// Square root, to one unit in the last place: in half the time of libm's, which finds it bit by bit.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn sqrt(x: f32) -> f32 {
    if (f32::MIN_POSITIVE..=f32::MAX).contains(&x) {
        let nearly = quick_sqrt(x);
        0.5 * (nearly + x / nearly)
    } else {
        libm::sqrtf(x)
    }
}

/// The nearest whole number, halves away from zero; of what is below 2^31.
#[must_use]
#[inline(never)]
pub fn round(x: f32) -> f32 {
    // Just below a half, or the largest number below it were rounded up.
    let half = 0.5 - 0.25 * f32::EPSILON;
    ((x + half.copysign(x)) as i32) as f32
}

/// The whole number below x, which is 0 or above, and below 2^31. In two instructions; libm's, for all numbers, are functions.
#[must_use]
pub const fn floor(x: f32) -> f32 {
    (x as i32) as f32
}

/// The whole number above x, which is above -1, and below 2^31.
#[must_use]
pub const fn ceil(x: f32) -> f32 {
    let below = (x as i32) as f32;
    if below < x { below + 1.0 } else { below }
}

/// Angle of the vector (x, y) in radians, -pi to pi; positive = clockwise on a screen with y down.
#[must_use]
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// Natural logarithm.
#[must_use]
pub fn ln(x: f32) -> f32 {
    libm::logf(x)
}

/// Square root of what is not negative to a relative 1e-5, in a sixth of libm's time.
#[must_use]
pub const fn quick_sqrt(x: f32) -> f32 {
    // That of micromath, which asks for the sign first: half the exponent, to 6 %. That of 0 is above 0.
    let rough = f32::from_bits(x.to_bits().wrapping_add(0x3F80_0000) >> 1);
    // Heron's steps square the error.
    let once = 0.5 * (rough + x / rough);
    0.5 * (once + x / once)
}

/// The larger of two numbers, without the call that `f32::max` is on the device.
#[must_use]
pub fn larger(a: f32, b: f32) -> f32 {
    if a < b { b } else { a }
}

/// The smaller of two numbers, without a call likewise.
#[must_use]
pub fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// Tangent of an eighth of a half turn.
const TAN_EIGHTH: f32 = 0.414_213_56;

/// A binary angle: 2^32 units are one turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Turn(pub u32);

impl Turn {
    const UNITS_PER_RAD: f32 = 683_565_275.6; // 2^32 / (2 pi)
    const RAD_PER_UNIT: f32 = 1.462_918_1e-9;

    /// From radians, within +/- 8 turns, to 2.4e-8 rad.
    #[must_use]
    pub fn from_rad(rad: f32) -> Self {
        // In units of 16, so that more than half a turn wraps instead of saturating.
        Self((rad * (Self::UNITS_PER_RAD / 16.0)) as i32 as u32).times(16)
    }

    /// Direction of the vector (x, y), absolute error below 2e-7 rad; that of no vector is 0.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn of_vector(y: f32, x: f32) -> Self {
        let (across, along) = (y.abs(), x.abs());
        let steep = across > along;
        let (less, more) = if steep { (along, across) } else { (across, along) };
        // Beyond an eighth of a right angle's half, what is left to 45 degrees.
        let far = less > TAN_EIGHTH * more;
        let t = if far { (less - more) / (less + more) } else { less / more };
        let t2 = t * t;
        // Minimax polynomial on +/- tan(pi/8) (coefficients of the Cephes library, public domain).
        let rad = t + t
            * t2
            * (-3.333_295e-1
                + t2 * (1.997_771_1e-1 + t2 * (-1.387_768_6e-1 + t2 * 8.053_744_6e-2)));
        let octant = (rad * Self::UNITS_PER_RAD) as i32 as u32;
        let octant = if far { octant.wrapping_add(0x2000_0000) } else { octant };
        let quadrant = if steep { 0x4000_0000_u32.wrapping_sub(octant) } else { octant };
        let half = if x < 0.0 { 0x8000_0000_u32.wrapping_sub(quadrant) } else { quadrant };
        Self(if y < 0.0 { half.wrapping_neg() } else { half })
    }

    /// To radians, -pi to pi.
    #[must_use]
    pub fn rad(self) -> f32 {
        self.0 as i32 as f32 * Self::RAD_PER_UNIT
    }

    /// The angle times a whole number.
    #[must_use]
    pub const fn times(self, n: u32) -> Self {
        Self(self.0.wrapping_mul(n))
    }

    /// Difference `self - other`, wrapped.
    #[must_use]
    pub const fn minus(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }

    /// Sum, wrapped.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }

    /// Which of so many equal sectors of the circle the angle lies in.
    #[must_use]
    pub const fn sector(self, sectors: u32) -> u32 {
        ((self.0 as u64 * sectors as u64) >> 32) as u32
    }

    /// (sine, cosine), absolute error below 2e-7.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn sin_cos(self) -> (f32, f32) {
        let quadrant = self.0.wrapping_add(0x2000_0000) >> 30;
        let x = self.0.wrapping_sub(quadrant << 30) as i32 as f32 * Self::RAD_PER_UNIT;
        // Minimax polynomials on +/- pi/4 (coefficients of the Cephes library, public domain).
        let x2 = x * x;
        let sin = x + x * x2 * (-1.666_665_5e-1 + x2 * (8.332_161e-3 - x2 * 1.951_529_6e-4));
        let cos = 1.0 - 0.5 * x2
            + x2 * x2 * (4.166_664_6e-2 + x2 * (-1.388_731_6e-3 + x2 * 2.443_315_7e-5));
        match quadrant {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

/// Speed of a [`Turn`] that advances with time: turns per microsecond in Q48.
///
/// Range +/- 2^42 (15 000 turns a second), resolution 3.6e-15 turns per microsecond: below 4 ppb at
/// 60 rpm, where an f32 product would lose the phase after a second at 60 000 rpm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TurnRate(i64);

impl TurnRate {
    const Q48_PER_RAD_S: f32 = 44_798_133.8; // 2^48 / (2 pi 1e6)

    /// From rad/s.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn from_rad_s(omega_rad_s: f32) -> Self {
        // The product's rounding is 6e-8 relative: 0.06 ppm, the f32 speed's own resolution.
        Self((omega_rad_s * Self::Q48_PER_RAD_S) as i64)
    }

    /// The angle turned after `dt_us`, within +/- 2^21 us.
    #[must_use]
    pub const fn after(self, dt_us: i32) -> Turn {
        Turn((self.0.wrapping_mul(dt_us as i64) >> 16) as u32)
    }
}

/// Quick functions for places where several percent of error change nothing.
pub mod rough {
    use micromath::F32Ext;

    /// Square root with up to 6 % error: for comparing dispersions of clusters, where a decision rests
    /// on differences of tens of percent.
    #[must_use]
    pub fn sqrt(x: f32) -> f32 {
        // Named, as a method call would mean the standard library's wherever that is linked.
        F32Ext::sqrt(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_right_everywhere() {
        for i in 0..200_000_u32 {
            let turn = Turn(i.wrapping_mul(21_475));
            let exact = f64::from(turn.0) / 4_294_967_296.0 * core::f64::consts::TAU;
            let (sin, cos) = turn.sin_cos();
            assert!((f64::from(sin) - libm::sin(exact)).abs() < 2e-7, "{i}");
            assert!((f64::from(cos) - libm::cos(exact)).abs() < 2e-7, "{i}");
        }
    }

    #[test]
    fn turns_hold_the_phase_over_a_long_window() {
        let rate = TurnRate::from_rad_s(6_283.185_5);
        let exact = 6_283.185_5_f64 * 1.999_999;
        let wrapped = libm::remainder(exact, core::f64::consts::TAU);
        assert!((f64::from(rate.after(1_999_999).rad()) - wrapped).abs() < 1e-3);
    }

    #[test]
    fn angles_survive_the_round_trip() {
        for i in -3_141..=3_141_i32 {
            let rad = i as f32 * 1e-3;
            assert!((Turn::from_rad(rad).rad() - rad).abs() < 1e-6);
        }
        assert_eq!(Turn::from_rad(core::f32::consts::PI).0, 0x8000_0000);
    }

    #[test]
    fn directions_are_right_everywhere() {
        for i in 0..200_000_u32 {
            let turn = Turn(i.wrapping_mul(21_475));
            let exact = f64::from(turn.0) / 4_294_967_296.0 * core::f64::consts::TAU;
            let r = 0.01 + f64::from(i % 977);
            let (y, x) = ((r * libm::sin(exact)) as f32, (r * libm::cos(exact)) as f32);
            let off = Turn::of_vector(y, x).minus(turn).rad();
            assert!(off.abs() < 3e-7, "{i} {off}");
        }
        assert_eq!(Turn::of_vector(0.0, 0.0), Turn(0));
        assert_eq!(Turn::of_vector(0.0, -1.0), Turn(0x8000_0000));
        assert_eq!(Turn::of_vector(-1.0, 0.0), Turn(0xC000_0000));
    }

    #[test]
    fn many_turns_wrap() {
        assert!(Turn::from_rad(3.0 * TAU + 0.5).minus(Turn::from_rad(0.5)).rad().abs() < 2e-6);
        assert!(Turn::from_rad(-2.5 * TAU).minus(Turn(0x8000_0000)).rad().abs() < 2e-6);
    }

    #[test]
    fn whole_numbers_are_libms() {
        let halves = (-2_001..2_001).map(|n| 0.5 * n as f32);
        let near = halves.flat_map(|x| [x.next_down(), x, x.next_up()]);
        for x in near.chain([0.499_999_97, 8_388_607.5, 8_388_609.0, 1e9]) {
            assert_eq!(round(x), libm::roundf(x), "{x}");
            if x > -1.0 {
                assert_eq!(ceil(x), libm::ceilf(x), "{x}");
            }
            if x >= 0.0 {
                assert_eq!(floor(x), libm::floorf(x), "{x}");
            }
        }
    }

    #[test]
    fn square_root_is_right_to_one_unit_in_the_last_place() {
        for i in -100_000..100_000 {
            let x = 1.000_8_f32.powi(i);
            let (below, above) = (libm::sqrtf(x).next_down(), libm::sqrtf(x).next_up());
            assert!((below..=above).contains(&sqrt(x)), "{x}");
        }
        for x in [0.0, 1e-45, 1e-40, f32::MIN_POSITIVE.next_down(), f32::INFINITY] {
            assert_eq!(sqrt(x), libm::sqrtf(x), "{x}");
        }
        assert!(sqrt(-1.0).is_nan() && sqrt(f32::NAN).is_nan());
    }

    #[test]
    fn quick_square_root_stays_within_its_stated_error() {
        for i in 0..100_000 {
            let x = 1e-3 * 1.000_3_f32.powi(i);
            assert!((quick_sqrt(x) / sqrt(x) - 1.0).abs() < 1e-5, "{x}");
        }
        assert!(quick_sqrt(0.0) < 1e-18);
    }

    #[test]
    fn rough_square_root_stays_within_its_stated_error() {
        for i in 1..10_000 {
            let x = i as f32 * 0.37;
            assert!((rough::sqrt(x) / sqrt(x) - 1.0).abs() < 0.065);
        }
    }
}

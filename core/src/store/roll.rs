//! The camera's roll as its gyro tells it, and the gyro's offset in it.
//!
//! A gyro at rest tells a rate as well: its zero-rate offset. Whoever holds a camera turns it to and fro, but not round: over a
//! stretch of time the camera comes back to about where it was, and the mean of what the gyro tells is the offset. So no
//! calibration is asked for; the longer a rotor is looked at, the better the offset is known. Where the mean is more than an
//! offset may well be, the camera is not held, and only what was stated is known.

use crate::math::sqrt;

/// How far a camera that is held has rolled between any two instants, one standard deviation in radians: twice that is 11 degrees,
/// at which a picture is plainly askew.
const HELD_RAD: f32 = 0.1;
/// Offset that a gyro may well have, one standard deviation in rad/s: cameras at rest have shown 5 and 18 mrad/s. (Data sheets only promise ten
/// times that.)
const LIKELY_RAD_S: f32 = 0.03;
/// So many of these deviations are no offset of a camera that is held.
const NOT_HELD: f32 = 3.0;
/// Seconds beyond which what was heard first counts less and less: an offset wanders with the temperature.
const LONGEST_S: f32 = 60.0;
/// No offset is known better than this, in rad/s: a degree of temperature moves that of the MPU-6150 by as much (its data sheet:
/// 20 degrees a second from -40 to 85 °C).
const LEAST_SIGMA_RAD_S: f32 = 3e-3;

/// How far a gyro says that the camera has rolled, positive = the scene turned clockwise on the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Roll {
    angle_rad: f32,
    time_s: f32,
}

impl Roll {
    /// None at all.
    pub const NONE: Self = Self { angle_rad: 0.0, time_s: 0.0 };

    /// So much at this mean rate in rad/s.
    pub(super) fn at(rate_rad_s: f32, time_us: u32) -> Self {
        let time_s = time_us as f32 * 1e-6;
        Self { angle_rad: rate_rad_s * time_s, time_s }
    }

    /// This and what came behind it.
    // Not inlined: flash is short.
    #[must_use]
    #[inline(never)]
    pub(super) fn and(self, later: Self) -> Self {
        let share = if self.time_s > LONGEST_S { 0.5 } else { 1.0 };
        Self {
            angle_rad: share * self.angle_rad + later.angle_rad,
            time_s: share * self.time_s + later.time_s,
        }
    }

    /// The gyro's offset and its standard deviation in rad/s, where `sigma_rad_s` was all that was known of it.
    #[must_use]
    pub fn offset(self, sigma_rad_s: f32) -> (f32, f32) {
        // Both multiplied by the time, which may be none.
        let (mean, stated) = (HELD_RAD, sigma_rad_s * self.time_s);
        let likely = sigma_rad_s.min(LIKELY_RAD_S) * self.time_s;
        if self.angle_rad.abs() > NOT_HELD * sqrt(likely * likely + mean * mean) {
            // It rolls round, and what it has turned by says nothing about the offset.
            return (0.0, sigma_rad_s.max(LEAST_SIGMA_RAD_S));
        }
        let both = sqrt(mean * mean + stated * stated);
        let weight = stated / both;
        let mean_rad_s = if self.time_s > 0.0 { self.angle_rad / self.time_s } else { 0.0 };
        (weight * weight * mean_rad_s, (sigma_rad_s * mean / both).max(LEAST_SIGMA_RAD_S))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_is_known_the_better_the_longer_it_is_heard() {
        const OFFSET_RAD_S: f32 = 0.02;
        let (mut roll, mut before_rad_s) = (Roll::NONE, f32::MAX);
        let (offset_rad_s, sigma_rad_s) = roll.offset(0.25);
        assert!(offset_rad_s == 0.0 && (sigma_rad_s - 0.25).abs() < 1e-7);
        for second in 1..=600 {
            roll = roll.and(Roll::at(OFFSET_RAD_S, 1_000_000));
            let (offset_rad_s, sigma_rad_s) = roll.offset(0.2);
            assert!(
                (offset_rad_s - OFFSET_RAD_S).abs() < sigma_rad_s,
                "{second} s: {offset_rad_s}"
            );
            assert!(sigma_rad_s <= before_rad_s || second > 60, "{second} s: {sigma_rad_s}");
            assert!(sigma_rad_s < 1.01 * (HELD_RAD / second as f32).max(LEAST_SIGMA_RAD_S * 1.2));
            before_rad_s = sigma_rad_s;
        }
    }

    #[test]
    fn what_drifts_is_followed() {
        let minutes = |roll: Roll, rate_rad_s: f32, minutes: usize| {
            (0..60 * minutes).fold(roll, |roll, _| roll.and(Roll::at(rate_rad_s, 1_000_000)))
        };
        let cold = minutes(Roll::NONE, 0.02, 60);
        let (offset_rad_s, sigma_rad_s) = minutes(cold, 0.03, 5).offset(0.2);
        assert!((offset_rad_s - 0.03).abs() < sigma_rad_s, "{offset_rad_s} +/- {sigma_rad_s}");
    }

    #[test]
    fn a_camera_that_rolls_round_tells_no_offset() {
        let second = || Roll::at(0.3, 1_000_000);
        let roll = (0..20).fold(Roll::NONE, |roll, _| roll.and(second()));
        assert_eq!(roll.offset(0.2), (0.0, 0.2));
        assert_eq!(roll.offset(3e-3), (0.0, 3e-3));
    }

    #[test]
    fn what_was_calibrated_is_believed() {
        // Half a second in which the camera rolled at 0.3 rad/s.
        let (offset_rad_s, sigma_rad_s) = Roll::at(0.3, 500_000).offset(3e-3);
        assert!(offset_rad_s.abs() < 1e-4 && sigma_rad_s == LEAST_SIGMA_RAD_S, "{offset_rad_s}");
    }
}

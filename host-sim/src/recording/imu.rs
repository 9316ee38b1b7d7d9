//! Samples of the camera's inertial sensor, in the camera's own axes.

use evtach_core::GyroSample;

/// Standard gravity in m/s^2: recordings give acceleration in units of it.
pub(crate) const GRAVITY_M_S2: f32 = 9.806_65;

/// One sample of gyroscope and accelerometer.
///
/// Axes: x to the right of the picture, y down, z out of the lens towards the scene; rates by the right-hand rule, so a
/// positive rate about z turns the camera clockwise as seen from behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Sensor time in microseconds, same clock as the events.
    pub t_us: u64,
    /// Angular rate about x, y, z in rad/s.
    pub gyro_rad_s: [f32; 3],
    /// Acceleration along x, y, z in m/s^2, gravity's reaction included: a camera at rest shows about -9.8 along y.
    pub accel_m_s2: [f32; 3],
}

impl ImuSample {
    /// What the sensor of an upright camera tells that only rolls: the other way round of [`Self::roll`].
    #[must_use]
    pub fn rolling(sample: &GyroSample) -> Self {
        Self {
            t_us: sample.t_us,
            gyro_rad_s: [0.0, 0.0, -sample.roll_rad_s],
            accel_m_s2: [0.0, -GRAVITY_M_S2, 0.0],
        }
    }

    /// Roll about the optical axis as the core wants it: a camera that turns clockwise makes a still scene turn
    /// counter-clockwise on the screen.
    #[must_use]
    pub fn roll(&self) -> GyroSample {
        GyroSample { t_us: self.t_us, roll_rad_s: -self.gyro_rad_s[2] }
    }
}

/// From degrees per second.
pub(crate) fn from_degrees(rate: [f32; 3]) -> [f32; 3] {
    rate.map(f32::to_radians)
}

/// From multiples of gravity.
pub(crate) fn from_gravities(acceleration: [f32; 3]) -> [f32; 3] {
    acceleration.map(|value| value * GRAVITY_M_S2)
}

/// To degrees per second.
pub(crate) fn to_degrees(rate: [f32; 3]) -> [f32; 3] {
    rate.map(f32::to_degrees)
}

/// To multiples of gravity.
pub(crate) fn to_gravities(acceleration: [f32; 3]) -> [f32; 3] {
    acceleration.map(|value| value / GRAVITY_M_S2)
}

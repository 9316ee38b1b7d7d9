//! The speeds that a mean over a recording is made of.

use std::f64::consts::PI;
use std::ops::Range;

use evtach_core::{Frame, Reading, Speed};

/// What a hand rolls a camera to and fro by, in rad/s: it is in the swing that a window shows, and not in a speed relative to the room.
const HAND_ROLL_RAD_S: f64 = 0.2;

/// When a reading's window lies.
pub fn window_us(reading: &Reading) -> Range<u64> {
    let start_us = reading.t_us.saturating_sub(u64::from(reading.window_us) / 2);
    start_us..start_us + u64::from(reading.window_us)
}

/// The mean speed within one reading's window.
pub struct Piece {
    pub window_us: Range<u64>,
    pub speed: Speed,
    pub swing_rad_s: f64,
}

impl Piece {
    /// A rotor's speed in a reading, and how it swings within the window.
    pub fn new(reading: &Reading, speed: Speed, swing_rad_s: Option<f32>) -> Self {
        Self {
            window_us: window_us(reading),
            speed,
            swing_rad_s: f64::from(swing_rad_s.unwrap_or(0.0)),
        }
    }

    pub fn length_us(&self) -> u64 {
        self.window_us.end - self.window_us.start
    }

    pub fn middle_us(&self) -> u64 {
        self.window_us.start.midpoint(self.window_us.end)
    }

    pub fn omega_rad_s(&self) -> f64 {
        f64::from(self.speed.omega_rad_s)
    }

    pub fn variance(&self) -> f64 {
        f64::from(self.speed.omega_sigma_rad_s).powi(2)
    }

    /// Variance of the speed within the window, beside that of a steady acceleration.
    pub fn swing_variance(&self, slope_rad_s2: f64) -> f64 {
        // A ramp's, taken for one swing of that bend.
        let by_ramp = PI / 45_f64.sqrt() * slope_rad_s2 * 0.5e-6 * self.length_us() as f64;
        let by_hand = match self.speed.frame {
            Frame::Camera => 0.0,
            Frame::Room => HAND_ROLL_RAD_S,
        };
        (self.swing_rad_s.powi(2) - by_hand.powi(2) - by_ramp.powi(2)).max(0.0)
    }

    /// Finite also for a sigma of zero.
    pub fn weight(&self) -> f64 {
        1.0 / self.variance().max(f64::from(f32::MIN_POSITIVE))
    }
}

/// Mean of the readings, each with the weight of its error.
pub fn weighted_mean(pieces: &[Piece], of: impl Fn(&Piece) -> f64) -> f64 {
    let weight: f64 = pieces.iter().map(Piece::weight).sum();
    pieces.iter().map(|p| p.weight() * of(p)).sum::<f64>() / weight
}

/// The difference is taken in whole microseconds: late times have no exact f64.
pub fn seconds(from_us: u64, to_us: u64) -> f64 {
    to_us.wrapping_sub(from_us).cast_signed() as f64 * 1e-6
}

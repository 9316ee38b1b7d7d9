//! The last readings of the rotor that the big number shows.

use heapless::Deque;

/// Readings kept: 96 x 16 B = 1.5 KiB, ten seconds at ten readings a second.
pub const TREND_POINTS: usize = 96;

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TrendPoint {
    /// Sensor time in microseconds.
    pub t_us: u64,
    /// Speed in revolutions per minute.
    pub rpm: f32,
    /// Standard error in revolutions per minute.
    pub rpm_sigma: f32,
}

/// The last readings, oldest first.
#[derive(Debug)]
pub struct Trend {
    points: Deque<TrendPoint, TREND_POINTS>,
}

impl Trend {
    pub(super) const NEW: Self = Self { points: Deque::new() };

    /// The readings, oldest first.
    pub fn points(&self) -> impl Iterator<Item = &TrendPoint> {
        self.points.iter()
    }

    /// Number of readings.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    pub(super) fn push(&mut self, point: TrendPoint) {
        // Time that goes back is that of a new recording, or of a sensor that was switched on again.
        if self.points.back().is_some_and(|last| last.t_us >= point.t_us) {
            self.points.clear();
        }
        if self.points.is_full() {
            self.points.pop_front();
        }
        self.points.push_back(point).ok();
    }

    pub(super) fn clear(&mut self) {
        self.points.clear();
    }
}

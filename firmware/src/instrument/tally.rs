//! What is remembered of each rotor: extremes, mean and revolutions since the last reset.

use core::f32::consts::TAU;

use evtach_core::limits::MAX_ROTORS;
use evtach_core::{RotorReading, Speed};
use heapless::Vec;

/// Readings farther apart leave a gap between them: a camera that sees nothing gives none.
const MOST_GAP_US: u64 = 2_000_000;

/// A speed with its standard error, both in revolutions per minute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rpm {
    pub value: f32,
    pub sigma: f32,
}

impl Rpm {
    /// The magnitude of a rotor's speed.
    pub fn of(rotor: &RotorReading) -> Option<Self> {
        let speed = rotor.speed.as_ref()?;
        Some(Self { value: speed.rpm(), sigma: speed.rpm_sigma() })
    }
}

/// What is remembered of one rotor since the last reset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tally {
    id: u8,
    pub(super) max: Rpm,
    pub(super) min: Rpm,
    mean_rpm: f32,
    mean_variance: f32,
    readings: u32,
    micro_turns: u64,
    last: Rpm,
    last_us: u64,
    /// Whether the reading before this one measured the rotor too.
    running: bool,
}

impl Tally {
    const fn new(id: u8, rpm: Rpm, t_us: u64) -> Self {
        Self {
            id,
            max: rpm,
            min: rpm,
            mean_rpm: 0.0,
            mean_variance: 0.0,
            readings: 0,
            micro_turns: 0,
            last: rpm,
            last_us: t_us,
            running: false,
        }
    }

    /// Counts one reading.
    fn add(&mut self, rpm: Rpm, t_us: u64) {
        if rpm.value > self.max.value {
            self.max = rpm;
        }
        if rpm.value < self.min.value {
            self.min = rpm;
        }
        self.readings = self.readings.saturating_add(1);
        let share = 1.0 / self.readings as f32;
        self.mean_rpm += (rpm.value - self.mean_rpm) * share;
        self.mean_variance += (rpm.sigma * rpm.sigma - self.mean_variance) * share;
        if self.running && (1..=MOST_GAP_US).contains(&t_us.saturating_sub(self.last_us)) {
            // The trapezoid under the speed: exact while it changes evenly from reading to reading.
            let mean_rad_s = 0.5 * (self.last.value + rpm.value) / Speed::RPM_PER_RAD_S;
            let turned = mean_rad_s * (t_us - self.last_us) as f32 / TAU;
            self.micro_turns = self.micro_turns.saturating_add(turned as u64);
        }
        (self.last, self.last_us, self.running) = (rpm, t_us, true);
    }

    /// Mean of the readings. Its error is that of one reading: windows overlap and share one clock, so that many
    /// readings do not make it much smaller.
    pub(super) fn mean(&self) -> Rpm {
        Rpm { value: self.mean_rpm, sigma: evtach_core::math::sqrt(self.mean_variance) }
    }

    /// Fastest reading in revolutions per minute.
    #[must_use]
    pub const fn max_rpm(&self) -> f32 {
        self.max.value
    }

    /// Slowest reading in revolutions per minute.
    #[must_use]
    pub const fn min_rpm(&self) -> f32 {
        self.min.value
    }

    /// Mean of the readings in revolutions per minute.
    #[must_use]
    pub const fn mean_rpm(&self) -> f32 {
        self.mean_rpm
    }

    /// Readings within.
    #[must_use]
    pub const fn readings(&self) -> u32 {
        self.readings
    }

    /// Millionths of revolutions while the rotor was measured.
    #[must_use]
    pub const fn micro_turns(&self) -> u64 {
        self.micro_turns
    }

    /// Tenths of revolutions while the rotor was measured.
    #[must_use]
    pub const fn turns_tenths(&self) -> u64 {
        self.micro_turns.saturating_add(50_000) / 100_000
    }
}

/// All rotors since the last reset.
#[derive(Debug)]
pub(super) struct Tallies(Vec<Tally, MAX_ROTORS>);

impl Tallies {
    pub const NEW: Self = Self(Vec::new());

    pub fn of(&self, id: u8) -> Option<&Tally> {
        self.0.iter().find(|tally| tally.id == id)
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Counts one reading: `measured` are the rotors that have a speed in it. Revolutions of the others pause.
    pub fn add(&mut self, t_us: u64, measured: impl Iterator<Item = (u8, Rpm)>) {
        for (id, rpm) in measured {
            if let Some(tally) = self.0.iter_mut().find(|tally| tally.id == id) {
                tally.add(rpm, t_us);
                continue;
            }
            if self.0.is_full()
                && let Some((oldest, _)) =
                    self.0.iter().enumerate().min_by_key(|(_, tally)| tally.last_us)
            {
                self.0.swap_remove(oldest);
            }
            let mut tally = Tally::new(id, rpm, t_us);
            tally.add(rpm, t_us);
            self.0.push(tally).ok();
        }
        for tally in &mut self.0 {
            tally.running &= tally.last_us == t_us;
        }
    }
}

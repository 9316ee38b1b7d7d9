//! One pixel: its fixed properties, and what becomes of its events on their way out.

use evtach_core::{Event, Polarity};
use rand::Rng as _;
use rand_distr::{Distribution as _, Exp1};
use rand_pcg::Pcg64Mcg;

use super::made::Made;
use super::random::{Purpose, normal, stream};
use super::scene::Sensor;

/// One pixel with its random numbers.
#[derive(Debug)]
pub struct Pixel<'a> {
    sensor: &'a Sensor,
    x: u16,
    y: u16,
    on: f64,
    off: f64,
    latency_s: f64,
    rng: Pcg64Mcg,
}

/// Where events go: those of one row of pixels within the recording, in the order they were made.
pub type Tray = Vec<Made>;

/// Recording span and clock.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Length in seconds of true time.
    pub duration_s: f64,
    /// Sensor microseconds per true second.
    pub ticks_per_s: f64,
}

impl Span {
    /// Sensor time in microseconds of a true time, or `None` outside of the recording.
    #[must_use]
    pub fn stamp(&self, t_s: f64) -> Option<u64> {
        let inside = t_s >= 0.0 && t_s < self.duration_s;
        inside.then_some((t_s * self.ticks_per_s) as u64)
    }
}

impl<'a> Pixel<'a> {
    /// The pixel at a place.
    #[must_use]
    pub fn new(sensor: &'a Sensor, seed: u64, x: u16, y: u16) -> Self {
        let place = u64::from(y) << 16 | u64::from(x);
        let mut fixed = stream(seed, Purpose::Pixel, place);
        let mut threshold =
            || sensor.threshold * (1.0 + sensor.threshold_spread * normal(&mut fixed)).max(0.3);
        let (on, off) = (threshold(), threshold());
        let latency_s = sensor.latency_spread_us * 1e-6 * normal(&mut fixed);
        Self { sensor, x, y, on, off, latency_s, rng: stream(seed, Purpose::Events, place) }
    }

    /// Threshold towards brighter.
    #[must_use]
    pub fn on(&self) -> f64 {
        self.on
    }

    /// Threshold towards darker.
    #[must_use]
    pub fn off(&self) -> f64 {
        self.off
    }

    /// Time in reset after an event, in seconds.
    #[must_use]
    pub fn refractory_s(&self) -> f64 {
        self.sensor.refractory_us * 1e-6
    }

    /// Whether it knows nothing of what was before the recording.
    pub fn starts_cold(&self) -> bool {
        self.sensor.cold_start
    }

    /// A number from `least` to `least + spread`, drawn evenly.
    pub fn drawn(&mut self, least: u32, spread: u32) -> u32 {
        least + self.rng.random_range(0..=spread)
    }

    /// Sends an event that happened at a true time on its way.
    pub fn fire(
        &mut self,
        t_s: f64,
        polarity: Polarity,
        rotor: Option<usize>,
        span: &Span,
        tray: &mut Tray,
    ) {
        let lost = rotor.is_some() && self.rng.random::<f64>() < self.sensor.dropout;
        let delay = self.latency_s + self.sensor.jitter_us * 1e-6 * normal(&mut self.rng);
        let Some(t_us) = span.stamp(t_s + delay).filter(|_| !lost) else { return };
        self.put(t_us, polarity, rotor, tray);
    }

    /// Adds events that come from nowhere, at a rate in Hz.
    pub fn noise(&mut self, rate_hz: f64, on_only: bool, span: &Span, tray: &mut Tray) {
        if rate_hz <= 0.0 {
            return;
        }
        let mut t_s = 0.0;
        loop {
            let gap: f64 = Exp1.sample(&mut self.rng);
            t_s += gap / rate_hz;
            let Some(t_us) = span.stamp(t_s) else { return };
            let on = on_only || self.rng.random::<bool>();
            self.put(t_us, if on { Polarity::On } else { Polarity::Off }, None, tray);
        }
    }

    fn put(&self, t_us: u64, polarity: Polarity, rotor: Option<usize>, tray: &mut Tray) {
        let polarity = if self.sensor.all_on { Polarity::On } else { polarity };
        tray.push(Made::new(Event { t_us, x: self.x, y: self.y, polarity }, rotor));
    }
}

//! The one front door: events in, readings out.

use crate::event::{Event, Geometry, GyroSample};
use crate::reading::Reading;

/// A rectangle of pixels; events outside are ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roi {
    /// Left edge in pixels.
    pub x: u16,
    /// Top edge in pixels.
    pub y: u16,
    /// Width in pixels.
    pub width_px: u16,
    /// Height in pixels.
    pub height_px: u16,
}

/// What the person chose; everything has a default that needs no knowledge of the rotor.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Size of the sensor.
    pub geometry: Geometry,
    /// Part of the sensor to look at.
    pub roi: Option<Roi>,
    /// Blade count, when it is known; `None` finds it.
    pub blades: Option<u8>,
    /// Length of the window in microseconds; `None` adapts it to the rotor.
    pub window_us: Option<u32>,
    /// One standard deviation of the sensor clock's error, in ppm.
    pub clock_sigma_ppm: f32,
}

impl Settings {
    /// Settings that fit any rotor in front of a sensor of this size.
    #[must_use]
    pub const fn new(geometry: Geometry) -> Self {
        Self { geometry, roi: None, blades: None, window_us: None, clock_sigma_ppm: 15.0 }
    }
}

/// One event as the store keeps it, 8 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct StoredEvent {
    pub(crate) t_us: u32,
    pub(crate) x: u16,
    pub(crate) y_polarity: u16,
}

/// Memory lent by the caller: its sizes are the only difference between device and PC.
#[derive(Debug)]
pub struct Memory<'m> {
    /// Event store; the device lends [`crate::limits::DEVICE_EVENTS`].
    pub events: &'m mut [StoredEvent],
    /// Heat map cells; the device lends [`crate::limits::DEVICE_HEAT_CELLS`].
    pub heat: &'m mut [u16],
}

/// What [`Tachometer::poll`] did.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "no heap to box it on")]
pub enum Poll {
    /// Nothing to measure until more events arrive.
    Idle,
    /// The budget is used up; poll again.
    Pending,
    /// A window has been measured.
    Ready(Reading),
}

/// Events in, readings out.
#[derive(Debug)]
pub struct Tachometer<'m> {
    settings: Settings,
    memory: Memory<'m>,
}

impl<'m> Tachometer<'m> {
    /// A tachometer over the lent memory.
    #[must_use]
    pub fn new(settings: Settings, memory: Memory<'m>) -> Self {
        Self { settings, memory }
    }

    /// Takes in events in time order; never waits for a measurement.
    pub fn push(&mut self, _events: &[Event]) {}

    /// Counts events that the sensor or the link lost.
    pub fn lost(&mut self, _count: u64) {}

    /// Takes in a gyro sample.
    pub fn gyro(&mut self, _sample: GyroSample) {}

    /// Advances the measurement by about `budget` point operations (about 100 instructions each).
    pub fn poll(&mut self, _budget: u32) -> Poll {
        let _ = (&self.settings, &self.memory);
        Poll::Idle
    }

    /// Ends the stream: what is in the window is to be measured even if the window is not full.
    pub fn finish(&mut self) {}
}

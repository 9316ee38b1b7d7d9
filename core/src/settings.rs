//! What the caller of the tachometer chooses, lends and gets back.

use crate::event::Geometry;
use crate::reading::Reading;
use crate::speed::polar::PolarTrack;
use crate::store::StoredEvent;
use crate::tachometer::Work;

/// A rectangle of pixels; events outside are ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

impl Roi {
    /// Whether the pixel lies inside.
    #[must_use]
    pub const fn contains(self, x: u16, y: u16) -> bool {
        x >= self.x && y >= self.y && x - self.x < self.width_px && y - self.y < self.height_px
    }
}

/// What the person chose; everything has a default that needs no knowledge of the rotor.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Size of the sensor.
    pub geometry: Geometry,
    /// Part of the sensor to look at.
    pub roi: Option<Roi>,
    /// Blade count, when it is known, 1 to [`MOST_STATED_BLADES`](crate::limits::MOST_STATED_BLADES); `None` finds it.
    pub blades: Option<u8>,
    /// Length of the window in microseconds; `None` adapts it to the rotor.
    pub window_us: Option<u32>,
    /// One standard deviation of the sensor clock's error, in ppm.
    pub clock_sigma_ppm: f32,
    /// One standard deviation of the gyro's zero-rate offset in rad/s, as far as it is known before it is heard: it is found
    /// while measuring.
    pub gyro_sigma_rad_s: f32,
    /// Whether the paper's further refinement is measured, too, which no speed needs: for comparison with the paper. No other result
    /// depends on it.
    pub all_stages: bool,
}

/// Standard deviation of the zero-rate offset in rad/s of a gyro that nobody calibrated: within 20 degrees a second (data sheet of the
/// MPU-6150; the BMI160's says 3).
const UNCALIBRATED_RAD_S: f32 = 0.2;

impl Settings {
    /// Settings that fit any rotor in front of a sensor of this size.
    #[must_use]
    pub const fn new(geometry: Geometry) -> Self {
        Self {
            geometry,
            roi: None,
            blades: None,
            window_us: None,
            clock_sigma_ppm: 15.0,
            gyro_sigma_rad_s: UNCALIBRATED_RAD_S,
            all_stages: false,
        }
    }

    /// What is looked at: the part of the sensor that was chosen, as far as there are pixels, or all of it.
    #[must_use]
    pub fn view(&self) -> Roi {
        let Geometry { width_px, height_px } = self.geometry;
        let Roi { x, y, width_px: across_px, height_px: down_px } =
            self.roi.unwrap_or(Roi { x: 0, y: 0, width_px, height_px });
        Roi {
            x,
            y,
            width_px: across_px.min(width_px.saturating_sub(x)),
            height_px: down_px.min(height_px.saturating_sub(y)),
        }
    }
}

/// Memory lent by the caller: its sizes are the only difference between device and PC.
#[derive(Debug)]
pub struct Memory<'m> {
    /// Event store; the device lends [`crate::limits::DEVICE_EVENTS`].
    pub events: &'m mut [StoredEvent],
    /// Heat map; the device lends [`crate::limits::DEVICE_HEAT_CELLS`].
    pub heat: &'m mut [u16],
    /// Weights of the heat map's cells: as many.
    pub weights: &'m mut [u8],
    /// What measuring works in.
    pub work: &'m mut Work,
    /// Room for more events than fit there; the device lends none.
    pub more: Option<More<'m>>,
}

/// Room for more events to search among: what a share s of N events keeps step with stands out from chance by s^2 N.
#[derive(Debug)]
pub struct More<'m> {
    /// Times of those that are searched: more than [`crate::limits::VISITS`], and at most 65 535.
    pub times: &'m mut [u16],
    /// Those of a rotor whose centre, speed and harmonic are looked for: more than [`crate::limits::POLAR_EVENTS`].
    pub track: &'m mut PolarTrack,
}

/// What [`crate::Tachometer::poll`] did.
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

/// Events that were handed in and not used, by cause, since the start: each counts once, whatever it stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ignored {
    /// Outside the sensor.
    pub out_of_bounds: u64,
    /// Outside the region of interest.
    pub out_of_roi: u64,
    /// Older than the event before, or from a future that no clock reaches.
    pub out_of_order: u64,
    /// In no window that was measured: they arrived while a measurement lasted longer than the store does, or right before
    /// a break in the stream.
    pub overrun: u64,
}

//! What is in front of the camera, and the camera itself: everything a recording is made from.
//!
//! [`Scene::default`] is the standard scene that every accuracy table refers to.

use serde::{Deserialize, Serialize};

/// A complete description of a recording; equal scenes give equal recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// Columns of the sensor, 1 to 2048.
    pub width_px: u16,
    /// Rows of the sensor, 1 to 2048.
    pub height_px: u16,
    /// Length of the recording in milliseconds, above 0 and up to 60 000.
    pub duration_ms: f64,
    /// How brightness becomes events.
    pub model: Model,
    /// Everything random follows from it.
    pub seed: u64,
    /// Rotors in painter's order: later ones hide earlier ones.
    pub rotors: Vec<Rotor>,
    /// Motion of the camera.
    pub camera: Camera,
    /// Motion of what the rotors are mounted on.
    pub vibration: Vibration,
    /// Pixels and readout.
    pub sensor: Sensor,
    /// The sensor's clock.
    pub clock: Clock,
    /// What is behind the rotors.
    pub background: Background,
    /// A lamp on mains current.
    pub lamp: Option<Lamp>,
    /// Things that move without turning.
    pub movers: Vec<Mover>,
}

/// How brightness becomes events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// Every pixel compares the rendered logarithm of its intensity with the level of its last event.
    #[default]
    Threshold,
    /// Every passage of a blade's edge over a pixel's centre gives one event, computed in closed form.
    /// Background, lamp and movers still go through the threshold model.
    Edge,
}

/// One rotor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rotor {
    /// Column of the axis at rest, in pixels.
    pub x_px: f64,
    /// Row of the axis at rest, in pixels.
    pub y_px: f64,
    /// Radius of the blade tips in pixels, above 2.
    pub radius_px: f64,
    /// Radius of the hub in pixels; `None`: a fifth of the radius.
    pub hub_px: Option<f64>,
    /// Blades, spokes or marks, 1 to 32.
    pub blades: u8,
    /// Their shape.
    pub shape: Shape,
    /// Width of the first blade relative to the others, above 0 and up to 1.2; 1: all alike.
    pub odd_width: f64,
    /// Standard deviation of the blades' angles about even places in milliradians, drawn from the seed, 0 to 20; 0: exactly even.
    pub blade_spread_mrad: f64,
    /// Speed relative to the room at the start, in revolutions per minute; positive is clockwise on the screen.
    pub rpm: f64,
    /// Relative change of the speed per second: rpm(t) = rpm * (1 + ramp * t).
    pub ramp_per_s: f64,
    /// Relative amplitude of the motor's hunting.
    pub hunting: f64,
    /// Frequency of the hunting in Hz.
    pub hunting_hz: f64,
    /// Angle between axis and line of sight in degrees, below 80.
    pub tilt_deg: f64,
    /// Direction on the screen of the axis about which the disc is tilted, in degrees.
    pub tilt_axis_deg: f64,
    /// Logarithm of blade intensity over background intensity; negative: dark blades.
    pub contrast: f64,
    /// Angle of the first blade at time 0 in degrees; `None`: drawn from the seed.
    pub phase_deg: Option<f64>,
}

/// Shape of a blade.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// A radial bar of constant width.
    Straight,
    /// Wide at the hub, narrow at the tip.
    #[default]
    Tapered,
    /// A sector whose middle line bends against the positive sense of rotation.
    Swept,
    /// Round marks near the rim of an otherwise even disc.
    Dot,
    /// Thin radial bars, as in a wheel.
    Spokes,
}

/// Motion of the camera.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Camera {
    /// Hand tremor: rms of the image's shift along each axis in pixels, at 1.3, 2.7, 8.5 and 10.3 Hz.
    pub tremor_px: f64,
    /// Hand tremor: rms of the image's roll in milliradians, same frequencies.
    pub tremor_mrad: f64,
    /// Steady drift of the image in pixels per second, right and down.
    pub drift_px_s: [f64; 2],
    /// Steady roll of the image in radians per second, positive clockwise on the screen.
    pub roll_rad_s: f64,
    /// Inertial sensor in the camera.
    pub gyro: Option<Gyro>,
}

/// Roll-rate samples of an inertial sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gyro {
    /// Samples per second.
    pub rate_hz: f64,
    /// Noise of one sample, one standard deviation in rad/s.
    pub noise_rad_s: f64,
    /// Zero-rate offset in rad/s.
    pub offset_rad_s: f64,
}

/// Motion of what the rotors are mounted on, along one direction drawn from the seed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Vibration {
    /// Amplitude at the base frequency in pixels.
    pub amplitude_px: f64,
    /// Amplitude at twice the base frequency in pixels.
    pub second_px: f64,
    /// Base frequency in Hz; `None`: drawn from 35 to 60 Hz.
    pub frequency_hz: Option<f64>,
}

/// Pixels and readout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sensor {
    /// Contrast threshold: change of the logarithm of intensity that makes an event.
    pub threshold: f64,
    /// Standard deviation of the threshold over the pixels, relative.
    pub threshold_spread: f64,
    /// Time after an event during which a pixel is held in reset, in microseconds.
    pub refractory_us: f64,
    /// Standard deviation of the pixels' fixed latencies in microseconds.
    pub latency_spread_us: f64,
    /// Random delay of every event, one standard deviation in microseconds.
    pub jitter_us: f64,
    /// Background noise in events per second and pixel, either polarity.
    pub noise_hz: f64,
    /// Pixels that fire on their own.
    pub hot_pixels: u32,
    /// Their rate in Hz.
    pub hot_hz: f64,
    /// Share of the rotor's events that are lost one by one, 0 to 1.
    pub dropout: f64,
    /// Standard deviation of the optical blur in pixels.
    pub blur_px: f64,
    /// Capacity of the readout in events per microsecond; `None`: no limit.
    pub readout_mev_s: Option<f64>,
    /// Events that may wait for the readout; more are lost.
    pub readout_queue: u32,
    /// Every event is reported as ON, as some broken recordings do.
    pub all_on: bool,
    /// The pixels know nothing of what was before the recording, as where a sensor or its simulator is only just started: each
    /// takes what it sees at first for its level, and times its first edge otherwise than later ones. Threshold model only.
    pub cold_start: bool,
}

/// The sensor's clock.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Clock {
    /// One standard deviation of the clock's error in ppm, as its maker would state it.
    pub sigma_ppm: f64,
    /// The error itself in ppm, positive: the clock is fast; `None`: drawn from `sigma_ppm`.
    pub error_ppm: Option<f64>,
}

/// What is behind the rotors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Background {
    /// Standard deviation of the logarithm of intensity; 0: plain.
    pub contrast: f64,
    /// Size of the texture's features in pixels.
    pub grain_px: f64,
    /// Box-shaped objects with sharp edges.
    pub boxes: u32,
}

/// A lamp on mains current: the intensity follows 1 + depth * wave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Lamp {
    /// Frequency of the light (twice the mains') in Hz.
    pub frequency_hz: f64,
    /// Depth of the modulation, 0 to 0.95.
    pub depth: f64,
    /// Relative amplitudes of the second, third, ... harmonic.
    pub harmonics: Vec<f64>,
    /// Lit spot as x, y and radius in pixels; `None`: everything is lit.
    pub spot_px: Option<[f64; 3]>,
}

/// Something that moves without turning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Mover {
    /// Parallel bars that slide across.
    Bars {
        /// Direction of the motion on the screen in degrees.
        direction_deg: f64,
        /// Speed in pixels per second.
        speed_px_s: f64,
        /// Width of a bar in pixels; very wide: one edge.
        width_px: f64,
        /// Distance from bar to bar in pixels; `None`: a single bar.
        spacing_px: Option<f64>,
        /// Distance of the first bar's middle from the sensor's middle at time 0, along the motion, in pixels.
        offset_px: f64,
        /// Logarithm of intensity over the background.
        contrast: f64,
    },
    /// A walking figure: body, head and swinging limbs.
    Walker {
        /// Start of the body's middle, in pixels.
        x_px: f64,
        /// Start of the body's middle, in pixels.
        y_px: f64,
        /// Height in pixels.
        height_px: f64,
        /// Speed to the right in pixels per second.
        speed_px_s: f64,
        /// Steps per second.
        step_hz: f64,
        /// Logarithm of intensity over the background.
        contrast: f64,
    },
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            width_px: 346,
            height_px: 260,
            duration_ms: 150.0,
            model: Model::default(),
            seed: 0,
            rotors: vec![Rotor::default()],
            camera: Camera::default(),
            vibration: Vibration::default(),
            sensor: Sensor::default(),
            clock: Clock::default(),
            background: Background::default(),
            lamp: None,
            movers: Vec::new(),
        }
    }
}

impl Default for Rotor {
    fn default() -> Self {
        Self {
            x_px: 173.0,
            y_px: 130.0,
            radius_px: 50.0,
            hub_px: None,
            blades: 3,
            shape: Shape::default(),
            odd_width: 1.0,
            blade_spread_mrad: 0.0,
            rpm: 3000.0,
            ramp_per_s: 0.0,
            hunting: 0.0,
            hunting_hz: 4.0,
            tilt_deg: 0.0,
            tilt_axis_deg: 0.0,
            contrast: 0.8,
            phase_deg: None,
        }
    }
}

impl Default for Gyro {
    fn default() -> Self {
        // A consumer inertial sensor after its zero was taken with the camera at rest.
        Self { rate_hz: 1000.0, noise_rad_s: 0.003, offset_rad_s: 0.0 }
    }
}

impl Default for Sensor {
    fn default() -> Self {
        Self {
            threshold: 0.3,
            threshold_spread: 0.1,
            refractory_us: 100.0,
            latency_spread_us: 40.0,
            jitter_us: 40.0,
            noise_hz: 1.0,
            hot_pixels: 0,
            hot_hz: 500.0,
            dropout: 0.0,
            blur_px: 0.7,
            readout_mev_s: None,
            readout_queue: 4096,
            all_on: false,
            cold_start: false,
        }
    }
}

impl Default for Clock {
    fn default() -> Self {
        Self { sigma_ppm: 15.0, error_ppm: None }
    }
}

impl Default for Background {
    fn default() -> Self {
        Self { contrast: 0.0, grain_px: 9.0, boxes: 0 }
    }
}

impl Default for Lamp {
    fn default() -> Self {
        Self { frequency_hz: 100.0, depth: 0.5, harmonics: vec![0.2, 0.1], spot_px: None }
    }
}

impl Rotor {
    /// Radius of the hub in pixels.
    #[must_use]
    pub fn hub_radius_px(&self) -> f64 {
        self.hub_px.unwrap_or(self.radius_px * 0.2)
    }

    /// Time until the picture repeats at the given speed, in seconds: a turn over the blades, or a whole turn when
    /// they differ.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        let alike = self.odd_width == 1.0 && self.blade_spread_mrad == 0.0;
        let blades = if alike { f64::from(self.blades) } else { 1.0 };
        60.0 / (self.rpm.abs().max(1e-3) * blades)
    }
}

/// A scene that cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("{place} is {value}, but has to be {allowed}: correct it in the scene")]
pub struct SceneError {
    /// Field, as in the scene file.
    pub place: String,
    /// What it holds.
    pub value: f64,
    /// What it may hold.
    pub allowed: &'static str,
}

impl Scene {
    /// Length of the recording in seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_ms * 1e-3
    }
}

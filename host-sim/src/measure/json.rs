//! The JSON document of `evtach measure --json`: a contract, its version counted by `schema`.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

use evtach_core::{Reading, RotorReading, Status};
use serde::{Deserialize, Serialize};

use super::run::Plan;
use super::summary::Summary;

/// Name and version of this program.
pub const PROGRAM: &str = concat!("evtach ", env!("CARGO_PKG_VERSION"));

/// One recording.
#[derive(Clone, Debug, Serialize)]
pub struct Document {
    /// Version of the contract.
    pub schema: u32,
    /// Name and version of the program that wrote it.
    pub program: &'static str,
    /// What it was told.
    pub settings: SettingsRow,
    /// The file as named by the caller.
    pub file: String,
    /// Name of the format.
    pub format: String,
    /// Columns of the sensor.
    pub width_px: u16,
    /// Rows of the sensor.
    pub height_px: u16,
    /// From the first to the last event that was measured.
    pub duration_s: f64,
    /// Events in the part of the file that was measured.
    pub events: u64,
    /// Events left out on purpose.
    pub thinned: u64,
    /// Events that the sensor or the link lost.
    pub lost: u64,
    /// "locked", "coarse" or "refused".
    pub status: &'static str,
    /// Why it was refused.
    pub reason: Option<&'static str>,
    /// The reading over the whole recording.
    pub rotors: Vec<RotorRow>,
    /// The series as the device would show it.
    pub readings: Vec<ReadingRow>,
}

/// What was stated of the measurement, and what stands unless stated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SettingsRow {
    /// "full" or "device".
    pub capacity: &'static str,
    /// Blade count, where it was stated.
    pub blades: Option<u8>,
    /// Left, top, width and height of the part of the sensor that was looked at.
    pub roi_px: Option<[u16; 4]>,
    /// Length of the window, where it was stated.
    pub window_s: Option<f64>,
    /// From the first event to where the part that was measured begins.
    pub start_s: f64,
    /// And to where it ends, where that was stated.
    pub end_s: Option<f64>,
    /// One standard deviation of the camera clock's error.
    pub clock_ppm: f64,
    /// One standard deviation of the gyro's zero-rate offset, where the gyro was to be taken.
    pub gyro_sigma_rad_s: Option<f64>,
}

/// One rotor of a reading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotorRow {
    /// Letter.
    pub id: String,
    /// Centre at the middle of the window.
    pub x_px: f64,
    /// Centre at the middle of the window.
    pub y_px: f64,
    /// Radius of the swept disc.
    pub radius_px: f64,
    /// Magnitude of the speed.
    pub rpm: Option<f64>,
    /// +/- 1.96 of it covers 95 %.
    pub rpm_sigma: Option<f64>,
    /// "cw" or "ccw" as seen on the screen.
    pub direction: Option<Cow<'static, str>>,
    /// Equal blades, where known.
    pub blades: Option<u8>,
    /// Change of the magnitude.
    pub accel_rpm_per_s: Option<f64>,
    /// "camera" or "room".
    pub frame: Option<Cow<'static, str>>,
    /// "locked", "coarse" or "refused".
    pub status: Cow<'static, str>,
    /// Why it was refused.
    pub reason: Option<Cow<'static, str>>,
}

/// One reading of the series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReadingRow {
    /// Middle of the window, from the file's first event.
    pub t_s: f64,
    /// Length of the window.
    pub window_s: f64,
    /// "locked", "coarse" or "refused".
    pub status: Cow<'static, str>,
    /// Why it was refused.
    pub reason: Option<Cow<'static, str>>,
    /// Its rotors.
    pub rotors: Vec<RotorRow>,
}

/// What is known of the file beside the readings.
#[derive(Clone, Debug, Default)]
pub struct FileFacts {
    /// The file as named by the caller.
    pub file: String,
    /// Name of the format.
    pub format: String,
    /// Columns and rows of the sensor.
    pub size_px: (u16, u16),
    /// First event of the file in sensor time.
    pub origin_us: u64,
    /// First event that was measured in sensor time.
    pub first_us: u64,
    /// Last event that was measured in sensor time.
    pub last_us: u64,
    /// From the first to the last of these in each recording: there are several, where they are put behind each other.
    pub streams_us: Vec<Range<u64>>,
    /// Events that were measured.
    pub events: u64,
    /// Events left out on purpose.
    pub thinned: u64,
    /// Events lost.
    pub lost: u64,
}

fn reason(status: Status) -> Option<&'static str> {
    status.reason().map(evtach_core::Reason::as_str)
}

/// Digits beyond those of f32 would be noise: as written by f32, read as f64. Written as the device writes it, which
/// settles a tie of the last digit.
fn widen(value: f32) -> f64 {
    ryu::Buffer::new().format(value).parse().unwrap_or(f64::from(value))
}

impl FileFacts {
    /// Seconds from the file's first event to a moment of sensor time.
    #[must_use]
    pub fn t_s(&self, t_us: u64) -> f64 {
        t_us.saturating_sub(self.origin_us) as f64 / 1e6
    }

    /// How much of the file was measured, in seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.last_us.saturating_sub(self.first_us) as f64 / 1e6
    }
}

impl SettingsRow {
    /// The row of a plan.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let Plan { settings, capacity, takes_gyro, since_us } = plan;
        let seconds = |us: u64| us as f64 / 1e6;
        Self {
            capacity: capacity.as_str(),
            blades: settings.blades,
            roi_px: settings.roi.map(|roi| [roi.x, roi.y, roi.width_px, roi.height_px]),
            window_s: settings.window_us.map(u64::from).map(seconds),
            start_s: seconds(since_us.start),
            end_s: (since_us.end < u64::MAX).then(|| seconds(since_us.end)),
            clock_ppm: widen(settings.clock_sigma_ppm),
            gyro_sigma_rad_s: takes_gyro.then(|| widen(settings.gyro_sigma_rad_s)),
        }
    }
}

impl fmt::Display for SettingsRow {
    /// What is not null, in the names of the document.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fields = serde_json::to_value(self).unwrap_or_default();
        let stated = fields.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null());
        let told: Vec<_> = stated.map(|(name, value)| format!("{name} {value}")).collect();
        f.write_str(&told.join(", "))
    }
}

impl RotorRow {
    /// The row of a rotor.
    #[must_use]
    pub fn new(rotor: &RotorReading) -> Self {
        let speed = rotor.speed.as_ref();
        Self {
            id: letter(rotor.id),
            x_px: widen(rotor.x_px),
            y_px: widen(rotor.y_px),
            radius_px: widen(rotor.radius_px),
            rpm: speed.map(|s| widen(s.rpm())),
            rpm_sigma: speed.map(|s| widen(s.rpm_sigma())),
            direction: speed.map(|s| s.direction().as_str().into()),
            blades: rotor.blades,
            accel_rpm_per_s: speed.and_then(|s| s.accel_rpm_per_s()).map(widen),
            frame: speed.map(|s| s.frame.as_str().into()),
            status: rotor.status.as_str().into(),
            reason: reason(rotor.status).map(Cow::from),
        }
    }
}

impl ReadingRow {
    /// The row of a reading; `origin_us` is the file's first event in sensor time.
    #[must_use]
    pub fn new(reading: &Reading, origin_us: u64) -> Self {
        Self {
            t_s: reading.t_us.saturating_sub(origin_us) as f64 / 1e6,
            window_s: f64::from(reading.window_us) / 1e6,
            status: reading.status.as_str().into(),
            reason: reason(reading.status).map(Cow::from),
            rotors: reading.rotors.iter().map(RotorRow::new).collect(),
        }
    }
}

impl Document {
    /// The document of a recording that was measured as planned.
    #[must_use]
    pub fn new(plan: &Plan, facts: &FileFacts, summary: &Summary, readings: &[Reading]) -> Self {
        Self {
            schema: 1,
            program: PROGRAM,
            settings: SettingsRow::new(plan),
            file: facts.file.clone(),
            format: facts.format.clone(),
            width_px: facts.size_px.0,
            height_px: facts.size_px.1,
            duration_s: facts.duration_s(),
            events: facts.events,
            thinned: facts.thinned,
            lost: facts.lost,
            status: summary.status.as_str(),
            reason: reason(summary.status),
            rotors: summary.rotors.iter().map(RotorRow::new).collect(),
            readings: readings.iter().map(|r| ReadingRow::new(r, facts.origin_us)).collect(),
        }
    }
}

/// The letter of a rotor: A, B, ... Z, then numbers.
#[must_use]
pub fn letter(id: u8) -> String {
    if id < 26 { char::from(b'A' + id).to_string() } else { format!("R{id}") }
}

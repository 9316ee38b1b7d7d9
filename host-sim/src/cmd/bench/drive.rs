//! Recordings through the tachometer's front door.

use evtach_core::limits::MAX_ROTORS;
use evtach_core::{Event, GyroSample, Reading, Settings, Status};
pub use evtach_host::measure::Capacity;
use evtach_host::measure::{measure_events, summarise};

/// All readings of a recording.
pub fn readings(
    events: &[Event],
    gyro: &[GyroSample],
    settings: Settings,
    capacity: Capacity,
) -> Vec<Reading> {
    measure_events(events, gyro, settings, capacity).0
}

/// The reading that stands for a short recording: the last one with a speed, else the last.
pub fn conclusive(readings: &[Reading]) -> Option<&Reading> {
    let spoken = readings.iter().rev().find(|r| !matches!(r.status, Status::Refused(_)));
    spoken.or(readings.last())
}

/// The reading over a whole recording of several windows, as `measure` shows it.
pub fn overall(readings: &[Reading], end_us: u64, clock_sigma_ppm: f32) -> Option<Reading> {
    let last = readings.last()?;
    let summary = summarise(readings, &(0..end_us), clock_sigma_ppm);
    Some(Reading {
        t_us: end_us / 2,
        window_us: u32::try_from(end_us).unwrap_or(u32::MAX),
        status: summary.status,
        rotors: summary.rotors.into_iter().take(MAX_ROTORS).collect(),
        ..last.clone()
    })
}

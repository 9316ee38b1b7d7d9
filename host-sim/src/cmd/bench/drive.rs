//! Recordings through the tachometer's front door.

use evtach_core::{Event, GyroSample, Reading, Settings, Status};
pub use evtach_host::measure::Capacity;
use evtach_host::measure::measure_events;

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

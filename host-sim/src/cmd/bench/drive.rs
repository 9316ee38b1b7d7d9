//! Recordings through the tachometer's front door.

use evtach_core::limits::{DEVICE_EVENTS, DEVICE_HEAT_CELLS};
use evtach_core::{
    Event, GyroSample, Memory, Poll, Reading, Settings, Status, StoredEvent, Tachometer,
};

/// How much memory the tachometer is lent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Capacity {
    /// A PC's: sixteen times the device's.
    Full,
    /// The device's own.
    Device,
}

impl Capacity {
    /// Both, in the order of the tables.
    pub const ALL: [Self; 2] = [Self::Full, Self::Device];

    /// The name used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Device => "device",
        }
    }

    fn factor(self) -> usize {
        match self {
            Self::Full => 16,
            Self::Device => 1,
        }
    }
}

/// Events handed over at once: less than a millisecond at a million events per second.
const CHUNK: usize = 512;

/// All readings of a recording.
pub fn readings(
    events: &[Event],
    gyro: &[GyroSample],
    settings: Settings,
    capacity: Capacity,
) -> Vec<Reading> {
    let mut store = vec![StoredEvent::default(); DEVICE_EVENTS * capacity.factor()];
    let mut heat = vec![0u16; DEVICE_HEAT_CELLS * capacity.factor()];
    let memory = Memory { events: &mut store, heat: &mut heat };
    let mut tachometer = Tachometer::new(settings, memory);
    let mut readings = Vec::new();
    let mut gyro = gyro.iter().peekable();
    for chunk in events.chunks(CHUNK) {
        let until_us = chunk.last().map_or(0, |e| e.t_us);
        while let Some(sample) = gyro.next_if(|s| s.t_us <= until_us) {
            tachometer.gyro(*sample);
        }
        tachometer.push(chunk);
        drain(&mut tachometer, &mut readings);
    }
    tachometer.finish();
    drain(&mut tachometer, &mut readings);
    readings
}

fn drain(tachometer: &mut Tachometer, readings: &mut Vec<Reading>) {
    loop {
        match tachometer.poll(u32::MAX) {
            Poll::Idle => return,
            Poll::Pending => {}
            Poll::Ready(reading) => readings.push(reading),
        }
    }
}

/// The reading that stands for a short recording: the last one with a speed, else the last.
pub fn conclusive(readings: &[Reading]) -> Option<&Reading> {
    let spoken = readings.iter().rev().find(|r| !matches!(r.status, Status::Refused(_)));
    spoken.or(readings.last())
}

//! From a recording to readings: the device's own tachometer over a file.

mod json;
mod letters;
mod line;
mod mean;
mod parts;
mod pause;
mod piece;
mod run;
mod since;
mod summary;
mod table;
mod ties;
mod timeline;
mod wait;

use std::borrow::Cow;

use evtach_core::limits::{DEVICE_EVENTS, DEVICE_HEAT_CELLS, POLAR_EVENTS, VISITS};
use evtach_core::speed::polar::PolarEvents;
use evtach_core::{
    Event, GyroSample, Memory, More, Poll, Reading, Settings, StoredEvent, Tachometer, Work,
};

use ties::Ties;

pub(crate) use parts::Parts;

pub use json::{Document, FileFacts, PROGRAM, ReadingRow, RotorRow, SettingsRow, letter};
pub use run::{Plan, Run};
pub use since::Since;
pub use summary::{Summary, summarise, summarise_all};
pub use table::{evidence, table};
pub use timeline::Timeline;
pub use wait::LONGEST_US as LONGEST_WAIT_US;

/// A PC searches among so many times as many events as the device.
const MORE: usize = 8;

/// How much memory the tachometer is lent: the only difference between device and PC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Capacity {
    /// What the handheld device has.
    Device,
    /// Thirty-two times as much: every event of 150 ms at 2.6 Mev/s, and of 300 ms at 1.3 Mev/s.
    Full,
}

impl Capacity {
    /// Both, the larger first.
    pub const ALL: [Self; 2] = [Self::Full, Self::Device];

    /// The name used in tables.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Device => "device",
        }
    }

    /// Events in the store.
    #[must_use]
    pub const fn events(self) -> usize {
        match self {
            Self::Device => DEVICE_EVENTS,
            Self::Full => 32 * DEVICE_EVENTS,
        }
    }

    /// Cells of the heat map.
    #[must_use]
    pub const fn heat_cells(self) -> usize {
        match self {
            Self::Device => DEVICE_HEAT_CELLS,
            Self::Full => 4 * DEVICE_HEAT_CELLS,
        }
    }
}

/// Runs `work` with a tachometer of this capacity.
pub fn with_tachometer<R>(
    settings: Settings,
    capacity: Capacity,
    work: impl FnOnce(&mut Tachometer<'_>) -> R,
) -> R {
    let mut events = vec![StoredEvent::default(); capacity.events()];
    let mut heat = vec![0_u16; capacity.heat_cells()];
    let mut weights = vec![0_u8; capacity.heat_cells()];
    let mut bench = Box::new(Work::EMPTY);
    let mut times = vec![0_u16; MORE * VISITS];
    let mut track = Box::new(PolarEvents::<{ MORE * POLAR_EVENTS }>::new());
    let more = match capacity {
        Capacity::Device => None,
        Capacity::Full => Some(More { times: &mut times, track: track.as_mut_view() }),
    };
    let memory = Memory {
        events: &mut events,
        heat: &mut heat,
        weights: &mut weights,
        work: &mut bench,
        more,
    };
    work(&mut Tachometer::new(settings, memory))
}

/// Largest piece handed to the tachometer before it is polled.
const PIECE_EVENTS: usize = 256;
/// Longest piece: shorter than any segment, so that windows of a quiet recording are not given up either.
const PIECE_US: u64 = 500;

/// Pushes events and gyro samples in time order and measures every window as soon as it is full.
///
/// `samples` is used up as far as the events reach.
pub fn feed(
    tachometer: &mut Tachometer<'_>,
    events: &[Event],
    samples: &mut &[GyroSample],
    mut reading: impl FnMut(Reading),
) {
    let stretches = events.chunk_by(|a, b| a.t_us / PIECE_US == b.t_us / PIECE_US);
    for piece in stretches.flat_map(|stretch| stretch.chunks(PIECE_EVENTS)) {
        let Some(last) = piece.last() else { continue };
        tachometer.push(piece);
        let reached = samples.partition_point(|sample| sample.t_us <= last.t_us);
        samples[..reached].iter().for_each(|sample| tachometer.gyro(*sample));
        *samples = &samples[reached..];
        drain(tachometer, &mut reading);
    }
}

/// Measures what is due.
pub fn drain(tachometer: &mut Tachometer<'_>, mut reading: impl FnMut(Reading)) {
    loop {
        match tachometer.poll(u32::MAX) {
            Poll::Ready(found) => reading(found),
            Poll::Pending => {}
            Poll::Idle => return,
        }
    }
}

/// A whole recording in memory, measured: the readings, and how many events were left out on purpose.
#[must_use]
pub fn measure_events(
    events: &[Event],
    samples: &[GyroSample],
    settings: Settings,
    capacity: Capacity,
) -> (Vec<Reading>, u64) {
    with_tachometer(settings, capacity, |tachometer| {
        let mut readings = Vec::new();
        let mut samples = samples;
        let mut events = Cow::from(events);
        if capacity == Capacity::Full {
            Ties::default().order(events.to_mut(), false);
        }
        feed(tachometer, &events, &mut samples, |reading| readings.push(reading));
        tachometer.finish();
        drain(tachometer, |reading| readings.push(reading));
        (readings, tachometer.thinned())
    })
}

//! Taking in events: from a source of bytes to blocks of records, and never late.

use core::mem;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Sender;
use embassy_time::{Duration, Instant, Timer};
use evtach_core::{Geometry, GyroSample, PackedEvent};
use heapless::Vec;

use crate::record::{Decoder, Header, HeaderError, RECORD_BYTES, pack};

/// Events in one block: 128 x 8 B = 1 KiB; at 1 Mev/s a block fills in 128 us.
pub const BLOCK_EVENTS: usize = 128;

/// Blocks between taking in and measuring: 32 x 1 KiB = 32 KiB, 4 ms at 1 Mev/s. For half of that time all events are
/// kept while a step of the measurement runs, then ever fewer: see [`crate::sensor`].
pub const BLOCKS: usize = 32;

/// Gyro samples in one block. Sensors take about a thousand a second, and a block is sent when it holds so many.
pub const BLOCK_GYRO: usize = 2;

/// Events on their way from intake to measurement.
#[derive(Clone, Debug)]
pub struct Block {
    places: [PackedEvent; BLOCK_EVENTS],
    filled: usize,
    /// Samples of the sensor's gyro that came between these.
    pub gyro: Vec<GyroSample, BLOCK_GYRO>,
    /// Each event stands for 2^`weight_log2`: the others were left out, evenly.
    pub weight_log2: u8,
    /// Time of the first event in microseconds: packed ones tell only its low 32 bits.
    pub t_us: u64,
    /// Size of the sensor that they come from.
    pub geometry: Geometry,
    /// Events lost before these, because every block was taken.
    pub lost: u64,
    /// Whether this is the last block.
    pub last: bool,
}

impl Block {
    /// A block without events.
    pub const EMPTY: Self = Self {
        places: [PackedEvent::ZERO; BLOCK_EVENTS],
        filled: 0,
        gyro: Vec::new(),
        weight_log2: 0,
        t_us: 0,
        // All zeros, so that the blocks need no image in flash.
        geometry: Geometry { width_px: 0, height_px: 0 },
        lost: 0,
        last: false,
    };

    /// The events, in the order in which they came.
    #[must_use]
    pub fn events(&self) -> &[PackedEvent] {
        self.places.get(..self.filled).unwrap_or_default()
    }

    /// Forgets the events, and what the gyro said.
    pub fn clear(&mut self) {
        self.filled = 0;
        self.weight_log2 = 0;
        self.gyro.clear();
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.filled == 0 && self.gyro.is_empty()
    }

    /// Where further events go: see [`Block::filled`].
    pub fn space(&mut self) -> &mut [PackedEvent] {
        self.places.get_mut(self.filled..).unwrap_or_default()
    }

    /// So many places of the space have been filled.
    pub fn filled(&mut self, count: usize) {
        self.filled = (self.filled + count).min(BLOCK_EVENTS);
    }

    /// Keeps one in 2^`stride_log2` of the events from the place `from` on, and returns how many went. `phase` counts events
    /// from block to block.
    pub fn thin(&mut self, from: usize, stride_log2: u8, phase: &mut u32) -> usize {
        let before = self.filled;
        self.filled = from.min(before);
        let stride = 1 << stride_log2;
        let first = self.filled + stride - 1 - (*phase as usize & (stride - 1));
        *phase = phase.wrapping_add((before - self.filled) as u32);
        for index in (first..before).step_by(stride) {
            self.places[self.filled] = self.places[index];
            self.filled += 1;
        }
        before - self.filled
    }
}

/// How fast a recording plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Pace {
    /// As fast as it is measured: a file can wait, so nothing is lost.
    File,
    /// As fast as it was recorded: a sensor does not wait, and what finds no free block is lost.
    Sensor,
    /// As fast as it was recorded, and for a sensor for good: its end is a sensor that went away, and what follows
    /// one that came back. For bring-up with no camera.
    Replay,
    /// No recording: as fast as it comes from a sensor.
    Live,
}

impl Pace {
    /// Whether what comes can wait for whoever measures.
    #[must_use]
    pub const fn can_wait(self) -> bool {
        matches!(self, Self::File)
    }

    /// Whether time passes as it did when it was recorded.
    #[must_use]
    pub const fn is_timed(self) -> bool {
        matches!(self, Self::Sensor | Self::Replay)
    }

    /// Whether there is no end.
    #[must_use]
    pub const fn is_endless(self) -> bool {
        matches!(self, Self::Replay | Self::Live)
    }
}

/// A stream of bytes: a file, or a link to a sensor.
pub trait Source {
    /// What can go wrong with it.
    type Error;

    /// Fills `bytes` from the start and returns how many it filled; fewer than asked for only at the end.
    ///
    /// # Errors
    ///
    /// Whatever the source reports.
    fn read(&mut self, bytes: &mut [u8]) -> impl Future<Output = Result<usize, Self::Error>>;
}

/// Why taking in ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum IntakeError<E> {
    /// The source failed.
    #[error("the source of events failed")]
    Source(E),
    /// The recording does not begin as one.
    #[error(transparent)]
    Header(#[from] HeaderError),
    /// The recording ends before its header says so.
    #[error("the recording ends after {events} of {expected} events: write it again")]
    Truncated {
        /// Complete records that were read.
        events: u32,
        /// Records the header speaks of.
        expected: u32,
    },
}

/// Reads the header of a recording.
///
/// # Errors
///
/// When the source fails, or does not begin with a header.
pub async fn open<S: Source>(source: &mut S) -> Result<Header, IntakeError<S::Error>> {
    let mut bytes = [0; Header::BYTES];
    source.read(&mut bytes).await.map_err(IntakeError::Source)?;
    Ok(Header::parse(&bytes)?)
}

/// Takes in every record that follows the header, and closes with a block marked last.
///
/// # Errors
///
/// When the source fails or ends early; blocks filled so far have been sent.
pub async fn take_in<S: Source, M: RawMutex>(
    source: &mut S,
    header: &Header,
    pace: Pace,
    blocks: &mut Sender<'_, M, Block>,
) -> Result<(), IntakeError<S::Error>> {
    let start = Instant::now();
    let mut decoder = Decoder::new(header.first_us);
    let mut bytes = [[0; RECORD_BYTES]; BLOCK_EVENTS];
    let mut lost = 0;
    let mut taken = 0;
    while taken < header.events {
        let wanted = (header.events - taken).min(BLOCK_EVENTS as u32);
        let records = &mut bytes[..wanted as usize];
        let read = source.read(records.as_flattened_mut()).await.map_err(IntakeError::Source)?;
        taken += (read / RECORD_BYTES) as u32;
        if read < records.len() * RECORD_BYTES {
            return Err(IntakeError::Truncated { events: taken, expected: header.events });
        }
        let first_us = records.first().map_or(0, |record| decoder.decode(*record).t_us);
        let last_us = records.last().map_or(0, |record| decoder.decode(*record).t_us);
        if pace.is_timed() {
            let age_us = last_us.saturating_sub(header.first_us);
            Timer::at(start + Duration::from_micros(age_us)).await;
        }
        let slot = if pace.can_wait() { Some(blocks.send().await) } else { blocks.try_send() };
        if let Some(slot) = slot {
            slot.clear();
            for (place, record) in slot.space().iter_mut().zip(&*records) {
                *place = pack(*record);
            }
            slot.filled(records.len());
            slot.t_us = first_us;
            slot.geometry = header.geometry;
            slot.lost = mem::take(&mut lost);
            slot.last = false;
            blocks.send_done();
        } else {
            lost += records.len() as u64;
        }
    }
    let slot = blocks.send().await;
    slot.clear();
    slot.lost = lost;
    slot.last = true;
    blocks.send_done();
    Ok(())
}

#[cfg(test)]
mod tests;

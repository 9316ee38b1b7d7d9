//! From words to blocks of events, and never late: what finds no place is thinned or dropped, and counted.

use core::mem;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Sender;
use evtach_core::{Geometry, GyroSample, PackedEvent};

use crate::intake::{BLOCKS, Block};

/// With more blocks than these waiting to be measured, events are thinned further; with fewer than
/// the second, less.
const CROWDED: usize = BLOCKS * 3 / 4;
const RELAXED: usize = BLOCKS / 2;

/// Thinnest: one event in 16.
const MOST_STRIDE_LOG2: u32 = 4;

/// Most events that one word of any sensor stands for: an EVT 3 vector.
const MOST_EVENTS_A_WORD: usize = 12;

/// Words that a sensor sent.
pub(crate) trait Words {
    /// Whether every word has been decoded.
    fn is_done(&self) -> bool;

    /// Decodes words into a space, until either is used up as far as words cannot overfill it, or a gyro sample comes.
    fn fill(&mut self, space: &mut [PackedEvent]) -> Filled;
}

/// What came of words.
pub(crate) struct Filled {
    /// Events.
    pub events: usize,
    /// A time in microseconds within half an hour of the first: packed events tell its low half only.
    pub near_us: u64,
    /// What the gyro said behind them.
    pub sample: Option<GyroSample>,
}

/// What became of the events that came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Delivered {
    /// Events that came.
    pub received: u64,
    /// Of these, left out evenly, because the blocks were filling up.
    pub thinned: u64,
    /// Of these, dropped, because every block was taken.
    pub overrun: u64,
}

impl Delivered {
    /// None.
    pub const NONE: Self = Self { received: 0, thinned: 0, overrun: 0 };

    /// Events handed on to be measured.
    #[must_use]
    pub const fn used(&self) -> u64 {
        self.received.saturating_sub(self.thinned).saturating_sub(self.overrun)
    }
}

/// Where events go.
pub(crate) struct Outlet<'o, 'b, M: RawMutex> {
    blocks: &'o mut Sender<'b, M, Block>,
    /// Whether whoever sends can wait: a recording, not a sensor.
    can_wait: bool,
    /// Counts so far.
    pub delivered: Delivered,
    /// Lost since the last block, to be told with the next.
    pub lost: u64,
    stride_log2: u32,
    /// Events so far, to keep one in so many.
    phase: u32,
}

impl<'o, 'b, M: RawMutex> Outlet<'o, 'b, M> {
    pub const fn new(blocks: &'o mut Sender<'b, M, Block>, can_wait: bool) -> Self {
        Self { blocks, can_wait, delivered: Delivered::NONE, lost: 0, stride_log2: 0, phase: 0 }
    }

    /// Hands the events of these words on, in one block or more, and returns how many there were.
    pub async fn deliver(&mut self, mut words: impl Words, geometry: Geometry) -> u32 {
        let mut events = 0_u32;
        while !words.is_done() {
            let slot = if self.can_wait {
                Some(self.blocks.send().await)
            } else {
                self.thin_by_crowd();
                self.blocks.try_send()
            };
            let Some(slot) = slot else {
                let before = events;
                let mut nowhere = [PackedEvent::ZERO; 2 * MOST_EVENTS_A_WORD];
                while !words.is_done() {
                    events += words.fill(&mut nowhere).events as u32;
                }
                self.delivered.overrun += u64::from(events - before);
                self.lost += u64::from(events - before);
                break;
            };
            slot.clear();
            while !words.is_done() && !slot.gyro.is_full() {
                if slot.space().len() < MOST_EVENTS_A_WORD {
                    break;
                }
                let Filled { events: count, near_us, sample } = words.fill(slot.space());
                slot.filled(count);
                if let Some(sample) = sample {
                    slot.gyro.push(sample).ok();
                }
                events += count as u32;
                let before = slot.events().len() - count;
                if self.stride_log2 > 0 {
                    let went = slot.thin(before, self.stride_log2, &mut self.phase);
                    self.delivered.thinned += went as u64;
                }
                if before == 0
                    && let Some(first) = slot.events().first()
                {
                    slot.t_us = first.unpack(near_us).t_us;
                }
            }
            if !slot.is_empty() {
                slot.geometry = geometry;
                slot.lost = mem::take(&mut self.lost);
                slot.last = false;
                self.blocks.send_done();
            }
        }
        self.delivered.received += u64::from(events);
        events
    }

    fn thin_by_crowd(&mut self) {
        let waiting = self.blocks.len();
        if waiting > CROWDED {
            self.stride_log2 = (self.stride_log2 + 1).min(MOST_STRIDE_LOG2);
        } else if waiting < RELAXED {
            self.stride_log2 = self.stride_log2.saturating_sub(1);
        }
    }

    /// Marks the end of a recording.
    pub async fn close(&mut self) {
        let slot = self.blocks.send().await;
        slot.clear();
        slot.lost = mem::take(&mut self.lost);
        slot.last = true;
        self.blocks.send_done();
    }
}

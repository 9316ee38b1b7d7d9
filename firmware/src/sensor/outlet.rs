//! From words to blocks of events, and never late: what finds no place is thinned or dropped, and counted.

use core::mem;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Sender;
use evtach_core::{Geometry, GyroSample, PackedEvent};

use crate::intake::{BLOCKS, Block};

/// Thinnest: one event in 4096. A block of these bridges half a second at 1 Mev/s.
const THINNEST_LOG2: u8 = 12;

/// With no more blocks free than these, one is filled up before it is sent: whoever measures has others to go on with.
const SCARCE: usize = BLOCKS * 3 / 4;

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
///
/// While whoever measures is busy, blocks fill up. Of `BLOCKS`, the first half takes every event, of the rest each half every
/// second one of those that the half before took, so that each bridges as long as all before it; in the last one every other event
/// gives its place up whenever it is full. So a stretch is thinned, evenly, but never torn. Each block tells how many events
/// one of its own stands for.
pub(crate) struct Outlet<'o, 'b, M: RawMutex> {
    blocks: &'o mut Sender<'b, M, Block>,
    /// Whether whoever sends can wait: a recording, not a sensor.
    can_wait: bool,
    /// Counts so far.
    pub delivered: Delivered,
    /// Lost since the last block, to be told with the next.
    pub lost: u64,
    /// Whether the block at hand holds something already: while blocks are scarce, it is filled up.
    open: bool,
    /// Events so far, to keep one in so many.
    phase: u32,
}

impl<'o, 'b, M: RawMutex> Outlet<'o, 'b, M> {
    pub const fn new(blocks: &'o mut Sender<'b, M, Block>, can_wait: bool) -> Self {
        let delivered = Delivered::NONE;
        Self { blocks, can_wait, delivered, lost: 0, open: false, phase: 0 }
    }

    /// Hands the events of these words on, in one block or more, and returns how many there were.
    pub async fn deliver(&mut self, mut words: impl Words, geometry: Geometry) -> u32 {
        let mut events = 0_u32;
        while !words.is_done() {
            let free = if self.can_wait { BLOCKS } else { BLOCKS - self.blocks.len() };
            let slot =
                if self.can_wait { Some(self.blocks.send().await) } else { self.blocks.try_send() };
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
            let (is_last, weight_log2) = (free == 1, crowd_log2(free));
            if !self.open {
                slot.clear();
                slot.geometry = geometry;
                slot.weight_log2 = weight_log2;
            } else if !is_last && slot.weight_log2 > weight_log2 || slot.geometry != geometry {
                // There is room again.
                self.send(false);
                continue;
            }
            while !words.is_done() && (is_last || !slot.gyro.is_full()) {
                if slot.space().len() < MOST_EVENTS_A_WORD {
                    if !is_last || slot.weight_log2 == THINNEST_LOG2 {
                        break;
                    }
                    self.delivered.thinned += halve(slot, self.phase) as u64;
                }
                let Filled { events: count, near_us, sample } = words.fill(slot.space());
                slot.filled(count);
                if let Some(sample) = sample {
                    // What is too much for the last block is left out, as events are.
                    slot.gyro.push(sample).ok();
                }
                events += count as u32;
                let before = slot.events().len() - count;
                if slot.weight_log2 > 0 {
                    let went = slot.thin(before, slot.weight_log2, &mut self.phase);
                    self.delivered.thinned += went as u64;
                }
                if before == 0
                    && let Some(first) = slot.events().first()
                {
                    slot.t_us = first.unpack(near_us).t_us;
                }
            }
            self.open = !slot.is_empty();
            let may_thin = is_last && slot.weight_log2 < THINNEST_LOG2;
            let has_room = may_thin || slot.space().len() >= MOST_EVENTS_A_WORD;
            let waits = free <= SCARCE && words.is_done() && has_room;
            if self.open && !waits {
                self.send(false);
            }
        }
        self.delivered.received += u64::from(events);
        events
    }

    /// Sends the block at hand.
    fn send(&mut self, last: bool) {
        if let Some(slot) = self.blocks.try_send() {
            slot.lost = mem::take(&mut self.lost);
            slot.last = last;
            self.open = false;
            self.blocks.send_done();
        }
    }

    /// Marks the end of a recording.
    pub async fn close(&mut self) {
        if self.open {
            self.send(false);
        }
        self.blocks.send().await.clear();
        self.send(true);
    }
}

/// How many events one is to stand for in the next block, as a power of two, with so many blocks free.
const fn crowd_log2(free: usize) -> u8 {
    match BLOCKS.checked_div(free) {
        Some(crowd) => crowd.ilog2() as u8,
        None => THINNEST_LOG2,
    }
}

/// Every other event of a block goes, so that those left, of which the last was the `phase`-th, stand for twice as many; returns how
/// many went.
fn halve(slot: &mut Block, phase: u32) -> usize {
    let last = phase >> slot.weight_log2;
    let mut index = last.wrapping_sub(slot.events().len() as u32);
    slot.weight_log2 += 1;
    slot.thin(0, 1, &mut index)
}

#[cfg(test)]
mod tests;

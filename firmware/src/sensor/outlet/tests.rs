//! What blocks hold while nobody measures.

use std::vec::Vec;

use embassy_futures::block_on;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::{Channel, Receiver};
use evtach_core::Polarity;

use super::*;
use crate::intake::BLOCK_EVENTS;

const GEOMETRY: Geometry = Geometry { width_px: 346, height_px: 260 };

/// Events of one transfer at most, one every microsecond.
const TRANSFER: u64 = 380;

/// One event a word, and a gyro sample every thousandth.
struct Clockwork {
    at_us: u64,
    end_us: u64,
}

impl Words for Clockwork {
    fn is_done(&self) -> bool {
        self.at_us == self.end_us
    }

    fn fill(&mut self, space: &mut [PackedEvent]) -> Filled {
        let near_us = self.at_us;
        let mut filled = Filled { events: 0, near_us, sample: None };
        for place in space {
            if self.is_done() {
                break;
            }
            *place = PackedEvent::new(self.at_us as u32, 5, 6, Polarity::On);
            self.at_us += 1;
            filled.events += 1;
            if self.at_us.is_multiple_of(1_000) {
                filled.sample = Some(GyroSample { t_us: self.at_us, roll_rad_s: 0.5 });
                break;
            }
        }
        filled
    }
}

/// Time and weight of every event that comes out, and how many were told lost.
fn drain(
    blocks: &mut Receiver<'_, NoopRawMutex, Block>,
    events: &mut Vec<(u64, u8)>,
    lost: &mut u64,
) {
    while let Some(block) = blocks.try_receive() {
        let mut near_us = block.t_us;
        for packed in block.events() {
            near_us = packed.unpack(near_us).t_us;
            events.push((near_us, block.weight_log2));
        }
        *lost += block.lost;
        blocks.receive_done();
    }
}

/// Delivers transfer after transfer; every so many microseconds, all blocks are taken. What came, and what it was counted as.
fn deliver(duration_us: u64, taken_every_us: u64) -> (Vec<(u64, u8)>, Delivered) {
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (mut sender, mut receiver) = channel.split();
    let mut outlet = Outlet::new(&mut sender, false);
    let (mut events, mut lost) = (Vec::new(), 0);
    let mut at_us = 0;
    while at_us < duration_us {
        // Of any length, so that a transfer ends wherever a block may.
        let transfer = TRANSFER - at_us * 7 % BLOCK_EVENTS as u64;
        let end_us = (at_us + transfer).min(duration_us);
        block_on(outlet.deliver(Clockwork { at_us, end_us }, GEOMETRY));
        if end_us / taken_every_us > at_us / taken_every_us {
            drain(&mut receiver, &mut events, &mut lost);
        }
        at_us = end_us;
    }
    drain(&mut receiver, &mut events, &mut lost);
    block_on(outlet.close());
    drain(&mut receiver, &mut events, &mut lost);
    assert_eq!(lost, outlet.delivered.overrun, "what is dropped is told");
    (events, outlet.delivered)
}

#[test]
fn a_stretch_is_thinned_ever_more_but_never_torn_and_each_event_tells_how_many_it_stands_for() {
    for duration_us in [3_000, 8_000, 20_000, 50_000, 300_000] {
        let (events, delivered) = deliver(duration_us, u64::MAX);
        assert_eq!((delivered.received, delivered.overrun), (duration_us, 0));
        assert_eq!(delivered.used(), events.len() as u64);
        assert!(events.is_sorted());
        let stands_for: u64 = events.iter().map(|(_, weight_log2)| 1 << weight_log2).sum();
        // At each change of the weight, one event may stand for as many more.
        let most = 2 << events.last().map_or(0, |(_, weight_log2)| *weight_log2);
        assert!(stands_for.abs_diff(duration_us) <= most, "{stands_for} of {duration_us} us");
        for pair in events.windows(2) {
            let [(early_us, lighter), (late_us, heavier)] = *pair else { continue };
            let step_us = late_us - early_us;
            assert!(heavier >= lighter && step_us <= 1 << heavier, "{pair:?} of {duration_us} us");
            assert!(heavier != lighter || step_us == 1 << heavier, "{pair:?}");
        }
    }
}

#[test]
fn half_of_the_blocks_take_every_event() {
    let (events, delivered) = deliver(1_600, u64::MAX);
    assert_eq!((events.len(), delivered.thinned), (1_600, 0));
    let (_, delivered) = deliver((BLOCKS * BLOCK_EVENTS) as u64, u64::MAX);
    assert!(delivered.thinned > 0);
}

#[test]
fn where_there_is_room_again_every_event_is_taken_again() {
    let (events, delivered) = deliver(100_000, 10_000);
    assert_eq!(delivered.overrun, 0);
    for start_us in (10_000..100_000).step_by(10_000) {
        // What was thinned when the blocks were taken, and a transfer, go before.
        let fresh = start_us + 2 * TRANSFER..start_us + 1_600;
        let inside = events.iter().filter(|(t_us, _)| fresh.contains(t_us));
        assert!(inside.clone().all(|(_, weight_log2)| *weight_log2 == 0));
        assert_eq!(inside.count() as u64, fresh.end - fresh.start);
    }
    assert!(delivered.thinned > 10_000, "{delivered:?}");
}

#[test]
fn beyond_the_thinnest_events_are_dropped_and_counted() {
    let (events, delivered) = deliver(2_000_000, u64::MAX);
    assert!(delivered.overrun > 0);
    assert_eq!(delivered.received, 2_000_000);
    assert_eq!(delivered.used(), events.len() as u64);
}

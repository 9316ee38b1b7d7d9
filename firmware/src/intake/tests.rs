extern crate std;

use std::vec::Vec as Heap;

use embassy_futures::join::join;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::{Channel, Receiver};
use evtach_core::{Event, Geometry, Polarity};

use super::*;
use crate::record;
use crate::test_time::block_on;

/// Bytes in memory.
struct Bytes<'b>(&'b [u8]);

impl Source for Bytes<'_> {
    type Error = core::convert::Infallible;

    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Self::Error> {
        let count = bytes.len().min(self.0.len());
        let (now, later) = self.0.split_at(count);
        bytes[..count].copy_from_slice(now);
        self.0 = later;
        Ok(count)
    }
}

/// A microsecond apart, five and a half times what all blocks hold.
fn events() -> Heap<Event> {
    (0..(BLOCKS * BLOCK_EVENTS * 11 / 2) as u64)
        .map(|index| Event { t_us: 500 + index, x: 1, y: 2, polarity: Polarity::On })
        .collect()
}

fn recording(events: &[Event]) -> Heap<u8> {
    let geometry = Geometry { width_px: 320, height_px: 240 };
    let header = Header { geometry, first_us: 500, events: events.len() as u32 };
    let mut bytes = header.encode().to_vec();
    bytes.extend(events.iter().flat_map(record::encode));
    bytes
}

/// Plays bytes, and hands the blocks to `receive`.
fn play<T>(
    bytes: &[u8],
    pace: Pace,
    receive: impl AsyncFnOnce(Receiver<'_, NoopRawMutex, Block>) -> T,
) -> (Result<(), IntakeError<core::convert::Infallible>>, T) {
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (mut sender, receiver) = channel.split();
    let mut source = Bytes(bytes);
    block_on(async {
        let header = open(&mut source).await.expect("a header");
        join(take_in(&mut source, &header, pace, &mut sender), receive(receiver)).await
    })
}

/// Everything up to the last block: events, and how many were lost before each block.
async fn all(mut blocks: Receiver<'_, NoopRawMutex, Block>) -> (Heap<Event>, Heap<u64>) {
    let (mut events, mut lost) = (Heap::new(), Heap::new());
    loop {
        let block = blocks.receive().await;
        events.extend(block.events().iter().map(|event| event.unpack(block.t_us)));
        lost.push(block.lost);
        let last = block.last;
        blocks.receive_done();
        if last {
            return (events, lost);
        }
    }
}

#[test]
fn a_file_waits_for_whoever_measures() {
    let events = events();
    let (end, (received, lost)) = play(&recording(&events), Pace::File, all);
    assert_eq!(end, Ok(()));
    assert_eq!(received, events);
    assert_eq!(lost.iter().sum::<u64>(), 0);
}

#[test]
fn a_sensor_does_not_wait_and_what_is_lost_is_counted_where_it_is_missing() {
    let events = events();
    let (end, (received, lost)) = play(&recording(&events), Pace::Sensor, async |blocks| {
        // Busy for longer than the recording lasts.
        Timer::after(Duration::from_millis(50)).await;
        all(blocks).await
    });
    assert_eq!(end, Ok(()));
    assert_eq!(received, events[..BLOCKS * BLOCK_EVENTS], "what came first fills the blocks");
    let missing = (events.len() - received.len()) as u64;
    assert_eq!(lost[BLOCKS], missing, "told with the next block");
    assert_eq!(lost.iter().sum::<u64>(), missing);
}

#[test]
fn a_cut_recording_says_after_how_many_events() {
    let events = events();
    let bytes = recording(&events);
    let cut = Header::BYTES + 200 * RECORD_BYTES + 3;
    let expected = events.len() as u32;
    // Nobody marks a last block: what was sent before the end is taken without waiting.
    let (end, received) = play(&bytes[..cut], Pace::File, async |mut blocks| {
        let block = blocks.receive().await.events().len();
        blocks.receive_done();
        block
    });
    assert_eq!(end, Err(IntakeError::Truncated { events: 200, expected }));
    assert_eq!(received, BLOCK_EVENTS);
}

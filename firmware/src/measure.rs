//! Measuring: blocks of events in, readings out, in pieces short enough that intake never waits.

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Receiver;
use evtach_core::{Poll, Reading, Tachometer};

use crate::cost::{Clock, Costs, Spent};
use crate::intake::{Block, Pace};

/// Steps of a measurement between two looks at what has arrived.
pub const STEPS: u32 = 1;

/// Measures until the last block, and hands every reading to `show` with what it cost.
pub async fn measure<M: RawMutex>(
    tachometer: &mut Tachometer<'_>,
    blocks: &mut Receiver<'_, M, Block>,
    pace: Pace,
    costs: &mut Costs<impl Clock>,
    mut show: impl FnMut(&Reading, Spent),
) {
    let mut last = false;
    while !last {
        last = push(tachometer, blocks.receive().await, costs);
        blocks.receive_done();
        loop {
            match costs.poll(tachometer, STEPS) {
                Poll::Idle => break,
                Poll::Pending => {}
                Poll::Ready(reading) => show(&reading, costs.take_spent()),
            }
            // A sensor goes on while a window is measured; a file waits, and is measured to the end.
            while pace == Pace::Sensor
                && let Some(block) = blocks.try_receive()
            {
                last |= push(tachometer, block, costs);
                blocks.receive_done();
            }
            yield_now().await;
        }
    }
}

/// Takes a block in and tells whether it was the last.
fn push(tachometer: &mut Tachometer<'_>, block: &Block, costs: &mut Costs<impl Clock>) -> bool {
    if block.lost > 0 {
        tachometer.lost(block.lost);
    }
    costs.push(tachometer, &block.events);
    if block.last {
        tachometer.finish();
    }
    block.last
}

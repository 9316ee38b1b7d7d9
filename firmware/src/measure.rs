//! Measuring: blocks of records in, readings out, in steps short enough that intake need not wait.

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Receiver;
use evtach_core::{Event, Poll, Reading, Settings, Tachometer};
use heapless::Vec;

use crate::cost::{Clock, Costs, Spent};
use crate::intake::{BLOCK_EVENTS, Block, Pace};
use crate::record::Decoder;

/// Steps of a measurement between two looks at what has arrived.
pub const STEPS: u32 = 1;

/// Where blocks are turned into events and pushed.
struct Intake<'t, 'm, C> {
    tachometer: &'t mut Tachometer<'m>,
    costs: &'t mut Costs<C>,
    ended: bool,
}

impl<C: Clock> Intake<'_, '_, C> {
    fn push(&mut self, block: &Block) {
        let settings = *self.tachometer.settings();
        if settings.geometry != block.geometry && !block.records.is_empty() {
            self.tachometer.configure(Settings { geometry: block.geometry, ..settings });
        }
        if block.lost > 0 {
            self.tachometer.lost(block.lost);
        }
        let mut decoder = Decoder::new(block.t_us);
        let events: Vec<Event, BLOCK_EVENTS> =
            block.records.iter().map(|&record| decoder.decode(record)).collect();
        self.costs.push(self.tachometer, &events);
        self.ended |= block.last;
    }
}

/// Measures until the last block, and hands every reading to `show` with what it cost.
pub async fn measure<M: RawMutex>(
    tachometer: &mut Tachometer<'_>,
    blocks: &mut Receiver<'_, M, Block>,
    pace: Pace,
    costs: &mut Costs<impl Clock>,
    mut show: impl FnMut(&Reading, Spent),
) {
    let mut intake = Intake { tachometer, costs, ended: false };
    let mut finished = false;
    while !finished {
        if intake.ended {
            intake.tachometer.finish();
            finished = true;
        } else {
            intake.push(blocks.receive().await);
            blocks.receive_done();
        }
        loop {
            match intake.costs.poll(intake.tachometer, STEPS) {
                Poll::Idle => break,
                Poll::Pending => {}
                Poll::Ready(reading) => show(&reading, intake.costs.take_spent()),
            }
            // A sensor goes on while a window is measured; a file waits, and is measured to the end.
            while pace != Pace::File
                && let Some(block) = blocks.try_receive()
            {
                intake.push(block);
                blocks.receive_done();
            }
            yield_now().await;
        }
    }
}

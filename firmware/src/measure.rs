//! Measuring: blocks of events in, readings out, in steps short enough that intake need not wait.

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Receiver;
use embassy_time::{Duration, with_timeout};
use evtach_core::{Poll, Reading, Settings, Tachometer};

use crate::cost::{Clock, Costs, Spent};
use crate::intake::{BLOCKS, Block, Pace};

/// Steps of a measurement between two looks at what has arrived.
pub const STEPS: u32 = 1;

/// Where blocks go.
struct Intake<'t, 'm, C> {
    tachometer: &'t mut Tachometer<'m>,
    costs: &'t mut Costs<C>,
    ended: bool,
}

impl<C: Clock> Intake<'_, '_, C> {
    fn push(&mut self, block: &Block) {
        let settings = *self.tachometer.settings();
        if settings.geometry != block.geometry && !block.events().is_empty() {
            self.tachometer.configure(Settings { geometry: block.geometry, ..settings });
        }
        if block.lost > 0 {
            self.tachometer.lost(block.lost);
        }
        self.costs.push(self.tachometer, block.t_us, block.events(), block.weight_log2);
        for sample in &block.gyro {
            self.tachometer.gyro(*sample);
        }
        self.ended |= block.last;
    }
}

/// What goes on around a measurement: on a board the rest of the device, in a test a list of readings.
pub trait Companion {
    /// A block has come.
    fn arrived(&mut self, _block: &Block) {}

    /// A window has been measured, at this cost.
    fn measured(&mut self, reading: &Reading, spent: Spent);

    /// Between two steps, and twice a second when nothing comes.
    fn between(&mut self, _tachometer: &mut Tachometer<'_>) {}

    /// After a step: lets others run.
    fn rest(&mut self) -> impl Future<Output = ()> {
        yield_now()
    }
}

/// Longest time between two calls of [`Companion::between`] while no events come.
const IDLE: Duration = Duration::from_millis(500);

/// Measures until the last block.
pub async fn measure<M: RawMutex>(
    tachometer: &mut Tachometer<'_>,
    blocks: &mut Receiver<'_, M, Block>,
    pace: Pace,
    costs: &mut Costs<impl Clock>,
    companion: &mut impl Companion,
) {
    let mut intake = Intake { tachometer, costs, ended: false };
    let mut finished = false;
    while !finished {
        if intake.ended {
            intake.tachometer.finish();
            finished = true;
        } else if let Ok(block) = with_timeout(IDLE, blocks.receive()).await {
            companion.arrived(block);
            intake.push(block);
            blocks.receive_done();
        }
        loop {
            companion.between(intake.tachometer);
            match intake.costs.poll(intake.tachometer, STEPS) {
                Poll::Idle => break,
                Poll::Pending => {}
                Poll::Ready(reading) => companion.measured(&reading, intake.costs.take_spent()),
            }
            // A sensor goes on while a window is measured; a file waits, and is measured to the end.
            // As much as there is room for, and no more: what comes as fast as it is taken in would leave no time to measure.
            for _ in 0..BLOCKS {
                if pace.can_wait() {
                    break;
                }
                let Some(block) = blocks.try_receive() else { break };
                companion.arrived(block);
                intake.push(block);
                blocks.receive_done();
            }
            companion.rest().await;
        }
    }
}

//! A minute of a million events a second over SPI, with one frame in a hundred damaged, through the code of the
//! device: sent = used + thinned + lost, each by its cause.

use std::convert::Infallible;

use embassy_futures::block_on;
use embassy_futures::join::join;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::{Channel, Receiver};
use embedded_hal_async::spi::{ErrorType, Operation, SpiDevice};
use evtach_core::{Event, Geometry, Ignored, Polarity, Settings, Tachometer};
use evtach_firmware::intake::{BLOCKS, Block, Pace};
use evtach_firmware::sensor::spi::{Acquired, AlwaysReady, Bridge, Kind, Lost, SpiSensor, acquire};
use evtach_host::measure::{Capacity, with_tachometer};

const GEOMETRY: Geometry = Geometry { width_px: 320, height_px: 320 };

/// Events in a minute.
const EVENTS: u64 = 60_000_000;

/// A bridge on the bus that sends a minute of events, and a bus that does not leave them alone.
struct Sender {
    bridge: Bridge,
    state: u32,
    /// Events so far, those that the bridge dropped among them.
    made: u64,
    frames: u64,
    /// Events in the bridge's open frame.
    in_frame: u64,
    truth: Lost,
    waiting: Vec<u8>,
    taken: usize,
    ended: bool,
}

impl Sender {
    fn new() -> Self {
        Self {
            bridge: Bridge::new(Kind::Evt2, GEOMETRY, "test"),
            state: 1,
            made: 0,
            frames: 0,
            in_frame: 0,
            truth: Lost::default(),
            waiting: Vec::new(),
            taken: 0,
            ended: false,
        }
    }

    /// One event, a microsecond after the last; one in a thousand lies off the sensor.
    fn event(&mut self) -> Event {
        self.state = self.state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let off = if self.made.is_multiple_of(1000) { 320 } else { 0 };
        Event {
            t_us: self.made,
            x: (self.state >> 8) as u16 % 320 + off,
            y: (self.state >> 17) as u16 % 320,
            polarity: if self.state >> 31 == 0 { Polarity::Off } else { Polarity::On },
        }
    }

    /// Puts the next frames on the wire.
    fn refill(&mut self) {
        self.waiting.clear();
        self.taken = 0;
        while self.waiting.is_empty() && self.made < EVENTS {
            let event = self.event();
            self.made += 1;
            // A bridge that runs over now and then.
            if self.made % 100_000 >= 99_900 {
                self.bridge.lost(1);
                self.truth.bridge += 1;
                continue;
            }
            let Self { bridge, waiting, frames, in_frame, truth, .. } = self;
            bridge.push(&event, |frame| {
                *frames += 1;
                waiting.extend_from_slice(frame);
                // A frame that says hello holds no events, and comes when none are waiting.
                let events = std::mem::take(in_frame);
                match *frames % 200 {
                    100 => {
                        truth.damaged += events;
                        let middle = waiting.len() - frame.len() / 2;
                        waiting[middle] ^= 0x08;
                    }
                    199 => {
                        truth.missing += events;
                        waiting.truncate(waiting.len() - frame.len());
                    }
                    _ => {}
                }
            });
            *in_frame += 1;
        }
        if self.waiting.is_empty() && !self.ended {
            self.ended = true;
            self.bridge.end(|frame| self.waiting.extend_from_slice(frame));
        }
    }
}

impl ErrorType for Sender {
    type Error = Infallible;
}

impl SpiDevice for Sender {
    async fn transaction(
        &mut self,
        operations: &mut [Operation<'_, u8>],
    ) -> Result<(), Infallible> {
        for operation in operations {
            let Operation::Read(bytes) = operation else { continue };
            for byte in bytes.iter_mut() {
                if self.taken == self.waiting.len() {
                    self.refill();
                }
                *byte = self.waiting.get(self.taken).copied().unwrap_or(0);
                self.taken += usize::from(self.taken < self.waiting.len());
            }
        }
        Ok(())
    }
}

/// What the measuring side saw.
#[derive(Default)]
struct Measured {
    pushed: u64,
    off_sensor: u64,
    told_lost: u64,
    thinned: u64,
    ignored: Ignored,
}

/// Measures as a processor does that has time for one step every two milliseconds.
async fn measure(
    tachometer: &mut Tachometer<'_>,
    mut blocks: Receiver<'_, NoopRawMutex, Block>,
) -> Measured {
    const BLOCKS_A_STEP: u64 = 16;
    let mut measured = Measured::default();
    for number in 1_u64.. {
        let block = blocks.receive().await;
        let events: Vec<Event> =
            block.events().iter().map(|event| event.unpack(block.t_us)).collect();
        measured.pushed += events.len() as u64;
        measured.off_sensor += events.iter().filter(|event| event.x >= 320).count() as u64;
        measured.told_lost += block.lost;
        tachometer.lost(block.lost);
        tachometer.push_packed(block.t_us, block.events());
        let last = block.last;
        blocks.receive_done();
        if last {
            break;
        }
        if number.is_multiple_of(BLOCKS_A_STEP) {
            tachometer.poll(1);
        }
    }
    measured.thinned = tachometer.thinned();
    measured.ignored = tachometer.ignored();
    measured
}

#[test]
fn a_minute_at_1_mev_s_with_one_frame_in_a_hundred_damaged() {
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (mut blocks, receiver) = channel.split();
    let mut sender = Sender::new();
    let mut acquired = Acquired::default();
    let mut sensor = SpiSensor::new(&mut sender, AlwaysReady);
    let acquiring = acquire(&mut sensor, Pace::File, &mut blocks, |now| acquired = *now);
    let (end, measured) =
        with_tachometer(Settings::new(GEOMETRY), Capacity::Device, |tachometer| {
            block_on(join(acquiring, measure(tachometer, receiver)))
        });
    end.expect("a bus that works");
    let Acquired { account, thinned, overrun, .. } = acquired;
    let Ignored { out_of_bounds, out_of_roi, out_of_order, overrun: too_late } = measured.ignored;
    println!("{acquired}\n{:?}, thinned {}", measured.ignored, measured.thinned);

    // What the sender knows, and nobody told the device.
    assert_eq!(account.lost, sender.truth);
    assert_eq!(account.sent(), EVENTS);
    assert!(account.lost.damaged > EVENTS / 250 && account.lost.missing > EVENTS / 250);
    assert_eq!(out_of_bounds, measured.off_sensor);
    assert_eq!(measured.told_lost, account.lost.total() + overrun);

    // sent = used + thinned + lost by cause.
    assert_eq!(measured.pushed, acquired.delivered());
    let ignored = out_of_bounds + out_of_roi + out_of_order + too_late;
    let used = measured.pushed - measured.thinned - ignored;
    assert!(used > 0 && measured.thinned > used && too_late > 0);
    let Lost { bridge, damaged, missing, undecoded } = account.lost;
    let lost = bridge + damaged + missing + undecoded + overrun + ignored;
    assert_eq!(EVENTS, used + (measured.thinned + thinned) + lost);
}

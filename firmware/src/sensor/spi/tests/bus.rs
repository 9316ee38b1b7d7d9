use core::convert::Infallible;
use core::future::pending;

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::{Channel, Receiver, Sender};
use embassy_time::{Duration, Instant, Timer};
use embedded_hal::digital::ErrorType as PinErrorType;
use embedded_hal_async::digital::Wait;
use embedded_hal_async::spi::{ErrorType, Operation, SpiBus, SpiDevice};

use super::*;
use crate::intake::{BLOCK_EVENTS, BLOCKS, Block, Pace};
use crate::test_time::block_on;

/// A bus behind which lie bytes; after them it shifts in ones, as one with nobody on it.
struct Wire {
    bytes: Vec<u8>,
    at: usize,
    written: Vec<u8>,
}

impl Wire {
    fn new(bytes: Vec<u8>) -> Self {
        Self { bytes, at: 0, written: Vec::new() }
    }
}

impl ErrorType for Wire {
    type Error = Infallible;
}

impl SpiBus for Wire {
    async fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        for word in words {
            *word = self.bytes.get(self.at).copied().unwrap_or(0xff);
            self.at += 1;
        }
        Ok(())
    }

    async fn write(&mut self, words: &[u8]) -> Result<(), Infallible> {
        self.written.extend_from_slice(words);
        Ok(())
    }

    async fn transfer(&mut self, _: &mut [u8], _: &[u8]) -> Result<(), Infallible> {
        pending().await
    }

    async fn transfer_in_place(&mut self, _: &mut [u8]) -> Result<(), Infallible> {
        pending().await
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl SpiDevice for Wire {
    async fn transaction(
        &mut self,
        operations: &mut [Operation<'_, u8>],
    ) -> Result<(), Infallible> {
        for operation in operations {
            if let Operation::Read(words) = operation {
                SpiBus::read(self, words).await?;
            }
        }
        Ok(())
    }
}

/// A ready line that goes low after so many reads, until some time.
struct Line {
    reads: usize,
    back_at: Instant,
}

impl PinErrorType for Line {
    type Error = Infallible;
}

impl Wait for Line {
    async fn wait_for_high(&mut self) -> Result<(), Infallible> {
        if self.reads == 0 {
            Timer::at(self.back_at).await;
            self.reads = usize::MAX;
        }
        self.reads -= 1;
        Ok(())
    }

    async fn wait_for_low(&mut self) -> Result<(), Infallible> {
        pending().await
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), Infallible> {
        pending().await
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), Infallible> {
        pending().await
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), Infallible> {
        pending().await
    }
}

fn with_blocks<T>(
    work: impl AsyncFnOnce(Sender<'_, NoopRawMutex, Block>, Receiver<'_, NoopRawMutex, Block>) -> T,
) -> T {
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (sender, receiver) = channel.split();
    block_on(work(sender, receiver))
}

/// Every event up to the last block, and how many were told lost.
async fn all(blocks: &mut Receiver<'_, NoopRawMutex, Block>) -> (Vec<Event>, u64) {
    let (mut events, mut lost) = (Vec::new(), 0);
    loop {
        let block = blocks.receive().await;
        events.extend(block.events().iter().map(|event| event.unpack(block.t_us)));
        lost += block.lost;
        assert!(block.events().is_empty() || block.geometry == GEOMETRY);
        let last = block.last;
        blocks.receive_done();
        if last {
            return (events, lost);
        }
    }
}

#[test]
fn a_recording_in_flash_comes_whole() {
    let events = events(30_000);
    for kind in [Kind::Evt2, Kind::Evt3] {
        let bytes = frames(kind, &events).concat();
        let (received, acquired) = with_blocks(async |mut sender, mut receiver| {
            let flash = Flash::open(Wire::new(bytes), NoPin, 0x01_0203).await.expect("a flash");
            let mut sensor = SpiSensor::new(flash, AlwaysReady);
            let mut acquired = Acquired::default();
            let told = |now: &Acquired| acquired = *now;
            let playing = acquire(&mut sensor, Pace::File, &mut sender, told);
            let ((), (received, lost)) = embassy_futures::join::join(
                async { playing.await.expect("a sound bus") },
                all(&mut receiver),
            )
            .await;
            assert_eq!(lost, 0);
            (received, acquired)
        });
        assert!(received == events, "{kind:?}");
        assert_eq!(acquired.delivered(), 30_000);
        assert_eq!(acquired.sensor.map(|hello| hello.geometry), Some(GEOMETRY));
    }
}

/// A select line that nobody looks at.
struct NoPin;

impl PinErrorType for NoPin {
    type Error = Infallible;
}

impl embedded_hal::digital::OutputPin for NoPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

#[test]
fn a_flash_is_told_where_to_begin() {
    let mut wire = Wire::new(vec![7]);
    let mut flash = block_on(Flash::open(&mut wire, NoPin, 0x01_0203)).expect("a flash");
    let mut byte = [0];
    block_on(SpiDevice::read(&mut flash, &mut byte)).expect("a sound bus");
    assert_eq!(byte, [7]);
    assert!(block_on(SpiDevice::write(&mut flash, &[0])).is_err(), "it is only read");
    assert_eq!(wire.written, [0x03, 0x01, 0x02, 0x03]);
}

#[test]
fn a_stream_that_is_cut_off_ends_too() {
    let mut frames = frames(Kind::Evt2, &events(1_000));
    frames.pop();
    let bytes = frames.concat();
    let received = with_blocks(async |mut sender, mut receiver| {
        let mut sensor = SpiSensor::new(Wire::new(bytes), AlwaysReady);
        acquire(&mut sensor, Pace::File, &mut sender, |_| {}).await.expect("a sound bus");
        all(&mut receiver).await.0
    });
    assert_eq!(received.len(), 1_000);
}

#[test]
fn nobody_measures_and_acquiring_goes_on_thinned_and_none_is_lost() {
    // Ten times what the blocks hold, within a time that measuring never comes to.
    let count = 40_960;
    let events: Vec<Event> = (0..count)
        .map(|index| Event { t_us: index / 100, x: 1, y: 2, polarity: Polarity::On })
        .collect();
    let bytes = frames(Kind::Evt2, &events).concat();
    let reads = bytes.len() / MAX_FRAME_BYTES + 2;
    let (acquired, received, lost) = with_blocks(async |mut sender, mut receiver| {
        let mut sensor = SpiSensor::new(Wire::new(bytes), Line { reads, back_at: Instant::MAX });
        let mut acquired = Acquired::default();
        let told = |now: &Acquired| acquired = *now;
        let acquiring = acquire(&mut sensor, Pace::Live, &mut sender, told);
        match select(acquiring, Timer::after(Duration::from_millis(300))).await {
            Either::First(end) => assert!(end.is_ok(), "a sensor has no end"),
            Either::Second(()) => {}
        }
        let (mut received, mut lost) = (0, 0);
        while let Some(block) = receiver.try_receive() {
            received += block.events().len() as u64;
            lost += block.lost;
            receiver.receive_done();
        }
        (acquired, received, lost)
    });
    assert!(acquired.thinned > 0, "{acquired:?}");
    assert_eq!((acquired.overrun, lost), (0, 0));
    assert_eq!(acquired.account.sent(), count);
    assert_eq!(acquired.delivered() + acquired.thinned, count);
    // The last block waits to be full.
    let waiting = acquired.delivered() - received;
    assert!(waiting < BLOCK_EVENTS as u64, "{waiting}");
}

#[test]
fn a_sensor_that_goes_is_told_absent_and_one_that_comes_back_is_read_on() {
    let bytes = frames(Kind::Evt2, &events(20_000)).concat();
    let (mut seen, mut received) = (Vec::new(), Vec::new());
    with_blocks(async |mut sender, _receiver| {
        let line = Line { reads: 10, back_at: Instant::now() + SILENCE * 2 };
        let mut sensor = SpiSensor::new(Wire::new(bytes), line);
        let told = |now: &Acquired| {
            if seen.last() != Some(&now.sensor.is_some()) {
                seen.push(now.sensor.is_some());
                received.push(now.account.received);
            }
        };
        let acquiring = acquire(&mut sensor, Pace::Live, &mut sender, told);
        select(acquiring, Timer::after(SILENCE * 5 / 2)).await;
    });
    // The end of the stream, or silence behind it, is the last.
    assert_eq!(seen, [true, false, true, false]);
    assert!(received[2] > received[1], "{received:?}");
}

#[test]
fn a_line_that_is_stuck_does_not_keep_the_processor_busy() {
    let mut told = 0;
    with_blocks(async |mut sender, _receiver| {
        let mut sensor = SpiSensor::new(Wire::new(vec![]), AlwaysReady);
        let acquiring = acquire(&mut sensor, Pace::Live, &mut sender, |_| told += 1);
        select(acquiring, Timer::after(Duration::from_millis(50))).await;
    });
    assert!((1..=51).contains(&told), "{told} reads in 50 ms");
}

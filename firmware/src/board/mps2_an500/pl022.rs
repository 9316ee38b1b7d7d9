//! The board's SPI controller at the pins of shield 1, an Arm PL022 (ARM DDI 0194), as a bus of embedded-hal-async.
//!
//! Behind it QEMU has a serial flash (`qemu.sh`). The emulated controller knows no delay and the board no DMA, so
//! that the bytes of a read are there as fast as they are asked for, and the future is ready at once.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType as PinErrorType, OutputPin};
use embedded_hal_async::spi::{ErrorType, SpiBus};

use crate::register::Register;

/// SSP4: the first bus that QEMU gives a device to.
const BASE: usize = 0x4002_7000;
const CONTROL_0: Register = Register(BASE);
const CONTROL_1: Register = Register(BASE + 0x04);
const DATA: Register = Register(BASE + 0x08);
const STATUS: Register = Register(BASE + 0x0c);
const PRESCALER: Register = Register(BASE + 0x10);

/// Frames of 8 bits, Motorola's format, clock low when idle, sampled at the first edge.
const BYTES_MODE_0: u32 = 7;
const ENABLED: u32 = 1 << 1;
const HAS_RECEIVED: u32 = 1 << 2;
const RECEIVED_ALL: u32 = 1 << 3;
const BUSY: u32 = 1 << 4;
/// The smallest even one: half of the board's 25 MHz.
const FASTEST: u32 = 2;

/// Bytes that the controller holds on their way in and out.
const FIFO_BYTES: usize = 8;

/// The controller.
#[derive(Debug)]
pub struct Pl022(());

impl Pl022 {
    /// Switches the controller on as master. There is one: what makes a second shares its FIFO.
    pub fn start() -> Self {
        CONTROL_1.write(0);
        CONTROL_0.write(BYTES_MODE_0);
        PRESCALER.write(FASTEST);
        CONTROL_1.write(ENABLED);
        while STATUS.read() & HAS_RECEIVED != 0 {
            DATA.read();
        }
        Self(())
    }

    /// Sends up to [`FIFO_BYTES`] bytes, which is what comes back in the same time.
    fn exchange(out: impl ExactSizeIterator<Item = u8>, mut received: impl FnMut(u8)) {
        let count = out.len();
        out.for_each(|byte| DATA.write(byte.into()));
        for _ in 0..count {
            while STATUS.read() & HAS_RECEIVED == 0 {}
            received(DATA.read() as u8);
        }
    }

    /// Receives as many bytes as the FIFO holds, and asks only once whether they are there. Written out, because what is built
    /// for size is not unrolled, and a loop's own instructions are more than these.
    #[inline(always)]
    fn receive(places: &mut [u8; FIFO_BYTES]) {
        let ask = || DATA.write(0);
        ask();
        ask();
        ask();
        ask();
        ask();
        ask();
        ask();
        ask();
        while STATUS.read() & RECEIVED_ALL == 0 {}
        let byte = || DATA.read() as u8;
        *places = [byte(), byte(), byte(), byte(), byte(), byte(), byte(), byte()];
    }
}

impl ErrorType for Pl022 {
    type Error = Infallible;
}

impl SpiBus for Pl022 {
    async fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        let (whole, rest) = words.as_chunks_mut::<FIFO_BYTES>();
        whole.iter_mut().for_each(Self::receive);
        let mut places = rest.iter_mut();
        Self::exchange(core::iter::repeat_n(0, places.len()), |byte| {
            if let Some(place) = places.next() {
                *place = byte;
            }
        });
        Ok(())
    }

    async fn write(&mut self, words: &[u8]) -> Result<(), Infallible> {
        for piece in words.chunks(FIFO_BYTES) {
            Self::exchange(piece.iter().copied(), drop);
        }
        Ok(())
    }

    async fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), Infallible> {
        let shared = read.len().min(write.len());
        read[..shared].copy_from_slice(&write[..shared]);
        self.transfer_in_place(&mut read[..shared]).await?;
        self.write(&write[shared..]).await?;
        self.read(&mut read[shared..]).await
    }

    async fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        for piece in words.chunks_mut(FIFO_BYTES) {
            let mut bytes = [0; FIFO_BYTES];
            bytes[..piece.len()].copy_from_slice(piece);
            let mut places = piece.iter_mut();
            let count = places.len();
            Self::exchange(bytes.into_iter().take(count), |byte| {
                if let Some(place) = places.next() {
                    *place = byte;
                }
            });
        }
        Ok(())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        while STATUS.read() & BUSY != 0 {}
        Ok(())
    }
}

/// The flash's select line, which QEMU holds low for good.
#[derive(Debug)]
pub struct AlwaysSelected;

impl PinErrorType for AlwaysSelected {
    type Error = Infallible;
}

impl OutputPin for AlwaysSelected {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

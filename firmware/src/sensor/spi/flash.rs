//! A stream in a memory chip, read as if a bridge sent it.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType as PinErrorType, OutputPin};
use embedded_hal_async::digital::Wait;
use embedded_hal_async::spi::{ErrorKind, ErrorType, Operation, SpiBus, SpiDevice};

/// The command that every serial flash knows: address of three bytes, then data up to the end of the chip.
const READ: u8 = 0x03;

/// A serial flash that goes on reading where it stopped: chip select stays low from the first byte on, so
/// nothing else may be on the bus.
#[derive(Debug)]
pub struct Flash<B> {
    bus: B,
}

/// Why a flash cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FlashError<E> {
    /// The bus failed.
    #[error("the flash's bus failed: restart the device")]
    Bus(E),
    /// The pin of chip select failed.
    #[error("the flash's select line cannot be driven: restart the device")]
    Select,
    /// The flash is only read here.
    #[error("a flash that is being played is not written to")]
    ReadOnly,
}

impl<E: embedded_hal_async::spi::Error> embedded_hal_async::spi::Error for FlashError<E> {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Bus(error) => error.kind(),
            Self::Select => ErrorKind::ChipSelectFault,
            Self::ReadOnly => ErrorKind::Other,
        }
    }
}

impl<B: SpiBus> Flash<B> {
    /// Begins to read at `address`, below 16 MiB.
    ///
    /// # Errors
    ///
    /// When the bus or the select line fails.
    pub async fn open(
        mut bus: B,
        mut select: impl OutputPin,
        address: u32,
    ) -> Result<Self, FlashError<B::Error>> {
        let [_, a2, a1, a0] = address.to_be_bytes();
        select.set_low().map_err(|_| FlashError::Select)?;
        bus.write(&[READ, a2, a1, a0]).await.map_err(FlashError::Bus)?;
        Ok(Self { bus })
    }
}

impl<B: SpiBus> ErrorType for Flash<B> {
    type Error = FlashError<B::Error>;
}

impl<B: SpiBus> SpiDevice for Flash<B> {
    async fn transaction(
        &mut self,
        operations: &mut [Operation<'_, u8>],
    ) -> Result<(), Self::Error> {
        for operation in operations {
            let Operation::Read(bytes) = operation else { return Err(FlashError::ReadOnly) };
            self.bus.read(bytes).await.map_err(FlashError::Bus)?;
        }
        Ok(())
    }
}

/// The ready line of a flash: it always has something.
#[derive(Clone, Copy, Debug, Default)]
pub struct AlwaysReady;

impl PinErrorType for AlwaysReady {
    type Error = Infallible;
}

impl Wait for AlwaysReady {
    async fn wait_for_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    async fn wait_for_low(&mut self) -> Result<(), Infallible> {
        core::future::pending().await
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), Infallible> {
        core::future::pending().await
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), Infallible> {
        core::future::pending().await
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), Infallible> {
        core::future::pending().await
    }
}

//! Reading from the bus.

use embassy_time::{Duration, with_timeout};
use embedded_hal_async::digital::Wait;
use embedded_hal_async::spi::SpiDevice;

use super::parser::{Frame, Parser};

/// How long nothing may come from a sensor that is there: a bridge says hello every 100 ms.
pub const SILENCE: Duration = Duration::from_millis(500);

/// Why nothing could be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LinkError<E> {
    /// The data-ready line stayed low: no bridge is there, or it has no power.
    #[error("the sensor's ready line stays low: check cable and power of the sensor")]
    Silent,
    /// The pin of the data-ready line failed.
    #[error("the sensor's ready line cannot be read: restart the device")]
    ReadyLine,
    /// The bus failed.
    #[error("the sensor's bus failed: check the cable and restart the device")]
    Bus(E),
}

/// A bridge on an SPI bus, with its data-ready line.
#[derive(Debug)]
pub struct SpiSensor<D, R> {
    device: D,
    ready: R,
    parser: Parser,
}

impl<D: SpiDevice, R: Wait> SpiSensor<D, R> {
    /// A sensor that has said nothing yet.
    pub const fn new(device: D, ready: R) -> Self {
        Self { device, ready, parser: Parser::new() }
    }

    /// Waits until the bridge has something, and reads: 1 to 2 KiB, so that the rest of a frame that is cut off
    /// and one more are always in it.
    ///
    /// # Errors
    ///
    /// When the bridge has nothing for [`SILENCE`], or the bus fails; reading on is allowed.
    pub async fn read(&mut self) -> Result<(), LinkError<D::Error>> {
        match with_timeout(SILENCE, self.ready.wait_for_high()).await {
            Ok(Ok(())) => {}
            Ok(Err(_)) => return Err(LinkError::ReadyLine),
            Err(_) => return Err(LinkError::Silent),
        }
        let space = self.parser.space();
        let bytes = space.len();
        self.device.read(space).await.map_err(LinkError::Bus)?;
        self.parser.filled(bytes);
        Ok(())
    }

    /// The next sound frame of what has been read.
    pub fn next_frame(&mut self) -> Option<Frame<'_>> {
        self.parser.next_frame()
    }
}

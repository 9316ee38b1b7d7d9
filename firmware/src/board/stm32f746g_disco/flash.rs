//! The board's serial flash behind the QUADSPI: Micron N25Q128A, 16 MiB (data sheet rev. R). Preferences at its start, a
//! recording to be replayed from the second megabyte on.

use embassy_stm32::mode::Blocking;
use embassy_stm32::peripherals::QUADSPI;
use embassy_stm32::qspi::enums::{
    AddressSize, ChipSelectHighTime, DummyCycles, FIFOThresholdLevel, MemorySize, QspiWidth,
    SampleShifting,
};
use embassy_stm32::qspi::{Config, Qspi, TransferConfig};
use embassy_sync::mutex::Mutex;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal_async::spi::{ErrorKind, ErrorType as SpiErrorType, Operation, SpiDevice};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::memory;
use crate::wiring::FlashPins;

/// Bytes of the chip.
const BYTES: u32 = 16 << 20;
/// Bytes for preferences, from the start: eight sectors.
pub const PREFERENCES_BYTES: u32 = 8 * SECTOR_BYTES;
/// Where a recording to be replayed begins.
pub const REPLAY: u32 = 1 << 20;

/// Bytes that are erased at once.
const SECTOR_BYTES: u32 = 4096;
/// Bytes that are written at once, from a multiple of as many on.
const PAGE_BYTES: usize = 256;

/// 216 MHz / 4: the most that plain reading of the identity may take.
const PRESCALER: u8 = 3;

/// Longest time for a sector (0.8 s by the data sheet) or page.
const PATIENCE: Duration = Duration::from_secs(2);

/// Time between two looks at whether a sector or page is done.
const LOOK: Duration = Duration::from_millis(1);

/// Looks that it may take after a reset: a second.
const SETTLING_LOOKS: u32 = 1000;

mod command {
    pub const ENABLE_RESET: u8 = 0x66;
    pub const RESET: u8 = 0x99;
    pub const READ_IDENTITY: u8 = 0x9f;
    pub const READ_STATUS: u8 = 0x05;
    pub const READ_FLAGS: u8 = 0x70;
    pub const CLEAR_FLAGS: u8 = 0x50;
    pub const ENABLE_WRITE: u8 = 0x06;
    /// Address on one line, data on four.
    pub const READ: u8 = 0x6b;
    pub const WRITE_PAGE: u8 = 0x02;
    pub const ERASE_SECTOR: u8 = 0x20;
}

/// Micron, N25Q at 3 V, 128 Mbit.
const IDENTITY: [u8; 3] = [0x20, 0xba, 0x18];
/// Of the status.
const BUSY: u8 = 1;
/// Of the flags: erasing or writing failed, or was not allowed.
const FAILED: u8 = 1 << 5 | 1 << 4 | 1 << 1;

/// Why the flash refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error, defmt::Format)]
pub enum FlashError {
    /// No such chip answers.
    #[error("the serial flash does not answer: restart the device")]
    Absent,
    /// The place lies beyond its end.
    #[error("byte {0} lies beyond the serial flash")]
    OutOfBounds(u32),
    /// The place is not where a sector begins.
    #[error("byte {0} is not where a sector of the serial flash begins")]
    NotAligned(u32),
    /// A sector could not be erased, or a page not written.
    #[error("the serial flash failed at byte {0}: it may be worn")]
    Failed(u32),
    /// A sector or page took too long.
    #[error("the serial flash took too long at byte {0}: restart the device")]
    TooLong(u32),
    /// What is being replayed is not written to.
    #[error("a flash that is being played is not written to")]
    ReadOnly,
}

/// The chip.
pub struct Flash {
    qspi: Qspi<'static, QUADSPI, Blocking>,
    present: bool,
}

impl Flash {
    /// Switches it on. A chip that does not answer refuses everything.
    pub fn start(pins: FlashPins) -> Self {
        let mut config = Config::default();
        config.memory_size = MemorySize::_16MiB;
        config.address_size = AddressSize::_24bit;
        config.prescaler = PRESCALER;
        config.cs_high_time = ChipSelectHighTime::_5Cycle;
        config.fifo_threshold = FIFOThresholdLevel::_1Bytes;
        // The chip answers half a cycle late at this clock.
        config.sample_shifting = SampleShifting::HalfCycle;
        let FlashPins { qspi, clock, chip, d0, d1, d2, d3 } = pins;
        let qspi = Qspi::new_blocking_bank1(qspi, d0, d1, d2, d3, clock, chip, config);
        let mut flash = Self { qspi, present: false };
        // The board may have been reset in the middle of something, which the chip ends first.
        flash.command(command::ENABLE_RESET);
        flash.command(command::RESET);
        for _ in 0..SETTLING_LOOKS {
            let mut status = [0];
            flash.answer(command::READ_STATUS, &mut status);
            if status[0] & BUSY == 0 {
                break;
            }
            embassy_time::block_for(LOOK);
        }
        let mut identity = [0; 3];
        flash.answer(command::READ_IDENTITY, &mut identity);
        flash.present = identity == IDENTITY;
        if !flash.present {
            defmt::error!("the serial flash says {=[u8]:02x}", identity);
        }
        flash
    }

    fn command(&mut self, instruction: u8) {
        self.qspi.blocking_command(plain(instruction));
    }

    fn answer(&mut self, instruction: u8, bytes: &mut [u8]) {
        let transfer = TransferConfig { dwidth: QspiWidth::SING, ..plain(instruction) };
        self.qspi.blocking_read(bytes, transfer);
    }

    /// Waits until what was begun at a place is done.
    async fn settle(&mut self, place: u32) -> Result<(), FlashError> {
        let begun = Instant::now();
        let mut status = [BUSY];
        loop {
            self.answer(command::READ_STATUS, &mut status);
            if status[0] & BUSY == 0 {
                break;
            }
            if begun.elapsed() > PATIENCE {
                return Err(FlashError::TooLong(place));
            }
            Timer::after(LOOK).await;
        }
        let mut flags = [0];
        self.answer(command::READ_FLAGS, &mut flags);
        if flags[0] & FAILED == 0 {
            return Ok(());
        }
        self.command(command::CLEAR_FLAGS);
        Err(FlashError::Failed(place))
    }

    /// Whether there is a chip and the bytes are in it.
    fn check(&self, offset: u32, length: usize) -> Result<(), FlashError> {
        let end = u32::try_from(length).ok().and_then(|length| offset.checked_add(length));
        match end {
            _ if !self.present => Err(FlashError::Absent),
            Some(end) if end <= BYTES => Ok(()),
            _ => Err(FlashError::OutOfBounds(offset)),
        }
    }

    /// Reads from a place on.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.check(offset, bytes.len())?;
        if !bytes.is_empty() {
            let transfer = TransferConfig {
                dwidth: QspiWidth::QUAD,
                dummy: DummyCycles::_8,
                ..at(command::READ, offset)
            };
            self.qspi.blocking_read(bytes, transfer);
        }
        Ok(())
    }

    /// Erases whole sectors.
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let length = to.checked_sub(from).ok_or(FlashError::OutOfBounds(from))?;
        self.check(from, length as usize)?;
        if !from.is_multiple_of(SECTOR_BYTES) || !to.is_multiple_of(SECTOR_BYTES) {
            return Err(FlashError::NotAligned(from));
        }
        for sector in (from..to).step_by(SECTOR_BYTES as usize) {
            self.command(command::ENABLE_WRITE);
            self.qspi.blocking_command(at(command::ERASE_SECTOR, sector));
            self.settle(sector).await?;
        }
        Ok(())
    }

    /// Writes: clears bits.
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.check(offset, bytes.len())?;
        let (mut place, mut rest) = (offset, bytes);
        while !rest.is_empty() {
            // A page that is written beyond its end goes on at its start.
            let room = PAGE_BYTES - place as usize % PAGE_BYTES;
            let (page, later) = rest.split_at(room.min(rest.len()));
            self.command(command::ENABLE_WRITE);
            let transfer =
                TransferConfig { dwidth: QspiWidth::SING, ..at(command::WRITE_PAGE, place) };
            self.qspi.blocking_write(page, transfer);
            self.settle(place).await?;
            place += page.len() as u32;
            rest = later;
        }
        Ok(())
    }
}

/// A command alone.
fn plain(instruction: u8) -> TransferConfig {
    TransferConfig { iwidth: QspiWidth::SING, instruction, ..TransferConfig::default() }
}

/// A command with an address.
fn at(instruction: u8, address: u32) -> TransferConfig {
    TransferConfig { awidth: QspiWidth::SING, address: Some(address), ..plain(instruction) }
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds(_) => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned(_) => NorFlashErrorKind::NotAligned,
            Self::Absent | Self::Failed(_) | Self::TooLong(_) | Self::ReadOnly => {
                NorFlashErrorKind::Other
            }
        }
    }
}

/// The chip, which two tasks share.
pub type SharedFlash = Mutex<memory::Mutex, Flash>;

/// The part of it that preferences are kept in.
pub struct Preferences(pub &'static SharedFlash);

impl ErrorType for Preferences {
    type Error = FlashError;
}

impl ReadNorFlash for Preferences {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.0.lock().await.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        PREFERENCES_BYTES as usize
    }
}

impl NorFlash for Preferences {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.0.lock().await.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.0.lock().await.write(offset, bytes).await
    }
}

/// The part of it that holds a recording, read as if a bridge sent it, again and again.
pub struct Replay {
    flash: &'static SharedFlash,
    next: u32,
}

impl Replay {
    /// From its start.
    pub const fn new(flash: &'static SharedFlash) -> Self {
        Self { flash, next: REPLAY }
    }
}

impl SpiErrorType for Replay {
    type Error = FlashError;
}

impl embedded_hal_async::spi::Error for FlashError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl SpiDevice for Replay {
    async fn transaction(
        &mut self,
        operations: &mut [Operation<'_, u8>],
    ) -> Result<(), FlashError> {
        for operation in operations {
            let Operation::Read(bytes) = operation else { return Err(FlashError::ReadOnly) };
            self.flash.lock().await.read(self.next, bytes)?;
            self.next += bytes.len() as u32;
            let ends = self.next.saturating_add(bytes.len() as u32) > BYTES;
            // Behind the recording the flash is empty: it begins anew.
            if ends || bytes.iter().all(|&byte| byte == 0xff) {
                self.next = REPLAY;
            }
        }
        Ok(())
    }
}

//! Faults on purpose, asked for on the command line, so that tests see how the device takes them.

use cortex_m::peripheral::SCB;
use embassy_futures::block_on;
use embassy_time::{Duration, Timer};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use evtach_firmware::instrument::Preferences;
use evtach_firmware::settings::{MemoryFlashError, Store};

use crate::psram::{self, PREFERENCES_BYTES};

/// How long the device runs before the fault.
const AFTER: Duration = Duration::from_millis(1_500);

/// A fault to come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Injection {
    /// None.
    #[default]
    None,
    /// A task stops itself.
    Panic(&'static str),
    /// A task goes round in circles.
    Hang(&'static str),
    /// Measuring takes no more blocks, so that the channel of blocks fills up.
    FullChannel,
    /// The preferences are overwritten with nonsense before they are read.
    Preferences,
    /// The power goes while preferences are written.
    PowerCut,
}

impl Injection {
    /// All, under their names on the command line.
    pub const ALL: [(&'static str, Self); 9] = [
        ("panic:acquire", Self::Panic("acquire")),
        ("panic:measure", Self::Panic("measure")),
        ("panic:show", Self::Panic("show")),
        ("panic:link", Self::Panic("link")),
        ("hang:measure", Self::Hang("measure")),
        ("hang:show", Self::Hang("show")),
        ("full", Self::FullChannel),
        ("preferences", Self::Preferences),
        ("power", Self::PowerCut),
    ];

    /// Waits for the fault of a task, for ever when it is not to have one. Returns when the task is to end.
    #[expect(clippy::panic, reason = "that is what it is for")]
    pub async fn strike(self, task: &str) {
        Timer::after(AFTER).await;
        match self {
            Self::Panic(victim) if victim == task => panic!("asked for in the task {task}"),
            Self::Hang(victim) if victim == task => loop {
                // No `spin_loop`: QEMU spends ages on the YIELD that it is.
                cortex_m::asm::nop();
            },
            Self::FullChannel if task == "measure" => {}
            _ => core::future::pending().await,
        }
    }
}

/// The preferences' flash. When its power is cut, so is the board's.
#[derive(Debug)]
pub struct PowerSupply(&'static mut psram::Preferences);

impl PowerSupply {
    /// Flash with power, and with the fault that was asked for.
    pub fn new(flash: &'static mut psram::Preferences, injection: Injection) -> Self {
        flash.restore_power();
        match injection {
            Injection::Preferences => {
                *flash = psram::Preferences::new([0x5a; PREFERENCES_BYTES]);
            }
            // Something is there to be lost, and the second word of what follows it is cut in its midst.
            Injection::PowerCut => {
                let mut store = Store::new(Self(flash), 0, PREFERENCES_BYTES as u32);
                block_on(store.save(&Preferences::default())).ok();
                let Self(flash) = store.release();
                flash.cut_power(1, 100);
                return Self(flash);
            }
            Injection::None | Injection::Panic(_) | Injection::Hang(_) | Injection::FullChannel => {
            }
        }
        Self(flash)
    }

    fn survive<T>(result: Result<T, MemoryFlashError>) -> Result<T, MemoryFlashError> {
        if let Err(MemoryFlashError::PowerCut) = result {
            SCB::sys_reset();
        }
        result
    }
}

impl ErrorType for PowerSupply {
    type Error = MemoryFlashError;
}

impl ReadNorFlash for PowerSupply {
    const READ_SIZE: usize = psram::Preferences::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFlashError> {
        self.0.read(offset, bytes).await
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for PowerSupply {
    const WRITE_SIZE: usize = psram::Preferences::WRITE_SIZE;
    const ERASE_SIZE: usize = psram::Preferences::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryFlashError> {
        Self::survive(self.0.erase(from, to).await)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFlashError> {
        Self::survive(self.0.write(offset, bytes).await)
    }
}

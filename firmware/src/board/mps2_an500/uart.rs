//! The board's serial port, a CMSDK UART (Arm "Cortex-M System Design Kit" TRM, chapter 4), as a stream of
//! embedded-io-async. Bytes come in by interrupt.

use core::convert::Infallible;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_time::{Duration, Timer};
use embedded_io_async::{ErrorType, Read, Write};

use crate::register::Register;

/// UART 0: the one that QEMU's `-serial` is.
const BASE: usize = 0x4000_4000;
const DATA: Register = Register(BASE);
const STATE: Register = Register(BASE + 0x04);
const CONTROL: Register = Register(BASE + 0x08);
const CLEAR: Register = Register(BASE + 0x0c);
const DIVIDER: Register = Register(BASE + 0x10);

const CANNOT_SEND: u32 = 1;
const HAS_RECEIVED: u32 = 1 << 1;
const SEND: u32 = 1;
const RECEIVE: u32 = 1 << 1;
const RECEIVE_INTERRUPT: u32 = 1 << 3;
/// 25 MHz / 217 = 115 200 baud.
const BAUD_115_200: u32 = 217;
/// About a byte at that.
const PAUSE: Duration = Duration::from_micros(90);

/// Bytes that wait to be read: a line of SCPI.
static RECEIVED: Pipe<CriticalSectionRawMutex, 256> = Pipe::new();

/// Serves the interrupt of a byte that has come.
pub fn on_receive() {
    CLEAR.write(RECEIVE);
    while STATE.read() & HAS_RECEIVED != 0 {
        if RECEIVED.is_full() {
            // The byte stays where it is until there is room, and the sender waits.
            CONTROL.write(SEND | RECEIVE);
            return;
        }
        RECEIVED.try_write(&[DATA.read() as u8]).ok();
    }
}

/// The port.
#[derive(Debug)]
pub struct Uart(());

impl Uart {
    /// Switches the port on; its interrupt is the caller's part. There is one: what makes a second shares its bytes.
    pub fn start() -> Self {
        DIVIDER.write(BAUD_115_200);
        CONTROL.write(SEND | RECEIVE | RECEIVE_INTERRUPT);
        Self(())
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let count = RECEIVED.read(bytes).await;
        // What waited for room comes in now; the interrupt must not read the same byte.
        critical_section::with(|_| {
            CONTROL.write(SEND | RECEIVE | RECEIVE_INTERRUPT);
            on_receive();
        });
        Ok(count)
    }
}

impl Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Some(&byte) = bytes.first() else { return Ok(0) };
        while STATE.read() & CANNOT_SEND != 0 {
            Timer::after(PAUSE).await;
        }
        DATA.write(byte.into());
        Ok(1)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

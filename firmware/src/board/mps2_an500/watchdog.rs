//! The board's watchdog (Arm "Cortex-M System Design Kit" TRM, chapter 4): not fed for four seconds it asks for the
//! non-maskable interrupt, and for eight it resets the board.

use crate::register::Register;

const BASE: usize = 0x4000_8000;
const LOAD: Register = Register(BASE);
const CONTROL: Register = Register(BASE + 0x08);
const CLEAR: Register = Register(BASE + 0x0c);
const LOCK: Register = Register(BASE + 0xc00);

const UNLOCK: u32 = 0x1acc_e551;
const INTERRUPT_AND_RESET: u32 = 0b11;

/// Four seconds of the board's 25 MHz: beside more events than the processor can take, a whole screen takes two to draw.
const PERIOD_TICKS: u32 = 100_000_000;

/// Starts it. From now on it wants to be fed.
pub fn start() {
    LOCK.write(UNLOCK);
    LOAD.write(PERIOD_TICKS);
    CONTROL.write(INTERRUPT_AND_RESET);
}

/// Feeds it.
pub fn feed() {
    CLEAR.write(1);
}

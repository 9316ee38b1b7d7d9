//! The independent watchdog: it runs on an oscillator of its own and resets the board when it is not fed.

use embassy_stm32::pac::DBGMCU;
use embassy_stm32::wdg::IndependentWatchdog;

use crate::wiring::WatchdogParts;

/// Four seconds: beside more events than the processor can take, a whole screen takes two to draw.
const PERIOD_US: u32 = 4_000_000;

/// Starts it. From now on it wants to be fed.
pub fn start(parts: WatchdogParts) -> impl FnMut() {
    // A debugger that stops the processor stops it too.
    DBGMCU.apb1fzr().modify(|freeze| freeze.set_iwdg(true));
    let mut watchdog = IndependentWatchdog::new(parts.iwdg, PERIOD_US);
    watchdog.unleash();
    move || watchdog.pet()
}

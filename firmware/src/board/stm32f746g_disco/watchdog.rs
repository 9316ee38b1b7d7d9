//! The independent watchdog: it runs on an oscillator of its own and resets the board when it is not fed.

use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;

/// Four seconds: beside more events than the processor can take, a whole screen takes two to draw.
const PERIOD_US: u32 = 4_000_000;

/// Starts it. From now on it wants to be fed.
pub fn start(watchdog: Peri<'static, IWDG>) -> impl FnMut() {
    let mut watchdog = IndependentWatchdog::new(watchdog, PERIOD_US);
    watchdog.unleash();
    move || watchdog.pet()
}

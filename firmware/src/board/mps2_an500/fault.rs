//! What becomes of a program that cannot go on: as an instrument it starts anew and shows what happened; on the bench
//! it says so and ends.
#![expect(unsafe_code, reason = "a handler of an exception")]

use core::fmt::Display;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use evtach_firmware::instrument::Fault;
use evtach_firmware::kept::{self, KeptFault};
use semihosting::process;

use crate::psram;

static RESTARTS: AtomicBool = AtomicBool::new(false);

/// From now on a fault is kept and the board reset.
pub fn restart_from_now_on() {
    RESTARTS.store(true, Ordering::Relaxed);
}

/// The fault before this start.
pub fn take_kept() -> Option<KeptFault> {
    let mut block = psram::read_kept();
    let fault = kept::take(&mut block);
    psram::write_kept(&block);
    fault
}

/// Ends the program for bad usage or input.
pub fn fail(what: impl Display) -> ! {
    semihosting::eprintln!("mps2_an500: {what}");
    process::exit(2)
}

/// Ends the program, or starts it anew, for what must not happen.
pub fn stop(fault: Fault, what: &dyn Display) -> ! {
    if RESTARTS.load(Ordering::Relaxed) {
        psram::write_kept(&kept::encode(&KeptFault::new(fault, what)));
        SCB::sys_reset();
    }
    semihosting::eprintln!("mps2_an500: {what}");
    process::exit(if fault == Fault::Panic { 101 } else { 102 })
}

/// The watchdog has not been fed.
#[exception]
unsafe fn NonMaskableInt() {
    stop(Fault::Watchdog, &"the screen was not drawn for four seconds");
}

//! What becomes of a program that cannot go on: as an instrument it starts anew and shows what happened; on the bench
//! it says so and ends.
#![expect(unsafe_code, reason = "handlers of exceptions, one of which has lost its stack")]

use core::arch::asm;
use core::fmt::Display;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use evtach_firmware::instrument::Fault;
use evtach_firmware::kept::{self, KeptFault};
use semihosting::process;

use crate::{psram, stack};

static RESTARTS: AtomicBool = AtomicBool::new(false);

/// From now on a fault is kept and the board reset.
pub fn restart_from_now_on() {
    RESTARTS.store(true, Ordering::Relaxed);
}

/// The fault before this start.
pub fn take_kept() -> Option<KeptFault> {
    let mut block = psram::read_kept();
    let fault = kept::take(&mut block);
    psram::write_kept(block);
    fault
}

/// Ends the program for bad usage or input.
pub fn fail(what: impl Display) -> ! {
    semihosting::eprintln!("mps2_an500: {what}");
    process::exit(2)
}

/// Ends the program, or starts it anew, for what must not happen.
pub fn stop(fault: Fault, what: impl Display) -> ! {
    if RESTARTS.load(Ordering::Relaxed) {
        psram::write_kept(kept::encode(&KeptFault::new(fault, what)));
        SCB::sys_reset();
    }
    semihosting::eprintln!("mps2_an500: {what}");
    process::exit(if fault == Fault::Panic { 101 } else { 102 })
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    match info.location() {
        Some(at) => {
            stop(Fault::Panic, format_args!("{}:{}: {}", at.file(), at.line(), info.message()))
        }
        None => stop(Fault::Panic, info.message()),
    }
}

/// The watchdog has not been fed.
#[exception]
unsafe fn NonMaskableInt() {
    stop(Fault::Watchdog, "the screen was not drawn for four seconds");
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    // The stack may be what failed: begin it anew, since nothing is returned to.
    // SAFETY: `say_fault` takes one word and never returns.
    unsafe {
        asm!(
            "msr MSP, {start}",
            "b {say_fault}",
            start = in(reg) stack::start(),
            say_fault = sym say_fault,
            in("r0") frame,
            options(noreturn),
        )
    }
}

extern "C" fn say_fault(frame: *const ExceptionFrame) -> ! {
    if stack::contains(frame.addr()) {
        // SAFETY: the processor wrote it there, and nothing has run since but the lines above.
        let (pc, lr) = unsafe { ((*frame).pc(), (*frame).lr()) };
        stop(Fault::Exception, format_args!("fault at {pc:#010x}, called from {lr:#010x}"))
    }
    stop(Fault::Exception, "the stack grew beyond what memory.x gives it")
}

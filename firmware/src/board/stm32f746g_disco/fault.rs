//! What becomes of a program that cannot go on: what happened is kept over a reset, and shown after it.
#![expect(
    unsafe_code,
    reason = "handlers of exceptions, one of which has lost its stack; memory that a reset keeps"
)]

use core::arch::asm;
use core::fmt::Display;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac::RCC;
use evtach_firmware::instrument::Fault;
use evtach_firmware::kept::{self, KEPT_BYTES, KeptFault};

use crate::stack;

/// The last fault. Not cached: what a cache holds, a reset loses.
#[unsafe(link_section = ".kept")]
static mut KEPT: MaybeUninit<[u8; KEPT_BYTES]> = MaybeUninit::uninit();

/// The fault before this start: what was kept, or else that the watchdog reset the board.
pub fn take_kept() -> Option<KeptFault> {
    let place = (&raw mut KEPT).cast::<[u8; KEPT_BYTES]>();
    // Once a start. After power-on it holds anything, of which `take` tells a fault by its checksum.
    // SAFETY: any bytes will do, nothing refers to them, and handlers that write them do not return.
    let mut block = unsafe { ptr::read_volatile(place) };
    let fault = kept::take(&mut block);
    // SAFETY: as above.
    unsafe { ptr::write_volatile(place, block) };
    let watchdog = RCC.csr().read().wdgrstf();
    RCC.csr().modify(|csr| csr.set_rmvf(true));
    let bitten = || KeptFault::new(Fault::Watchdog, "the screen was not drawn for four seconds");
    fault.or_else(|| watchdog.then(bitten))
}

/// Starts the program anew for what must not happen.
pub fn stop(fault: Fault, what: impl Display) -> ! {
    cortex_m::interrupt::disable();
    defmt::error!("{}", defmt::Display2Format(&what));
    let block = kept::encode(&KeptFault::new(fault, what));
    // SAFETY: nothing refers to it, and nothing but this runs any more.
    unsafe { ptr::write_volatile((&raw mut KEPT).cast(), block) };
    SCB::sys_reset();
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    match info.location() {
        Some(at) => {
            stop(Fault::Panic, format_args!("{}:{}: {}", at.file(), at.line(), info.message()))
        }
        None => stop(Fault::Panic, info.message()),
    }
}

/// The crystal has stopped: the chip goes on at its own clock, and nothing that is measured counts.
#[exception]
unsafe fn NonMaskableInt() {
    stop(Fault::Crystal, "the 25 MHz from X2 stopped");
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

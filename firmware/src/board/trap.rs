//! What no program expects, in words: panics and the processor's faults. What becomes of it then each board's `fault.rs`
//! says. And the block of memory that keeps it over a reset.
#![expect(
    unsafe_code,
    reason = "a handler of an exception that has lost its stack; memory that a reset keeps"
)]

use core::arch::asm;
use core::panic::PanicInfo;
use core::ptr;

use cortex_m_rt::{ExceptionFrame, exception};
use evtach_firmware::instrument::Fault;
use evtach_firmware::kept::KEPT_BYTES;

use crate::fault::stop;
use crate::stack;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    match info.location() {
        Some(at) => {
            stop(Fault::Panic, &format_args!("{}:{}: {}", at.file(), at.line(), info.message()))
        }
        None => stop(Fault::Panic, &info.message()),
    }
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
        stop(Fault::Exception, &format_args!("fault at {pc:#010x}, called from {lr:#010x}"))
    }
    stop(Fault::Exception, &"the stack grew beyond what memory.x gives it")
}

/// The block of the last fault, by value: it may be written by a handler at any time.
///
/// # Safety
///
/// As many bytes are there, and nothing refers to them.
pub unsafe fn read_kept(place: *const u8) -> [u8; KEPT_BYTES] {
    // Byte by byte in a loop, not at once, which is 1.4 KB of code.
    // SAFETY: the caller's.
    core::array::from_fn(|at| unsafe { ptr::read_volatile(place.wrapping_add(at)) })
}

/// Writes the block of the last fault.
///
/// # Safety
///
/// As for [`read_kept`].
pub unsafe fn write_kept(place: *mut u8, block: &[u8; KEPT_BYTES]) {
    for (at, byte) in block.iter().enumerate() {
        // SAFETY: the caller's.
        unsafe { ptr::write_volatile(place.wrapping_add(at), *byte) };
    }
}

//! Where the stack is, and how deep it has been.
#![expect(unsafe_code, reason = "reads and paints the stack's own memory")]

use core::ptr;
use core::sync::atomic::{AtomicUsize, Ordering};

unsafe extern "C" {
    // Defined by memory.x; only their addresses mean anything.
    static _stack_start: u32;
    static mut _stack_end: u32;
}

/// Where the stack begins; it grows downwards.
pub fn start() -> usize {
    ptr::addr_of!(_stack_start).addr()
}

/// Whether an address lies in the stack's memory.
pub fn contains(address: usize) -> bool {
    (ptr::addr_of!(_stack_end).addr()..start()).contains(&address)
}

/// How deep it was while the program started.
static AT_START: AtomicUsize = AtomicUsize::new(0);

/// Notes how deep the stack has been so far, and paints it anew: starting and running are told apart.
#[inline(never)]
pub fn start_running() {
    AT_START.store(deepest(), Ordering::Relaxed);
    let mut word = ptr::addr_of_mut!(_stack_end);
    let here = ptr::from_ref(&word).addr();
    // SAFETY: the words up to a frame's length below this function's own variables are not in use; interrupts, which
    // would use them, are held back by the caller.
    while word.addr() + 128 < here {
        unsafe { word.write_volatile(cortex_m_rt::STACK_PAINT_VALUE) };
        word = word.wrapping_add(1);
    }
}

/// How deep it was while the program started, and since.
pub fn depths() -> (usize, usize) {
    (AT_START.load(Ordering::Relaxed), deepest())
}

/// Bytes of stack that have been written since it was painted last: by cortex-m-rt before `main`, or here.
fn deepest() -> usize {
    let start = ptr::addr_of!(_stack_start);
    let mut word = ptr::addr_of!(_stack_end);
    // SAFETY: the words between the two symbols are RAM that nothing else is placed in; what lies
    // below the stack pointer does not change while this reads it, and a stale value does no harm.
    while word < start && unsafe { word.read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    start.addr() - word.addr()
}

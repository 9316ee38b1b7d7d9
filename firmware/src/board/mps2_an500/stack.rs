//! Where the stack is, and how deep it has been.
#![expect(unsafe_code, reason = "reads the stack's own memory")]

use core::ptr;

unsafe extern "C" {
    // Defined by memory.x; only their addresses mean anything.
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Where the stack begins; it grows downwards.
pub fn start() -> usize {
    ptr::addr_of!(_stack_start).addr()
}

/// Whether an address lies in the stack's memory.
pub fn contains(address: usize) -> bool {
    (ptr::addr_of!(_stack_end).addr()..start()).contains(&address)
}

/// Bytes of stack that have ever been written: cortex-m-rt painted it before `main`.
pub fn deepest() -> usize {
    let start = ptr::addr_of!(_stack_start);
    let mut word = ptr::addr_of!(_stack_end);
    // SAFETY: the words between the two symbols are RAM that nothing else is placed in; what lies
    // below the stack pointer does not change while this reads it, and a stale value does no harm.
    while word < start && unsafe { word.read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    start.addr() - word.addr()
}

//! Memory that the core reads and writes by itself. The MPU keeps the cache out of it (`cache.rs`).

use core::cell::UnsafeCell;

/// Transfers at once: a control pipe, one for data, and one more.
pub const CHANNELS: usize = 3;

/// Bytes of a channel's own buffer: the largest packet.
pub const BUFFER_BYTES: usize = 512;

/// Transfers of data that are under way or wait to be fetched: one is filled while another is handled, and there is one in
/// between.
pub const SLOTS: usize = 3;

/// Bytes of one: four packets at high speed.
pub const SLOT_BYTES: usize = 2048;

/// The core wants whole words.
#[repr(C, align(4))]
struct Memory {
    slots: [[u8; SLOT_BYTES]; SLOTS],
    buffers: [[u8; BUFFER_BYTES]; CHANNELS],
}

struct Shared(UnsafeCell<Memory>);

// SAFETY: only addresses of it are handed out. Who may use what stands between is said by `Channel` and `Ring`, which are
// behind a critical section.
unsafe impl Sync for Shared {}

/// 7.5 KB. Its section is not cleared at the start; every byte is written before it is read.
#[unsafe(link_section = ".dma")]
static MEMORY: Shared = Shared(UnsafeCell::new(Memory {
    slots: [[0; SLOT_BYTES]; SLOTS],
    buffers: [[0; BUFFER_BYTES]; CHANNELS],
}));

/// The buffer of a channel; of the last, where there are fewer.
pub fn buffer(channel: usize) -> *mut u8 {
    // SAFETY: within the array; no reference is made.
    unsafe { (&raw mut (*MEMORY.0.get()).buffers[channel.min(CHANNELS - 1)]).cast() }
}

/// The buffer of a slot; of the last, where there are fewer.
pub fn slot(index: usize) -> *mut u8 {
    // SAFETY: as above.
    unsafe { (&raw mut (*MEMORY.0.get()).slots[index.min(SLOTS - 1)]).cast() }
}

/// Address as the core wants it.
pub fn address(buffer: *mut u8) -> u32 {
    buffer.expose_provenance() as u32
}

//! Device registers.
#![expect(unsafe_code, reason = "reads and writes device registers")]

use core::ptr;

/// A word of a device, at its address. Every constant of this type names a register of the board that may be
/// read and written by the program at any time: that is what makes the methods sound.
#[derive(Clone, Copy, Debug)]
pub struct Register(pub usize);

impl Register {
    /// Reads it; for some registers that does something.
    pub fn read(self) -> u32 {
        // SAFETY: see the type: a word of a device that may be read.
        unsafe { ptr::with_exposed_provenance::<u32>(self.0).read_volatile() }
    }

    /// Writes it.
    pub fn write(self, value: u32) {
        // SAFETY: see the type: a word of a device that may be written.
        unsafe { ptr::with_exposed_provenance_mut::<u32>(self.0).write_volatile(value) }
    }
}

//! Caches, and what they are kept away from (Arm DDI 0403, B3.5; ST AN4838).
#![expect(unsafe_code, reason = "writes the memory protection unit's registers")]

use cortex_m::peripheral::{CPUID, MPU, SCB};

use crate::sdram;

/// Where the USB host controller reads and writes by itself, and the last fault is kept: the regions DMA and KEPT of
/// memory.x in one.
const DMA_START: u32 = 0x2004_e000;
const DMA_BYTES_LOG2: u32 = 13;

/// A region that is on.
const ENABLE: u32 = 1;
/// Full access, privileged or not.
const READ_WRITE: u32 = 0b011 << 24;
const NEVER_EXECUTE: u32 = 1 << 28;
/// Normal memory, not cached: TEX 1, C 0, B 0. Normal, because unaligned access is allowed there, as it is not in
/// SDRAM by default. Not write-through, although that would do for what the display reads: a Cortex-M7 of this
/// revision may lose a store there (ST ES0290, "data corruption when using data cache configured in write-through").
const NOT_CACHED: u32 = 0b001 << 19;

/// What lies from here on, 1 GB: static memories and the mapped serial flash, of which the program uses none. By default it is
/// normal memory, which the processor may read ahead of need, and a read that nobody answers stops it.
const UNUSED_START: u32 = 0x6000_0000;
const UNUSED_BYTES_LOG2: u32 = 30;
/// No access; strongly ordered: TEX 0, C 0, B 0.
const NO_ACCESS: u32 = 0;

/// The default map where no region is.
const DEFAULT_MAP: u32 = 1 << 2;

/// Sets the regions and switches both caches on.
pub fn start(mpu: &mut MPU, scb: &mut SCB, cpuid: &mut CPUID) {
    let memory = READ_WRITE | NOT_CACHED;
    let regions = [
        (UNUSED_START, UNUSED_BYTES_LOG2, NO_ACCESS),
        (DMA_START, DMA_BYTES_LOG2, memory),
        (sdram::START as u32, sdram::BYTES.trailing_zeros(), memory),
    ];
    for (number, (start, bytes_log2, attributes)) in (0..).zip(regions) {
        // SAFETY: before anything uses these memories, and with the caches off.
        unsafe {
            mpu.rnr.write(number);
            mpu.rbar.write(start);
            mpu.rasr.write(NEVER_EXECUTE | attributes | (bytes_log2 - 1) << 1 | ENABLE);
        }
    }
    // SAFETY: what is not named above stays as it was.
    unsafe { mpu.ctrl.write(DEFAULT_MAP | ENABLE) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    scb.enable_icache();
    scb.enable_dcache(cpuid);
}

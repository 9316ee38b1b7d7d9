//! The board's SDRAM: 8 of its 16 MiB, because 16 of its 32 data lines are wired (ST UM1907, 6.11).
#![expect(unsafe_code, reason = "memory at fixed addresses")]

use core::ptr;

use embassy_stm32::fmc::Fmc;
use embassy_time::Delay;
use stm32_fmc::{SdramChip, SdramConfiguration, SdramTiming};

use crate::wiring::SdramPins;

/// Where it begins.
pub const START: usize = 0xc000_0000;
/// How much there is.
pub const BYTES: usize = 8 << 20;

/// Two frames for the display, 256 KB each.
pub const FRAMES: usize = START;
pub const FRAME_BYTES: usize = 256 << 10;
/// Room for recordings: all but the first megabyte.
pub const RECORDING: usize = START + (1 << 20);
pub const RECORDING_BYTES: usize = BYTES - (1 << 20);

/// ISSI IS42S32400F-6, or Micron's MT48LC4M32B2B5-6A on older boards, at 108 MHz: a cycle is 9.26 ns. The slower of both
/// counts.
struct Chip;

impl SdramChip for Chip {
    /// Single words, CAS latency 3.
    const MODE_REGISTER: u16 = 0x0230;
    const TIMING: SdramTiming = SdramTiming {
        startup_delay_ns: 100_000,
        max_sd_clock_hz: 108_000_000,
        refresh_period_ns: 15_625,  // 64 ms / 4096 rows
        mode_register_to_active: 2, // tMRD 2 cycles
        exit_self_refresh: 8,       // tXSR 70 ns
        active_to_precharge: 5,     // tRAS 42 ns
        row_cycle: 7,               // tRC 60 ns
        row_precharge: 2,           // tRP 18 ns
        row_to_column: 2,           // tRCD 18 ns
    };
    const CONFIG: SdramConfiguration = SdramConfiguration {
        column_bits: 8,
        row_bits: 12,
        memory_data_width: 16,
        internal_banks: 4,
        cas_latency: 3,
        write_protection: false,
        read_burst: true,
        read_pipe_delay_cycles: 0,
    };
}

/// A cell that does not hold what was written to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error, defmt::Format)]
#[error("the SDRAM fails at {address:#010x}: wrote {wrote:#010x}, read {read:#010x}")]
pub struct SdramError {
    /// Where.
    pub address: usize,
    /// What was written.
    pub wrote: u32,
    /// What was read.
    pub read: u32,
}

/// Switches it on and tests it. What was in it is lost.
///
/// # Errors
///
/// When a cell does not hold what was written to it.
#[inline(never)]
pub fn start(p: SdramPins) -> Result<(), SdramError> {
    let mut sdram = Fmc::sdram_a12bits_d16bits_4banks_bank1(
        p.fmc,
        p.a0,
        p.a1,
        p.a2,
        p.a3,
        p.a4,
        p.a5,
        p.a6,
        p.a7,
        p.a8,
        p.a9,
        p.a10,
        p.a11,
        p.bank0,
        p.bank1,
        p.d0,
        p.d1,
        p.d2,
        p.d3,
        p.d4,
        p.d5,
        p.d6,
        p.d7,
        p.d8,
        p.d9,
        p.d10,
        p.d11,
        p.d12,
        p.d13,
        p.d14,
        p.d15,
        p.mask0,
        p.mask1,
        p.clock_enable,
        p.clock,
        p.column,
        p.chip,
        p.row,
        p.write,
        Chip,
    );
    sdram.init(&mut Delay);
    test()
}

/// Data lines, address lines, and every word that the display shows.
fn test() -> Result<(), SdramError> {
    for bit in 0..32 {
        write(START, 1 << bit);
        expect(START, 1 << bit)?;
    }
    // A line that is stuck or touches another makes two places one.
    let lines = || (2..BYTES.trailing_zeros()).map(|line| START + (1 << line));
    lines().for_each(|place| write(place, place as u32));
    write(START, !0);
    expect(START, !0)?;
    lines().try_for_each(|place| expect(place, place as u32))?;
    for flip in [0, !0] {
        let words = || (FRAMES..FRAMES + 2 * FRAME_BYTES).step_by(4);
        words().for_each(|place| write(place, place as u32 ^ flip));
        words().try_for_each(|place| expect(place, place as u32 ^ flip))?;
    }
    Ok(())
}

fn expect(address: usize, wrote: u32) -> Result<(), SdramError> {
    // SAFETY: within the SDRAM, which nothing refers to yet.
    let read = unsafe { ptr::with_exposed_provenance::<u32>(address).read_volatile() };
    if read == wrote { Ok(()) } else { Err(SdramError { address, wrote, read }) }
}

fn write(address: usize, word: u32) {
    // SAFETY: as above.
    unsafe { ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(word) }
}

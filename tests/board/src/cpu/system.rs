//! The system control space: what of it firmware touches. Caches and the memory protection unit take their settings and
//! change nothing.

use super::nvic::{self, Nvic};
use crate::time::{NEVER, Pulse};

/// What a write asks the machine to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// Nothing beyond the registers.
    Nothing,
    /// A reset of the whole chip.
    Reset,
}

const CPUID_CORTEX_M7_R1P1: u32 = 0x411f_c271;
/// Data cache: 4 KB, 4 ways of 32 sets of 32 bytes.
const CCSIDR_DATA: u32 = 0xf003_e019;
/// Instruction cache: 4 KB, 2 ways of 64 sets of 32 bytes.
const CCSIDR_INSTRUCTION: u32 = 0x2007_e009;
const VECTKEY: u32 = 0x05fa;
const VECTKEY_READ: u32 = 0xfa05;

/// SysTick, SCB, MPU, FPU control, DWT and the debug registers.
#[derive(Default)]
pub struct System {
    /// Where the vectors lie.
    pub vtor: u32,
    /// Registers that are kept as they are written, by their offset.
    plain: std::collections::BTreeMap<u32, u32>,
    /// Why a fault was taken.
    pub cfsr: u32,
    pub hfsr: u32,
    pub bfar: u32,
    tick: SysTick,
    /// Time at which the cycle counter stood at zero.
    cycles_from: u64,
}

/// The core's own timer.
#[derive(Default)]
struct SysTick {
    ctrl: u32,
    load: u32,
    /// When the counter was last loaded.
    loaded: u64,
    flag: bool,
}

impl SysTick {
    fn period_ps(&self, pulse: &Pulse) -> u64 {
        // Without CLKSOURCE it counts every eighth cycle.
        let cycle = pulse.instruction_ps.get() * if self.ctrl & 4 != 0 { 1 } else { 8 };
        (u64::from(self.load) + 1) * cycle
    }

    fn next(&self, pulse: &Pulse) -> u64 {
        if self.ctrl & 1 == 0 || self.load == 0 {
            NEVER
        } else {
            self.loaded + self.period_ps(pulse)
        }
    }
}

impl System {
    /// When the SysTick is due.
    pub fn next(&self, pulse: &Pulse) -> u64 {
        self.tick.next(pulse)
    }

    /// Lets the SysTick fire.
    pub fn advance(&mut self, nvic: &mut Nvic, pulse: &Pulse) {
        while self.tick.next(pulse) <= pulse.now.get() {
            self.tick.loaded += self.tick.period_ps(pulse);
            self.tick.flag = true;
            if self.tick.ctrl & 2 != 0 {
                nvic.pend(nvic::SYS_TICK);
            }
        }
    }

    /// Reads, by the offset from 0xE0000000.
    pub fn read(&mut self, at: u32, nvic: &Nvic, pulse: &Pulse) -> u32 {
        let cycle_ps = pulse.instruction_ps.get().max(1);
        match at {
            0x1004 => ((pulse.now.get() - self.cycles_from) / cycle_ps) as u32,
            0xe010 => {
                let flag = u32::from(std::mem::take(&mut self.tick.flag)) << 16;
                self.tick.ctrl | flag
            }
            0xe014 => self.tick.load,
            0xe018 => {
                let left = self.tick.next(pulse).saturating_sub(pulse.now.get());
                if self.tick.ctrl & 1 == 0 { 0 } else { (left / cycle_ps) as u32 & 0xff_ffff }
            }
            // Ten nanoseconds are no whole cycles: no calibration.
            0xe01c => 0xc000_0000,
            0xe100..0xe500 => nvic.read(at - 0xe000),
            0xed00 => CPUID_CORTEX_M7_R1P1,
            0xed04 => {
                let waiting = |exception| u32::from(nvic.is_pending(exception));
                let first = nvic.first().map_or(0, |(exception, _)| u32::from(exception));
                u32::from(nvic.current())
                    | u32::from(nvic.depth() <= 1) << 11
                    | first << 12
                    | u32::from(nvic.any_line_pending()) << 22
                    | waiting(nvic::SYS_TICK) << 26
                    | waiting(nvic::PEND_SV) << 28
            }
            0xed08 => self.vtor,
            0xed0c => VECTKEY_READ << 16 | self.plain.get(&at).copied().unwrap_or(0) & 0x700,
            0xed18..0xed24 => nvic.priority_word((at - 0xed18) as usize + 4),
            0xed28 => self.cfsr,
            0xed2c => self.hfsr,
            0xed34 | 0xed38 => self.bfar,
            // One level of separate caches.
            0xed78 => 0x0900_0003,
            0xed7c => 0x8303_c003,
            0xed80 => match self.plain.get(&0xed84) {
                Some(1) => CCSIDR_INSTRUCTION,
                _ => CCSIDR_DATA,
            },
            // Eight regions of the memory protection unit.
            0xed90 => 0x800,
            _ => self.plain.get(&at).copied().unwrap_or(0),
        }
    }

    /// Writes, by the offset from 0xE0000000.
    pub fn write(
        &mut self,
        at: u32,
        value: u32,
        size: u8,
        nvic: &mut Nvic,
        pulse: &Pulse,
    ) -> Asked {
        match at {
            0x1004 => self.cycles_from = pulse.now.get(),
            0xe010 => {
                if self.tick.ctrl & 1 == 0 && value & 1 != 0 {
                    self.tick.loaded = pulse.now.get();
                }
                self.tick.ctrl = value & 7;
            }
            0xe014 => self.tick.load = value & 0xff_ffff,
            0xe018 => {
                self.tick.loaded = pulse.now.get();
                self.tick.flag = false;
            }
            0xe100..0xe500 => nvic.write(at - 0xe000, value, size),
            0xed04 => {
                let asked = |bit: u32| value & 1 << bit != 0;
                if asked(31) {
                    nvic.pend(nvic::NMI);
                }
                for (set, clear, exception) in [(28, 27, nvic::PEND_SV), (26, 25, nvic::SYS_TICK)] {
                    if asked(set) {
                        nvic.pend(exception);
                    } else if asked(clear) {
                        nvic.unpend(exception);
                    }
                }
            }
            0xed08 => self.vtor = value & !0x7f,
            0xed0c if value >> 16 == VECTKEY => {
                self.plain.insert(at, value & 0x700);
                if value & 4 != 0 {
                    return Asked::Reset;
                }
            }
            0xed0c => {}
            0xed18..0xed24 => nvic.set_priorities((at - 0xed18) as usize + 4, value, size),
            0xed28 => self.cfsr &= !value,
            0xed2c => self.hfsr &= !value,
            // The software trigger.
            0xef00 => nvic.write(0x200 + (value & 0x1ff) / 32 * 4, 1 << (value % 32), 4),
            _ => {
                self.plain.insert(at, value);
            }
        }
        Asked::Nothing
    }
}

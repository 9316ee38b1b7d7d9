//! The chip's peripherals, one file each (STM32F75x reference manual, RM0385).

pub mod exti;
pub mod flash;
pub mod fmc;
pub mod gpio;
pub mod i2c;
pub mod iwdg;
pub mod ltdc;
pub mod plain;
pub mod pwr;
pub mod quadspi;
pub mod rcc;
pub mod tim;

use crate::cpu::nvic::Nvic;
use crate::time::NEVER;

/// Memory as a bus master other than the processor sees it.
pub trait Memory {
    /// Reads; false where there is no memory.
    fn read(&self, at: u32, bytes: &mut [u8]) -> bool;
    /// Writes; false where there is no memory.
    fn write(&mut self, at: u32, bytes: &[u8]) -> bool;
}

/// A block of registers.
pub trait Device {
    /// Reads the register at this offset. `size` in bytes matters where a register is a window on a queue.
    fn read(&mut self, at: u32, size: u8, now: u64) -> u32;

    /// Writes the register at this offset.
    fn write(&mut self, at: u32, value: u32, size: u8, now: u64);

    /// When [`Device::advance`] wants to be called next.
    fn next(&self) -> u64 {
        NEVER
    }

    /// Does what is due by now.
    fn advance(&mut self, _now: u64, _memory: &mut dyn Memory) {}

    /// Sets the interrupt lines.
    fn lines(&self, _nvic: &mut Nvic) {}

    /// A reset of the chip.
    fn reset(&mut self);
}

//! External interrupts: edges of pins, and the multiplexer in SYSCFG that says whose.

use super::Device;
use crate::cpu::nvic::Nvic;

const IMR: usize = 0;
const RTSR: usize = 2;
const FTSR: usize = 3;
const SWIER: usize = 4;
const PR: usize = 5;

/// EXTI.
#[derive(Default)]
pub struct Exti {
    registers: [u32; 6],
    /// Which port each of the 16 lines listens to.
    ports: [u8; 16],
}

impl Exti {
    /// A pin changed.
    pub fn edge(&mut self, port: u8, pin: u8, high: bool) {
        let wanted = if high { RTSR } else { FTSR };
        if self.ports[usize::from(pin)] == port && self.registers[wanted] & 1 << pin != 0 {
            self.registers[PR] |= 1 << pin;
        }
    }

    /// A write to SYSCFG's multiplexer.
    pub fn select(&mut self, first: usize, value: u32) {
        for index in 0..4 {
            if let Some(port) = self.ports.get_mut(first + index) {
                *port = (value >> (4 * index) & 0xf) as u8;
            }
        }
    }
}

impl Device for Exti {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        self.registers.get((at / 4) as usize).copied().unwrap_or(0)
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, _now: u64) {
        match (at / 4) as usize {
            PR => {
                self.registers[PR] &= !value;
                self.registers[SWIER] &= !value;
            }
            SWIER => {
                self.registers[PR] |= value & self.registers[IMR] & !self.registers[SWIER];
                self.registers[SWIER] |= value;
            }
            index if index < 6 => self.registers[index] = value,
            _ => {}
        }
    }

    fn lines(&self, nvic: &mut Nvic) {
        let waiting = self.registers[PR] & self.registers[IMR];
        for pin in 0..5 {
            nvic.set_line(6 + pin, waiting & 1 << pin != 0);
        }
        nvic.set_line(23, waiting & 0x03e0 != 0);
        nvic.set_line(40, waiting & 0xfc00 != 0);
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

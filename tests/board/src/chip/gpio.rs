//! Pins.

use super::Device;

const MODER: u32 = 0x00;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;

/// One port of 16 pins.
#[derive(Default)]
pub struct Gpio {
    registers: [u32; 10],
    /// What the board drives its pins to.
    inputs: u16,
}

impl Gpio {
    /// The board drives a pin; true when that changes it.
    pub fn drive(&mut self, pin: u8, high: bool) -> bool {
        let before = self.inputs;
        self.inputs = if high { before | 1 << pin } else { before & !(1 << pin) };
        self.inputs != before
    }

    /// What the chip drives this pin to, when it is an output.
    pub fn output(&self, pin: u8) -> Option<bool> {
        let mode = self.registers[0] >> (2 * pin) & 3;
        (mode == 1).then_some(self.registers[(ODR / 4) as usize] & 1 << pin != 0)
    }
}

impl Device for Gpio {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        match at {
            IDR => {
                let driven = (0..16).filter_map(|pin| Some((pin, self.output(pin)?)));
                driven.fold(u32::from(self.inputs), |word, (pin, high)| {
                    word & !(1 << pin) | u32::from(high) << pin
                })
            }
            BSRR => 0,
            _ => self.registers.get((at / 4) as usize).copied().unwrap_or(0),
        }
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, _now: u64) {
        match at {
            BSRR => {
                let output = &mut self.registers[(ODR / 4) as usize];
                *output = *output & !(value >> 16) | value & 0xffff;
            }
            MODER..IDR | ODR | 0x1c..0x28 => self.registers[(at / 4) as usize] = value,
            _ => {}
        }
    }

    fn reset(&mut self) {
        self.registers = [0; 10];
    }
}

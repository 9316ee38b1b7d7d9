//! FT5336: the touch controller on the panel.

use crate::chip::i2c::Slave;

const ADDRESS: u8 = 0x38;
const CHIP_ID: u8 = 0x51;

/// The chip.
#[derive(Default)]
pub struct Ft5336 {
    /// Where a finger is, in pixels of the screen.
    finger: Option<(u16, u16)>,
    register: u8,
    selecting: bool,
}

impl Ft5336 {
    /// A finger goes down, moves, or is lifted.
    pub fn touch(&mut self, finger: Option<(u16, u16)>) {
        self.finger = finger;
    }

    fn value(&self) -> u8 {
        let touches = u8::from(self.finger.is_some());
        // The panel is mounted turned: what it calls x is the screen's y.
        let (y, x) = self.finger.unwrap_or_default();
        match self.register {
            0x02 => touches,
            // Event "contact" in the upper bits.
            0x03 => (x >> 8) as u8 & 0x0f | if touches > 0 { 0x80 } else { 0x40 },
            0x04 => x as u8,
            0x05 => (y >> 8) as u8 & 0x0f | if touches > 0 { 0 } else { 0xf0 },
            0x06 => y as u8,
            0xa8 => CHIP_ID,
            _ => 0,
        }
    }
}

impl Slave for Ft5336 {
    fn address(&self) -> u8 {
        ADDRESS
    }

    fn start(&mut self, read: bool) {
        self.selecting = !read;
    }

    fn write(&mut self, byte: u8) {
        // The settings that follow the first byte change nothing here.
        if std::mem::take(&mut self.selecting) {
            self.register = byte;
        }
    }

    fn read(&mut self) -> u8 {
        let value = self.value();
        self.register = self.register.wrapping_add(1);
        value
    }
}

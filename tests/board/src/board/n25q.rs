//! N25Q128A: 16 MB of serial flash, of which the power can go in mid-write.

use crate::time::{MS, US};

/// Bytes of the chip.
pub const BYTES: usize = 16 << 20;
const PAGE: usize = 256;
const SUBSECTOR: usize = 4 << 10;
const SECTOR: usize = 64 << 10;
/// Times of the data sheet, typical.
const PROGRAM_PS: u64 = 500 * US;
const ERASE_SUBSECTOR_PS: u64 = 250 * MS;
const ERASE_SECTOR_PS: u64 = 700 * MS;

/// Which way the data of a command goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// None, or unknown.
    None,
    /// To the flash.
    In,
    /// From the flash.
    Out,
}

/// A change that takes its time.
#[derive(Clone, Debug)]
enum Change {
    Program { at: usize, bytes: Vec<u8> },
    Erase { at: usize, length: usize },
}

/// The chip.
pub struct N25q {
    /// What it holds.
    pub cells: Vec<u8>,
    /// The cells have changed since this was last taken.
    pub changed: bool,
    write_enabled: bool,
    volatile: u8,
    enhanced: u8,
    command: u8,
    at: usize,
    page: Vec<u8>,
    working: Option<(Change, u64, u64)>,
    reset_enabled: bool,
    /// Programs and erases that were begun.
    pub changes: u64,
    /// Commands it does not know.
    pub unknown: Vec<u8>,
}

impl Default for N25q {
    fn default() -> Self {
        Self {
            cells: vec![0xff; BYTES],
            changed: true,
            write_enabled: false,
            volatile: 0xfb,
            enhanced: 0xff,
            command: 0,
            at: 0,
            page: Vec::new(),
            working: None,
            reset_enabled: false,
            changes: 0,
            unknown: Vec::new(),
        }
    }
}

impl N25q {
    /// When the change under way is over.
    pub fn ready_at(&self) -> u64 {
        self.working.as_ref().map_or(0, |(_, _, ends)| *ends)
    }

    /// Begins a command.
    pub fn command(&mut self, command: u8, address: u32, now: u64) -> Direction {
        self.settle(now);
        self.command = command;
        self.at = address as usize % BYTES;
        self.page.clear();
        let reset = std::mem::take(&mut self.reset_enabled);
        match command {
            0x9e | 0x9f | 0xaf | 0x5a | 0x05 | 0x70 | 0x85 | 0x65 | 0xb5 | 0x03 | 0x0b | 0x3b
            | 0x6b | 0xbb | 0xeb => {
                if !matches!(
                    command,
                    0x05 | 0x70 | 0x85 | 0x65 | 0xb5 | 0x03 | 0x0b | 0x3b | 0x6b | 0xbb | 0xeb
                ) {
                    self.at = 0;
                }
                Direction::Out
            }
            0x01 | 0x02 | 0x32 | 0x12 | 0xa2 | 0xd2 | 0x81 | 0x61 => Direction::In,
            0x06 | 0x04 | 0x20 | 0xd8 | 0xc7 | 0x50 | 0xb9 | 0xab => Direction::None,
            0x66 => {
                self.reset_enabled = true;
                Direction::None
            }
            0x99 if reset => {
                (self.write_enabled, self.volatile, self.enhanced) = (false, 0xfb, 0xff);
                Direction::None
            }
            _ => {
                if !self.unknown.contains(&command) {
                    self.unknown.push(command);
                }
                Direction::None
            }
        }
    }

    /// Hands out the next byte of a command that reads.
    pub fn read(&mut self, now: u64) -> u8 {
        self.settle(now);
        let busy = self.working.is_some();
        let at = self.at;
        match self.command {
            0x05 => u8::from(busy) | u8::from(self.write_enabled) << 1,
            0x70 => u8::from(!busy) << 7,
            0x85 => self.volatile,
            0x65 => self.enhanced,
            0xb5 => 0xff,
            0x9e | 0x9f | 0xaf => {
                self.at += 1;
                // Micron, N25Q with 3 V, 128 Mbit.
                [0x20, 0xba, 0x18, 0x10].get(at).copied().unwrap_or(0)
            }
            0x5a => 0xff,
            _ if busy => 0xff,
            _ => {
                self.at = (at + 1) % BYTES;
                self.cells[at]
            }
        }
    }

    /// Takes a byte of a command that writes.
    pub fn write(&mut self, byte: u8, _now: u64) {
        self.page.push(byte);
    }

    /// The command is over: what it asks for begins.
    pub fn end(&mut self, now: u64) {
        self.settle(now);
        let command = std::mem::take(&mut self.command);
        let busy = self.working.is_some();
        let aligned = |length: usize| Change::Erase { at: self.at / length * length, length };
        let (change, takes) = match command {
            0x06 => {
                self.write_enabled = true;
                return;
            }
            0x04 => {
                self.write_enabled = false;
                return;
            }
            0x81 | 0x61 if self.write_enabled => {
                let register =
                    if command == 0x81 { &mut self.volatile } else { &mut self.enhanced };
                *register = self.page.first().copied().unwrap_or(*register);
                self.write_enabled = false;
                return;
            }
            0x02 | 0x32 | 0x12 | 0xa2 | 0xd2 => {
                // More than a page wraps within it: the last bytes count.
                let skip = self.page.len().saturating_sub(PAGE);
                let bytes = self.page.split_off(skip);
                (Change::Program { at: self.at + skip, bytes }, PROGRAM_PS)
            }
            0x20 => (aligned(SUBSECTOR), ERASE_SUBSECTOR_PS),
            0xd8 => (aligned(SECTOR), ERASE_SECTOR_PS),
            0xc7 => (Change::Erase { at: 0, length: BYTES }, 170_000 * MS),
            _ => return,
        };
        if self.write_enabled && !busy {
            self.write_enabled = false;
            self.changes += 1;
            self.working = Some((change, now, now + takes));
        }
    }

    /// Carries out a change whose time is over.
    pub fn settle(&mut self, now: u64) {
        if let Some((change, _, _)) = self.working.take_if(|(_, _, ends)| *ends <= now) {
            let whole = match &change {
                Change::Program { bytes, .. } => bytes.len(),
                Change::Erase { length, .. } => *length,
            };
            self.apply(&change, whole);
        }
    }

    /// The power goes: of a change under way as much is done as its time allowed, and the byte at which it stood is
    /// half done.
    pub fn power_off(&mut self, now: u64) {
        self.settle(now);
        if let Some((change, began, ends)) = self.working.take() {
            let length = match &change {
                Change::Program { bytes, .. } => bytes.len(),
                Change::Erase { length, .. } => *length,
            };
            let done = (now - began) as u128 * length as u128 / u128::from(ends - began);
            self.apply(&change, done as usize);
            self.tear(&change, done as usize);
        }
        (self.write_enabled, self.volatile, self.enhanced) = (false, 0xfb, 0xff);
    }

    fn apply(&mut self, change: &Change, count: usize) {
        self.changed = true;
        match change {
            Change::Program { at, bytes } => {
                let first = at / PAGE * PAGE;
                for (index, byte) in bytes.iter().take(count).enumerate() {
                    // Programming only clears bits, and wraps within the page.
                    self.cells[first + (at + index) % PAGE] &= byte;
                }
            }
            Change::Erase { at, .. } => self.cells[*at..at + count].fill(0xff),
        }
    }

    fn tear(&mut self, change: &Change, at: usize) {
        match change {
            Change::Program { at: start, bytes } => {
                if let Some(byte) = bytes.get(at) {
                    let first = start / PAGE * PAGE;
                    self.cells[first + (start + at) % PAGE] &= byte | 0x55;
                }
            }
            Change::Erase { at: start, length } if at < *length => self.cells[start + at] |= 0x55,
            Change::Erase { .. } => {}
        }
    }

    /// The middle of the change under way.
    pub fn middle(&self) -> Option<u64> {
        self.working.as_ref().map(|(_, began, ends)| began + (ends - began) / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(flash: &mut N25q, at: u32, bytes: &[u8], now: u64) {
        flash.command(0x06, 0, now);
        flash.end(now);
        flash.command(0x02, at, now);
        for &byte in bytes {
            flash.write(byte, now);
        }
        flash.end(now);
    }

    fn status(flash: &mut N25q, now: u64) -> u8 {
        flash.command(0x05, 0, now);
        flash.read(now)
    }

    #[test]
    fn programs_within_a_page_and_only_clears_bits() {
        let mut flash = N25q::default();
        program(&mut flash, 0xfe, &[0x0f, 0xf0, 0x33], 0);
        assert_eq!(status(&mut flash, 1), 1);
        assert_eq!(status(&mut flash, PROGRAM_PS), 0);
        assert_eq!((flash.cells[0xfe], flash.cells[0xff], flash.cells[0]), (0x0f, 0xf0, 0x33));
        program(&mut flash, 0xfe, &[0xf0], PROGRAM_PS);
        flash.settle(2 * PROGRAM_PS);
        assert_eq!(flash.cells[0xfe], 0);
    }

    #[test]
    fn without_write_enable_nothing_happens() {
        let mut flash = N25q::default();
        flash.command(0x02, 0, 0);
        flash.write(0, 0);
        flash.end(0);
        flash.settle(u64::MAX);
        assert_eq!((flash.cells[0], flash.changes), (0xff, 0));
    }

    #[test]
    fn power_that_goes_tears_the_write() {
        let mut flash = N25q::default();
        program(&mut flash, 0, &[0; 100], 0);
        flash.power_off(PROGRAM_PS / 2);
        assert_eq!((flash.cells[49], flash.cells[50], flash.cells[51]), (0, 0x55, 0xff));
        assert_eq!(flash.middle(), None);
    }
}

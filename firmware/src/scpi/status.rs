//! The status registers of IEEE 488.2 and SCPI-99, chapter 20.

/// Bits of the standard event status register, `*ESR?`.
pub mod esr {
    /// The device has done all it was told.
    pub const OPERATION_COMPLETE: u8 = 1 << 0;
    /// An answer was lost.
    pub const QUERY: u8 = 1 << 2;
    /// An error of the device itself.
    pub const DEVICE: u8 = 1 << 3;
    /// A command could not be carried out.
    pub const EXECUTION: u8 = 1 << 4;
    /// A command was not understood.
    pub const COMMAND: u8 = 1 << 5;
    /// The device was switched on.
    pub const POWER_ON: u8 = 1 << 7;
}

/// Bits of the status byte, `*STB?`.
pub mod stb {
    /// The error queue holds something.
    pub const ERRORS: u8 = 1 << 2;
    /// An enabled questionable event.
    pub const QUESTIONABLE: u8 = 1 << 3;
    /// An enabled standard event.
    pub const EVENT: u8 = 1 << 5;
    /// Any bit that `*SRE` enables.
    pub const MASTER: u8 = 1 << 6;
    /// An enabled operation event.
    pub const OPERATION: u8 = 1 << 7;
}

/// Bits of `STATus:OPERation`.
pub mod operation {
    /// Events are being measured.
    pub const MEASURING: u16 = 1 << 4;
    /// Events are being recorded.
    pub const RECORDING: u16 = 1 << 8;
    /// At least one rotor is locked.
    pub const LOCKED: u16 = 1 << 9;
}

/// Bits of `STATus:QUEStionable`.
pub mod questionable {
    /// No rotor has a speed (the standard's bit for frequency).
    pub const SPEED: u16 = 1 << 5;
    /// Events were lost within the latest window.
    pub const LOST: u16 = 1 << 9;
    /// No sensor answers.
    pub const SENSOR: u16 = 1 << 10;
    /// A speed lies outside of the limits.
    pub const ALARM: u16 = 1 << 11;
    /// The device has a fault to tell: `SYSTem:FAULt?`.
    pub const FAULT: u16 = 1 << 12;
}

/// Bit 15 of a register is always zero.
const BITS: u16 = 0x7fff;

/// What is so now, what has happened since it was read, and what of that counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    condition: u16,
    event: u16,
    enable: u16,
    positive: u16,
    negative: u16,
}

impl Default for Register {
    fn default() -> Self {
        Self { condition: 0, event: 0, enable: 0, positive: BITS, negative: 0 }
    }
}

impl Register {
    /// Takes in what is so now; what has changed becomes an event, as the filters say.
    pub const fn update(&mut self, condition: u16) {
        let (rose, fell) = (condition & !self.condition, self.condition & !condition);
        self.event |= (rose & self.positive | fell & self.negative) & BITS;
        self.condition = condition & BITS;
    }

    /// What is so now.
    #[must_use]
    pub const fn condition(&self) -> u16 {
        self.condition
    }

    /// What has happened since this was last asked.
    pub const fn take_events(&mut self) -> u16 {
        let event = self.event;
        self.event = 0;
        event
    }

    /// The mask or filter of a command.
    pub const fn mask(&mut self, mask: Mask) -> &mut u16 {
        match mask {
            Mask::Enable => &mut self.enable,
            Mask::Positive => &mut self.positive,
            Mask::Negative => &mut self.negative,
        }
    }

    /// Whether an enabled event has happened.
    #[must_use]
    pub const fn summary(&self) -> bool {
        self.event & self.enable != 0
    }

    /// `STATus:PRESet`: masks and filters as at power-on, events kept.
    pub fn preset(&mut self) {
        *self = Self { condition: self.condition, event: self.event, ..Self::default() };
    }
}

/// What can be written to a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mask {
    /// Events that reach the status byte.
    Enable,
    /// Conditions that become an event when they begin.
    Positive,
    /// Conditions that become an event when they end.
    Negative,
}

/// All registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// Standard events since they were read.
    pub esr: u8,
    /// Standard events that reach the status byte.
    pub ese: u8,
    /// Bits of the status byte that ask for service.
    pub sre: u8,
    /// `STATus:OPERation`.
    pub operation: Register,
    /// `STATus:QUEStionable`.
    pub questionable: Register,
}

impl Status {
    /// As after power-on.
    #[must_use]
    pub fn power_on() -> Self {
        Self {
            esr: esr::POWER_ON,
            ese: 0,
            sre: 0,
            operation: Register::default(),
            questionable: Register::default(),
        }
    }

    /// The status byte, from the error queue and the registers. Its bit for an answer that waits is never set: a line is
    /// worked on only when the answer before has been handed out.
    #[must_use]
    pub const fn byte(&self, errors: bool) -> u8 {
        let mut byte = 0;
        if errors {
            byte |= stb::ERRORS;
        }
        if self.questionable.summary() {
            byte |= stb::QUESTIONABLE;
        }
        if self.esr & self.ese != 0 {
            byte |= stb::EVENT;
        }
        if self.operation.summary() {
            byte |= stb::OPERATION;
        }
        if byte & self.sre != 0 {
            byte |= stb::MASTER;
        }
        byte
    }

    /// `*CLS`: forgets every event; masks stay.
    pub const fn clear(&mut self) {
        self.esr = 0;
        self.operation.take_events();
        self.questionable.take_events();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_choose_which_changes_are_events() {
        let mut register = Register::default();
        *register.mask(Mask::Negative) = 2;
        *register.mask(Mask::Positive) = 1;
        register.update(3);
        assert_eq!((register.condition(), register.take_events()), (3, 1));
        register.update(0);
        assert_eq!((register.condition(), register.take_events()), (0, 2));
        register.update(0xffff);
        assert_eq!(register.condition(), 0x7fff, "bit 15 is never set");
    }

    #[test]
    fn events_reach_the_status_byte_when_enabled() {
        let mut status = Status::power_on();
        assert_eq!(status.byte(false), 0, "nothing is enabled");
        status.ese = esr::POWER_ON;
        status.sre = stb::EVENT;
        assert_eq!(status.byte(true), stb::ERRORS | stb::EVENT | stb::MASTER);
        status.questionable.update(questionable::SPEED);
        assert_eq!(status.byte(false), stb::EVENT | stb::MASTER);
        *status.questionable.mask(Mask::Enable) = questionable::SPEED;
        assert_eq!(status.byte(false), stb::EVENT | stb::MASTER | stb::QUESTIONABLE);
        status.clear();
        assert_eq!(status.byte(false), 0);
    }
}

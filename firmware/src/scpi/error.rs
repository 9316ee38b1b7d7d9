//! Errors by their standard numbers, and the queue that `SYSTem:ERRor?` reads.

use core::fmt;

use heapless::Deque;

use super::status::esr;

/// Errors kept until they are read; one more, and the last says so.
pub const ERRORS: usize = 16;

/// Defines the errors that occur here: number and text of SCPI-99, chapter 21.8, and what to do.
macro_rules! errors {
    ($($(#[$doc:meta])* $name:ident = $number:literal, $text:literal, $advice:literal;)+) => {
        /// What can be wrong with a command, or with the device.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum ErrorCode { $($(#[$doc])* $name,)+ }

        impl ErrorCode {
            /// Every error that occurs.
            pub const ALL: &[Self] = &[$(Self::$name,)+];

            /// The standard's number.
            #[must_use]
            pub const fn number(self) -> i32 {
                match self { $(Self::$name => $number,)+ }
            }

            /// The standard's words.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $(Self::$name => $text,)+ }
            }

            /// What to do about it.
            #[must_use]
            pub const fn advice(self) -> &'static str {
                match self { $(Self::$name => $advice,)+ }
            }
        }
    };
}

errors! {
    /// A byte that no command holds.
    InvalidCharacter = -101, "Invalid character", "send plain ASCII";
    /// The command is not put together as the standard says.
    Syntax = -102, "Syntax error", "write HEADer or HEADer?, a blank, then parameters with commas";
    /// A word where a number belongs, or the like.
    DataType = -104, "Data type error", "see the command's parameters in scpi.md";
    /// One parameter too many.
    ParameterNotAllowed = -108, "Parameter not allowed", "leave out what follows";
    /// One parameter too few.
    MissingParameter = -109, "Missing parameter", "see the command's parameters in scpi.md";
    /// A header longer than any command.
    MnemonicTooLong = -112, "Program mnemonic too long", "see the commands in scpi.md";
    /// No such command, or not as a query, or only as a query.
    UndefinedHeader = -113, "Undefined header", "SYSTem:HELP:HEADers? lists the commands";
    /// A number behind a keyword of which there is one only.
    HeaderSuffix = -114, "Header suffix out of range", "leave the number out, or write 1";
    /// Not a number.
    NumericData = -120, "Numeric data error", "write for example 1500, 1.5E3 or #H5DC";
    /// A unit that this parameter does not know.
    InvalidSuffix = -131, "Invalid suffix", "see the command's units in scpi.md";
    /// A word that this parameter does not know.
    InvalidCharacterData = -141, "Invalid character data", "see the command's words in scpi.md";
    /// A quote is missing.
    InvalidString = -151, "Invalid string data", "close the quote";
    /// No command takes a block.
    BlockNotAllowed = -168, "Block data not allowed", "send a number or a word";
    /// The device is not in the state that the command needs.
    SettingsConflict = -221, "Settings conflict", "see the command's conditions in scpi.md";
    /// A number beyond its range.
    DataOutOfRange = -222, "Data out of range", "see the command's range in scpi.md";
    /// There is nothing to answer with yet.
    Stale = -230, "Data corrupt or stale", "record first";
    /// The memory of the recorder failed.
    Hardware = -240, "Hardware error", "record again; restart the device if it stays";
    /// This board has no memory for recordings.
    HardwareMissing = -241, "Hardware missing", "use a board with external memory";
    /// The device stopped itself some time before this start.
    System = -310, "System error", "SYSTem:FAULt? tells what happened";
    /// The stored preferences could not be read.
    MemoryLost = -314, "Save/recall memory lost", "set units, limits, blades and clock again";
    /// An answer longer than the buffer.
    OutOfMemory = -321, "Out of memory", "ask for less at a time";
    /// More errors than the queue holds.
    QueueOverflow = -350, "Queue overflow", "read errors more often";
    /// A line longer than the buffer.
    InputOverrun = -363, "Input buffer overrun", "send lines of at most 256 bytes";
}

impl ErrorCode {
    /// The bit of the standard event status register that its class sets.
    #[must_use]
    pub const fn event(self) -> u8 {
        match self.number() {
            -199..=-100 => esr::COMMAND,
            -299..=-200 => esr::EXECUTION,
            -499..=-400 => esr::QUERY,
            _ => esr::DEVICE,
        }
    }
}

/// An error and where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScpiError {
    /// What is wrong.
    pub code: ErrorCode,
    /// Byte of the line, from 1; `None` where no line is to blame.
    pub byte: Option<u16>,
}

impl ScpiError {
    /// An error at a byte of the line, counted from 0.
    #[must_use]
    pub fn at(code: ErrorCode, offset: usize) -> Self {
        Self { code, byte: u16::try_from(offset + 1).ok() }
    }
}

/// As `SYSTem:ERRor?` answers: number, then in quotes the text, the place, and what to do.
impl fmt::Display for ScpiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (number, text, advice) = (self.code.number(), self.code.text(), self.code.advice());
        match self.byte {
            Some(byte) => write!(f, "{number},\"{text};byte {byte}: {advice}\""),
            None => write!(f, "{number},\"{text};{advice}\""),
        }
    }
}

/// Errors in the order in which they came.
#[derive(Clone, Debug, Default)]
pub struct ErrorQueue(Deque<ScpiError, ERRORS>);

impl ErrorQueue {
    /// No error yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Deque::new())
    }

    /// Keeps an error; where there is no room, the latest gives way to -350.
    pub fn push(&mut self, error: ScpiError) {
        if self.0.push_back(error).is_err()
            && let Some(last) = self.0.back_mut()
        {
            *last = ScpiError { code: ErrorCode::QueueOverflow, byte: None };
        }
    }

    /// The oldest error.
    pub fn pop(&mut self) -> Option<ScpiError> {
        self.0.pop_front()
    }

    /// Errors that wait.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether none waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use std::format;

    use super::*;

    #[test]
    fn the_queue_says_that_it_ran_over() {
        let mut queue = ErrorQueue::new();
        for offset in 0..40 {
            queue.push(ScpiError::at(ErrorCode::Syntax, offset));
        }
        assert_eq!(queue.len(), ERRORS);
        for offset in 0..ERRORS - 1 {
            assert_eq!(queue.pop(), Some(ScpiError::at(ErrorCode::Syntax, offset)));
        }
        assert_eq!(queue.pop(), Some(ScpiError { code: ErrorCode::QueueOverflow, byte: None }));
        assert_eq!(queue.pop(), None);
    }

    #[test]
    fn every_error_fits_the_standard() {
        for (index, &code) in ErrorCode::ALL.iter().enumerate() {
            let text = format!("{}", ScpiError::at(code, 999));
            // SCPI-99, 21.8.1: at most 255 characters; quotes within would have to be doubled.
            assert!(text.len() < 255 && text.matches('"').count() == 2, "{text}");
            let numbers = ErrorCode::ALL[..index].iter().map(|other| other.number());
            assert!(numbers.clone().all(|number| number > code.number()), "{text}: order");
        }
        assert_eq!(ErrorCode::UndefinedHeader.event(), esr::COMMAND);
        assert_eq!(ErrorCode::DataOutOfRange.event(), esr::EXECUTION);
        assert_eq!(ErrorCode::InputOverrun.event(), esr::DEVICE);
    }
}

//! An event on its way from its pixel to the recording, and which rotor caused it.

use evtach_core::{Event, Polarity};

/// One event in one word, so that tens of millions fit. Words are ordered as a recording is: by time, then row, column, polarity;
/// equal stamps come out in one order whatever made them.
///
/// Bits from the highest: 33 of time in microseconds, 11 of the row, 11 of the column, 1 of polarity, 8 of the rotor's number from 1
/// on, 0 = none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Made(u64);

const TIME_SHIFT: u32 = 31;
const ROW_SHIFT: u32 = 20;
const COLUMN_SHIFT: u32 = 9;
const POLARITY_SHIFT: u32 = 8;
const SIDE_MASK: u64 = (1 << 11) - 1;
const ROTOR_MASK: u64 = (1 << 8) - 1;

impl Made {
    /// An event that a rotor caused, or something else.
    #[must_use]
    pub fn new(event: Event, rotor: Option<usize>) -> Self {
        let rotor = rotor.map_or(0, |number| (number as u64 + 1).min(ROTOR_MASK));
        let on = u64::from(event.polarity == Polarity::On);
        Self(
            event.t_us << TIME_SHIFT
                | u64::from(event.y) << ROW_SHIFT
                | u64::from(event.x) << COLUMN_SHIFT
                | on << POLARITY_SHIFT
                | rotor,
        )
    }

    /// When it happened, or was read.
    #[must_use]
    pub const fn t_us(self) -> u64 {
        self.0 >> TIME_SHIFT
    }

    /// The same, read at another time.
    #[must_use]
    pub const fn at(self, t_us: u64) -> Self {
        Self(t_us << TIME_SHIFT | self.0 & ((1 << TIME_SHIFT) - 1))
    }

    /// Number of the rotor that caused it.
    #[must_use]
    pub fn rotor(self) -> Option<usize> {
        (self.0 & ROTOR_MASK).checked_sub(1).map(|number| number as usize)
    }

    /// What the recording holds of it.
    #[must_use]
    pub const fn event(self) -> Event {
        let on = self.0 >> POLARITY_SHIFT & 1 == 1;
        Event {
            t_us: self.t_us(),
            x: (self.0 >> COLUMN_SHIFT & SIDE_MASK) as u16,
            y: (self.0 >> ROW_SHIFT & SIDE_MASK) as u16,
            polarity: if on { Polarity::On } else { Polarity::Off },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_holds_all_of_an_event_and_is_ordered_by_time_first() {
        let event = |t_us, x, y, polarity| Event { t_us, x, y, polarity };
        let last = event(60_000_000, 2047, 2047, Polarity::On);
        for (event, rotor) in [
            (event(0, 0, 0, Polarity::Off), None),
            (event(7, 2047, 0, Polarity::Off), Some(0)),
            (event(7, 0, 1, Polarity::On), Some(3)),
            (last, Some(7)),
        ] {
            let made = Made::new(event, rotor);
            assert_eq!((made.event(), made.rotor(), made.t_us()), (event, rotor, event.t_us));
            assert!(made <= Made::new(last, Some(7)));
            assert_eq!(made.at(9).event(), Event { t_us: 9, ..event });
        }
    }
}

//! One order for events of the same microsecond.

use evtach_core::Event;

/// Most events held back: more of one stamp are no ties but a clock that stands still.
const MOST_HELD: usize = 65_536;

/// Brings events of the same microsecond into the order of row, column and polarity.
///
/// Formats and tools keep them in any order, and which of them are registered with each other must not depend on it. With the
/// device's memory they stay as they are: the device takes them as the camera sends them, and is to be followed to the bit.
#[derive(Debug, Default)]
pub struct Ties {
    held: Vec<Event>,
}

impl Ties {
    /// Orders the next events of a stream. The last of them are held back, up to the next call, while there may be `more` of their
    /// microsecond.
    pub fn order(&mut self, events: &mut Vec<Event>, more: bool) {
        if !self.held.is_empty() {
            self.held.append(events);
            std::mem::swap(&mut self.held, events);
        }
        if let Some(last) = events.last().filter(|_| more) {
            let tied = events.iter().rev().take_while(|event| event.t_us == last.t_us).count();
            if tied < MOST_HELD {
                self.held.extend(events.drain(events.len() - tied..));
            }
        }
        for tied in events.chunk_by_mut(|a, b| a.t_us == b.t_us) {
            if tied.len() > 1 {
                tied.sort_unstable_by_key(|event| (event.y, event.x, event.polarity));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::Polarity;

    use super::*;

    #[test]
    fn pieces_come_out_as_the_whole_would() {
        let event = |i: u64| {
            let polarity = if i.is_multiple_of(3) { Polarity::On } else { Polarity::Off };
            Event { t_us: i / 5, x: (i * 7 % 4) as u16, y: (i * 5 % 3) as u16, polarity }
        };
        let events: Vec<Event> = (0..1000).map(event).collect();
        let mut sorted = events.clone();
        sorted.sort_by_key(|e| (e.t_us, e.y, e.x, e.polarity));
        for piece_events in [1, 3, 64, 999, 1000] {
            let (mut ties, mut ordered) = (Ties::default(), Vec::new());
            let pieces = events.chunks(piece_events).map(<[Event]>::to_vec);
            for mut piece in pieces {
                ties.order(&mut piece, true);
                ordered.append(&mut piece);
            }
            let mut rest = Vec::new();
            ties.order(&mut rest, false);
            ordered.append(&mut rest);
            assert_eq!(ordered, sorted, "{piece_events}");
        }
    }

    #[test]
    fn a_clock_that_stands_still_holds_back_no_more_than_it_must() {
        let event = Event { t_us: 7, x: 1, y: 2, polarity: Polarity::On };
        let (mut ties, mut passed) = (Ties::default(), 0);
        for _ in 0..20 {
            let mut piece = vec![event; 10_000];
            ties.order(&mut piece, true);
            passed += piece.len();
        }
        assert!(ties.held.len() < MOST_HELD && passed + ties.held.len() == 200_000);
    }
}

//! How long after the first event an event came, as people state a part of a recording.

use std::slice;

use evtach_core::{CLOCK_RESET_US, Event};

use super::Timeline;

/// Tells the time since the first event, which runs on where the clock is set back, as a [`Timeline`] lays the parts.
///
/// A few wrong times ahead of the right ones are no other clock: what follows them goes on from where it was.
#[derive(Debug, Default)]
pub struct Since {
    timeline: Timeline,
    first_us: Option<u64>,
    last_us: u64,
    /// The timeline before the clock leapt ahead, and how many events came since.
    before_leap: Option<(Timeline, u64)>,
}

impl Since {
    /// So many events behind a leap are no wrong times among right ones.
    pub(crate) const MOST_WRONG: u64 = 65_536;

    /// Says that what comes next is another recording.
    pub const fn start_anew(&mut self) {
        self.timeline.start_anew();
        self.before_leap = None;
    }

    /// Microseconds from the first event to the next one; 0 where its time lies before.
    pub fn of(&mut self, event: &Event) -> u64 {
        let first_us = *self.first_us.get_or_insert_with(|| {
            self.last_us = event.t_us;
            event.t_us
        });
        if event.t_us.saturating_sub(self.last_us) >= CLOCK_RESET_US {
            self.before_leap = Some((self.timeline, 0));
        }
        self.last_us = event.t_us;
        let event_alone = slice::from_ref(event);
        if self.timeline.part(event_alone) == 0 {
            let goes_on = |before: &Timeline| {
                let mut tried = *before;
                tried.part(event_alone) > 0
            };
            let before = self.before_leap.take().map(|(before, _)| before);
            self.timeline = before.filter(goes_on).unwrap_or(self.timeline);
            if self.timeline.part(event_alone) == 0 {
                self.timeline.set_back_to(event.t_us);
                self.timeline.part(event_alone);
            }
        }
        self.before_leap = self
            .before_leap
            .map(|(before, events)| (before, events + 1))
            .filter(|(_, events)| *events <= Self::MOST_WRONG);
        self.timeline.at(event.t_us).saturating_sub(first_us)
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::Polarity;

    use super::*;

    const S: u64 = 1_000_000;

    fn since(since: &mut Since, t_us: u64) -> u64 {
        since.of(&Event { t_us, x: 0, y: 0, polarity: Polarity::On })
    }

    #[test]
    fn time_runs_on_where_the_clock_is_set_back() {
        let mut count = Since::default();
        let times_us = [7 * S, 8 * S, 8 * S - 10, 9 * S, 3 * S, 3 * S + 5];
        let found = times_us.map(|t_us| since(&mut count, t_us));
        assert_eq!(found, [0, S, S - 10, 2 * S, 2 * S, 2 * S + 5]);
        // Another recording's clock is another one, however near.
        count.start_anew();
        assert_eq!([3 * S, 3 * S + 5].map(|t_us| since(&mut count, t_us)), [2 * S + 5, 2 * S + 10]);
    }

    #[test]
    fn a_wrong_time_is_no_other_clock() {
        let mut count = Since::default();
        let found = [S, S + 5, 10_000 * S, S + 10, S + 15].map(|t_us| since(&mut count, t_us));
        assert_eq!(found, [0, 5, 9_999 * S, 10, 15]);
        // What goes on there is.
        since(&mut count, 10_000 * S);
        (0..Since::MOST_WRONG).for_each(|i| _ = since(&mut count, 10_000 * S + i));
        let end_us = 9_999 * S + Since::MOST_WRONG - 1;
        assert_eq!([S, S + 5].map(|t_us| since(&mut count, t_us)), [end_us, end_us + 5]);
    }
}

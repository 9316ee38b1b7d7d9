//! One time for a stream whose clock is set back.

use evtach_core::{CLOCK_RESET_US, Event, GyroSample, Reading};

/// Lays the parts of a stream end to end: where its clock is set back, the tachometer begins anew, and what follows would seem to
/// lie before, or within, what came.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timeline {
    /// What is added to the clock's time in this part.
    shift_us: u64,
    /// Latest time of the clock in this part.
    latest_us: Option<u64>,
    /// Whether what comes next is of another clock, wherever its times lie.
    starts_anew: bool,
    /// Where it was set back first, and by how much.
    first: Option<(u64, u64)>,
    events: u64,
    set_back: u64,
    /// The clock leapt ahead, and may yet come back.
    leap: Option<Leap>,
    /// Where the first wrong time was, and by how much; and how many there were.
    first_wrong: Option<(u64, u64)>,
    wrong: u64,
}

/// Where the clock leaps ahead: a pause, or a time that is wrong.
#[derive(Clone, Copy, Debug)]
struct Leap {
    /// Latest time of the clock before it.
    before_us: u64,
    /// Events since.
    events: u64,
}

impl Leap {
    /// So many events, and no more, are wrong times where the clock then goes on from where it was: fewer than any speed is measured of.
    const MOST_WRONG: u64 = 100;

    /// Whether the clock goes on from where it was.
    const fn was_wrong(&self, t_us: u64) -> bool {
        self.before_us.abs_diff(t_us) < CLOCK_RESET_US
    }
}

impl Timeline {
    /// How many of the next events come before the clock is set back: none where it is now.
    pub fn part(&mut self, events: &[Event]) -> usize {
        if self.starts_anew && self.latest_us.is_some() && !events.is_empty() {
            return 0;
        }
        // Where nothing came before, there is no border.
        self.starts_anew &= events.is_empty();
        for (at, event) in events.iter().enumerate() {
            let latest_us = self.latest_us.unwrap_or(event.t_us);
            if latest_us.saturating_sub(event.t_us) >= CLOCK_RESET_US {
                return at;
            }
            if event.t_us.saturating_sub(latest_us) >= CLOCK_RESET_US {
                self.leap.get_or_insert(Leap { before_us: latest_us, events: 0 });
            }
            if let Some(leap) = &mut self.leap {
                leap.events += 1;
                self.leap = self.leap.filter(|leap| leap.events <= Leap::MOST_WRONG);
            }
            self.latest_us = Some(latest_us.max(event.t_us));
            self.events += 1;
        }
        events.len()
    }

    /// Says that what comes next is another recording, which is a part of its own however near its clock is.
    pub const fn start_anew(&mut self) {
        self.starts_anew = true;
        self.leap = None;
    }

    /// Whether what comes next is another recording.
    #[must_use]
    pub const fn starts_anew(&self) -> bool {
        self.starts_anew
    }

    /// Begins the next part: the clock was set back to the time of its first event, or comes back to where it was before a few wrong
    /// times, from where it then goes on. Tells whether by so little that the tachometer, which is told of it by the times alone, would
    /// take it for disorder.
    pub fn set_back_to(&mut self, t_us: u64) -> bool {
        self.starts_anew = false;
        if let Some(leap) = self.leap.take().filter(|leap| leap.was_wrong(t_us)) {
            let ahead_us = self.latest_us.unwrap_or(t_us).saturating_sub(leap.before_us);
            self.first_wrong.get_or_insert((self.events - leap.events, ahead_us));
            self.wrong += leap.events;
            self.latest_us = Some(leap.before_us);
            return false;
        }
        let by_us = self.latest_us.unwrap_or(t_us).saturating_sub(t_us);
        self.shift_us = self.shift_us.saturating_add(by_us);
        self.latest_us = Some(t_us);
        // Another recording's clock may be ahead, too.
        if by_us > 0 {
            self.first.get_or_insert((self.events, by_us));
            self.set_back += 1;
        }
        by_us < CLOCK_RESET_US
    }

    /// Whether what the clock told beside the events belongs to this part: behind the border there may come some of the part before,
    /// whose clock was ahead by more than half of the least step back.
    #[must_use]
    pub fn is_of_part(&self, t_us: u64) -> bool {
        let ahead_us = t_us.saturating_sub(self.latest_us.unwrap_or(t_us));
        !self.is_set_back() || ahead_us < CLOCK_RESET_US / 2
    }

    /// How many of the next samples of a gyro, behind one of the time `before_us`, come before their own times are set back.
    #[must_use]
    pub fn samples_of_part(mut before_us: u64, samples: &[GyroSample]) -> usize {
        let goes_back = |sample: &GyroSample| {
            let back_us = before_us.saturating_sub(sample.t_us);
            before_us = before_us.max(sample.t_us);
            back_us >= CLOCK_RESET_US / 2
        };
        samples.iter().position(goes_back).unwrap_or(samples.len())
    }

    /// Hands out events with their times laid end to end.
    pub fn lay(&mut self, events: &[Event], mut each: impl FnMut(&Event)) {
        let mut rest = events;
        while let Some(first) = rest.first() {
            let length = self.part(rest);
            if length == 0 {
                self.set_back_to(first.t_us);
            }
            rest[..length].iter().for_each(|event| each(&self.laid_event(event)));
            rest = &rest[length..];
        }
    }

    /// An event of this part.
    #[must_use]
    pub const fn laid_event(&self, event: &Event) -> Event {
        Event { t_us: self.at(event.t_us), ..*event }
    }

    /// When something of this part was, in microseconds.
    #[must_use]
    pub const fn at(&self, t_us: u64) -> u64 {
        t_us.saturating_add(self.shift_us)
    }

    /// A reading of this part.
    #[must_use]
    pub fn laid(&self, reading: Reading) -> Reading {
        Reading { t_us: self.at(reading.t_us), ..reading }
    }

    /// Whether the clock was set back.
    #[must_use]
    pub const fn is_set_back(&self) -> bool {
        self.set_back > 0
    }

    /// Which times were wrong, where some were.
    #[must_use]
    pub fn wrong_times(&self) -> Option<String> {
        let (before, ahead_us) = self.first_wrong?;
        let (wrong, ahead_s) = (self.wrong, ahead_us as f64 * 1e-6);
        Some(format!(
            "{wrong} events have a wrong time, far ahead of the rest, the first behind event {before} by {ahead_s:.3} s; the rest goes on from where it was"
        ))
    }

    /// Where the clock was set back, and how often.
    #[must_use]
    pub fn note(&self) -> String {
        let (events, by_us) = self.first.unwrap_or_default();
        let times = match self.set_back {
            0 | 1 => String::new(),
            more => format!(", the first of {more} times"),
        };
        let by_s = by_us as f64 * 1e-6;
        format!("behind event {events} the clock is set back by {by_s:.3} s{times}")
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::Polarity;

    use super::*;

    #[test]
    fn parts_lie_end_to_end_however_they_come() {
        const S: u64 = 1_000_000;
        // Half a second back is disorder, a second is another clock.
        let times_us = [5 * S, 7 * S, 7 * S - S / 2, 6 * S, 6 * S + 10, 0, 20];
        let events = times_us.map(|t_us| Event { t_us, x: 0, y: 0, polarity: Polarity::On });
        let laid_us = [5 * S, 7 * S, 7 * S - S / 2, 7 * S, 7 * S + 10, 7 * S + 10, 7 * S + 30];
        for at_once in [1, 2, 3, 7] {
            let (mut timeline, mut laid) = (Timeline::default(), Vec::new());
            for mut rest in events.chunks(at_once) {
                while !rest.is_empty() {
                    let part = timeline.part(rest);
                    if part == 0 {
                        timeline.set_back_to(rest[0].t_us);
                    }
                    laid.extend(rest[..part].iter().map(|event| timeline.at(event.t_us)));
                    rest = &rest[part..];
                }
            }
            assert_eq!(laid, laid_us, "{at_once}");
            assert_eq!((timeline.first, timeline.set_back), (Some((3, S)), 2));
        }
    }

    #[test]
    fn what_comes_behind_a_wrong_time_goes_on_from_where_it_was() {
        const S: u64 = 1_000_000;
        let event = |t_us| Event { t_us, x: 0, y: 0, polarity: Polarity::On };
        let right: Vec<Event> = (0..1000).map(|i| event(S + i)).collect();
        for (wrong, is_wrong) in
            [(1, true), (Leap::MOST_WRONG, true), (1 + Leap::MOST_WRONG, false)]
        {
            let ahead = (0..wrong).map(|i| event(9000 * S + i));
            let events: Vec<Event> = right[..500]
                .iter()
                .copied()
                .chain(ahead)
                .chain(right[500..].iter().copied())
                .collect();
            for at_once in [1, 7, 2000] {
                let (mut timeline, mut laid) = (Timeline::default(), Vec::new());
                events.chunks(at_once).for_each(|piece| timeline.lay(piece, |e| laid.push(*e)));
                assert_eq!((laid.len(), timeline.is_set_back()), (events.len(), !is_wrong));
                assert_eq!(
                    laid[laid.len() - 500..] == right[500..],
                    is_wrong,
                    "{wrong}, {at_once}"
                );
                let told = format!(
                    "{wrong} events have a wrong time, far ahead of the rest, the first behind event 500 by 8999.000 s"
                );
                let note = timeline.wrong_times();
                assert_eq!(note.is_some_and(|note| note.starts_with(&told[..60])), is_wrong);
            }
        }
        // A pause that ends with the clock set back is none, nor is the clock of another recording.
        for (last_us, starts_anew) in [(7 * S, false), (S, true)] {
            let mut timeline = Timeline::default();
            timeline.lay(&[event(S), event(9 * S)], |_| ());
            if starts_anew {
                timeline.start_anew();
            }
            timeline.lay(&[event(last_us)], |laid| assert_eq!(laid.t_us, 9 * S));
            assert!(timeline.is_set_back());
        }
    }

    #[test]
    fn another_recording_is_a_part_of_its_own_wherever_its_clock_is() {
        let event = |t_us| Event { t_us, x: 0, y: 0, polarity: Polarity::On };
        for (next_us, laid_us, is_set_back) in [(100, 600, true), (700, 700, false)] {
            let (mut timeline, mut laid) = (Timeline::default(), Vec::new());
            // Nothing comes before the first one.
            timeline.start_anew();
            assert_eq!(timeline.part(&[event(500)]), 1);
            timeline.lay(&[event(600)], |_| ());
            timeline.start_anew();
            assert_eq!(timeline.part(&[event(next_us)]), 0);
            timeline.lay(&[event(next_us)], |event| laid.push(event.t_us));
            assert_eq!((laid, timeline.is_set_back()), (vec![laid_us], is_set_back));
        }
    }
}

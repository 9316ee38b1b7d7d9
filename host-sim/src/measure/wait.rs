//! Events that wait for what the gyro told at their time.

use evtach_core::{Event, GyroSample};

/// Longest that they wait: recorders write samples some ten milliseconds behind the events of their time.
pub const LONGEST_US: u64 = 100_000;

/// Holds events back until a sample of their time has come, so that no window is measured before the camera's roll in it is known.
#[derive(Default)]
pub struct Wait {
    held: Vec<Event>,
    /// Time of the latest sample.
    told_us: u64,
}

impl Wait {
    /// Takes in events and all samples that came with them, and leaves the events that need not wait. All are left when no `more`
    /// will come.
    pub fn hold(&mut self, events: &mut Vec<Event>, samples: &[GyroSample], more: bool) {
        self.held.append(events);
        self.told_us = samples.iter().map(|sample| sample.t_us).fold(self.told_us, u64::max);
        let latest_us = self.held.last().map_or(0, |event| event.t_us);
        let until_us = self.told_us.max(latest_us.saturating_sub(LONGEST_US));
        let ready = if more {
            // Times may step back.
            self.held.iter().rposition(|event| event.t_us <= until_us).map_or(0, |last| last + 1)
        } else {
            self.held.len()
        };
        events.extend(self.held.drain(..ready));
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::Polarity;

    use super::*;

    #[test]
    fn events_wait_for_the_samples_of_their_time_but_not_for_ever() {
        let mut wait = Wait::default();
        let mut after = |times_us: &[u64], sample_us: Option<u64>, more: bool| {
            let event = |&t_us| Event { t_us, x: 0, y: 0, polarity: Polarity::On };
            let mut events: Vec<Event> = times_us.iter().map(event).collect();
            let sample = sample_us.map(|t_us| GyroSample { t_us, roll_rad_s: 0.0 });
            wait.hold(&mut events, sample.as_slice(), more);
            events.iter().map(|event| event.t_us).collect::<Vec<_>>()
        };
        assert!(after(&[10, 20, 30], None, true).is_empty());
        assert_eq!(after(&[40, 35], Some(25), true), [10, 20]);
        assert_eq!(after(&[], Some(35), true), [30, 40, 35]);
        assert_eq!(after(&[50, 100_045, 100_060], None, true), [50]);
        assert_eq!(after(&[100_070], None, false), [100_045, 100_060, 100_070]);
    }
}

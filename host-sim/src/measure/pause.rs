//! Pauses that are longer than any window.

use evtach_core::tachometer::LONGEST_WINDOW_US;
use evtach_core::{Event, Roi};

/// Finds where nothing came for longer than any window: behind such a pause the tachometer begins anew, and forgets a window that is not
/// full.
#[derive(Debug)]
pub struct Pauses {
    /// What lies outside of it is nothing to the tachometer.
    roi: Option<Roi>,
    latest_us: Option<u64>,
}

impl Pauses {
    pub const fn within(roi: Option<Roi>) -> Self {
        Self { roi, latest_us: None }
    }

    /// How many of the next events come before a pause: none where it was before the first of them. The rest come behind it.
    pub fn before(&mut self, events: &[Event]) -> usize {
        let is_inside = |event: &Event| self.roi.is_none_or(|roi| roi.contains(event.x, event.y));
        for (at, event) in events.iter().enumerate().filter(|(_, event)| is_inside(event)) {
            let latest_us = self.latest_us.unwrap_or(event.t_us);
            self.latest_us = Some(latest_us.max(event.t_us));
            if event.t_us.saturating_sub(latest_us) > u64::from(LONGEST_WINDOW_US) {
                return at;
            }
        }
        events.len()
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::Polarity;

    use super::*;

    #[test]
    fn a_pause_is_found_wherever_the_pieces_end() {
        const S: u64 = 1_000_000;
        let roi = Roi { x: 0, y: 0, width_px: 10, height_px: 10 };
        let event = |(t_us, x)| Event { t_us, x, y: 0, polarity: Polarity::On };
        // Two seconds are none; a step back is none; what goes on beside the region is no end of one.
        let events =
            [(0, 5), (2 * S, 5), (2 * S - 1, 5), (3 * S, 20), (5 * S, 5), (5 * S, 5), (8 * S, 5)]
                .map(event);
        for (roi, expected) in [(None, vec![6]), (Some(roi), vec![4, 6])] {
            for at_once in 1..=events.len() {
                let (mut pauses, mut found, mut taken) = (Pauses::within(roi), Vec::new(), 0);
                for mut rest in events.chunks(at_once) {
                    while !rest.is_empty() {
                        let length = pauses.before(rest);
                        taken += length;
                        rest = &rest[length..];
                        found.extend((!rest.is_empty()).then_some(taken));
                    }
                }
                assert_eq!(found, expected, "{at_once}");
            }
        }
    }
}

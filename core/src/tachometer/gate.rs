//! The gate that every event passes: in time, and in view.
//!
//! Nearly every event is later than the one before, earlier than the end of the open segment, and in view. That is
//! all that is asked here, of many at once; what else an event may be is told elsewhere, one by one.

use crate::event::{Geometry, PackedEvent};
use crate::settings::{Roi, Settings};

/// Bits above row and column of a packed event, which a sum carries into.
const ABOVE: u32 = 1 << PackedEvent::COLUMN_AT | 1 << (2 * PackedEvent::COLUMN_AT);

/// Last column or row that a packed event holds.
const LAST_SIDE: u16 = PackedEvent::SIDE_MASK as u16;

/// Events that share their questions.
const SHARED: usize = 8;

/// A power of two: steps below it add up without overflow, [`SHARED`] at a time.
const FAR_US: u32 = 1 << 27;

/// What an event must be to pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    /// Low 32 bits of the time of the last event that passed.
    low_us: u32,
    /// How much later than that the next must not be.
    left_us: u32,
    /// What may be added to the last column and row in view, as a packed event has them, without a carry.
    room: u32,
    /// First column and row in view, where these are not zero.
    first: Option<(u16, u16)>,
    sensor: Geometry,
}

/// Where a pixel lies that is not in view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outside {
    /// Off the sensor.
    Sensor,
    /// Outside the region of interest.
    Roi,
}

impl Gate {
    /// A gate for events from `last_us` on and before `end_us`, both in microseconds; `None` when nothing is in view.
    pub fn new(settings: &Settings, last_us: u64, end_us: u64) -> Option<Self> {
        let sensor = settings.geometry;
        let Roi { x, y, width_px, height_px } = settings.view();
        let word = |x: u16, y: u16| u32::from(x) << PackedEvent::COLUMN_AT | u32::from(y);
        (width_px > 0 && height_px > 0).then(|| Self {
            low_us: last_us as u32,
            // A quarter of the span of the low bits: what is further off is never taken for something near.
            left_us: end_us.saturating_sub(last_us).min(1 << 30) as u32,
            room: word(LAST_SIDE + 1 - (x + width_px), LAST_SIDE + 1 - (y + height_px)),
            first: (x > 0 || y > 0).then_some((x, y)),
            sensor,
        })
    }

    /// How much time has passed since an event, in microseconds modulo 2^32.
    pub const fn since(&self, low_us: u32) -> u32 {
        self.low_us.wrapping_sub(low_us)
    }

    /// Lets events pass up to the first that is not in time or not in view, and returns how many.
    // A function of its own, so that all it needs stays in registers.
    #[inline(never)]
    pub fn admit(&mut self, events: &[PackedEvent]) -> usize {
        let Self { mut low_us, mut left_us, room, first, .. } = *self;
        let mut passed = 0;
        // Several share their questions: where none steps far, none steps back, and the last is the latest. All of the sensor is in
        // view, mostly, and no sensor has an odd number of columns: so nothing but a carry changes the bits above.
        let alone = first.is_some() || room & ABOVE != 0;
        let shared = if alone { &[] } else { events.as_chunks::<SHARED>().0 };
        for several in shared {
            let (mut before_us, mut steps, mut outside) = (low_us, 0, 0);
            for event in several {
                steps |= event.low_us().wrapping_sub(before_us);
                before_us = event.low_us();
                outside |= event.word().wrapping_add(room) ^ event.word();
            }
            let step_us = before_us.wrapping_sub(low_us);
            // One question, for the sake of one branch.
            if (steps >= FAR_US) | (step_us >= left_us) | (outside & ABOVE != 0) {
                break;
            }
            (low_us, left_us) = (before_us, left_us - step_us);
            passed += SHARED;
        }
        for event in &events[passed..] {
            let step_us = event.low_us().wrapping_sub(low_us);
            if step_us >= left_us || self.is_outside(*event) {
                break;
            }
            (low_us, left_us) = (event.low_us(), left_us - step_us);
            passed += 1;
        }
        (self.low_us, self.left_us) = (low_us, left_us);
        passed
    }

    /// Where an event lies that is in time but not in view.
    pub const fn outside(&self, event: PackedEvent) -> Option<Outside> {
        let (x, y) = event.pixel();
        if event.low_us().wrapping_sub(self.low_us) >= self.left_us || !self.is_outside(event) {
            None
        } else if self.sensor.contains(x, y) {
            Some(Outside::Roi)
        } else {
            Some(Outside::Sensor)
        }
    }

    #[inline(always)]
    const fn is_outside(&self, event: PackedEvent) -> bool {
        let (x, y) = event.pixel();
        let before = match self.first {
            Some((x0, y0)) => x < x0 || y < y0,
            None => false,
        };
        before || beyond(event.word(), self.room) & ABOVE != 0
    }
}

/// Has a bit of [`ABOVE`] where a pixel lies beyond the last row or column: what is left once the sum's own bits are taken out are
/// its carries.
#[inline(always)]
const fn beyond(word: u32, room: u32) -> u32 {
    word.wrapping_add(room) ^ word ^ room
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Polarity;
    use crate::settings::Roi;

    extern crate std;
    use std::vec::Vec;

    /// Pixels along every edge, and far out.
    fn pixels() -> impl Iterator<Item = (u16, u16)> {
        let sides = [
            0,
            1,
            9,
            10,
            29,
            30,
            31,
            258,
            259,
            260,
            345,
            346,
            347,
            1023,
            2046,
            2047,
            2048,
            u16::MAX,
        ];
        sides.into_iter().flat_map(move |x| sides.map(|y| (x, y)))
    }

    #[test]
    fn what_passes_is_in_view_whatever_the_sensor() {
        let roi = Roi { x: 10, y: 30, width_px: 20, height_px: 300 };
        for (width_px, height_px, roi) in [
            (346, 260, None),
            (345, 261, None),
            (2046, 2048, None),
            (1, 1, None),
            (346, 260, Some(roi)),
        ] {
            let geometry = Geometry { width_px, height_px };
            let settings = Settings { roi, ..Settings::new(geometry) };
            for (x, y) in pixels() {
                let sensor = geometry.contains(x, y);
                let inside = sensor && roi.is_none_or(|roi| roi.contains(x, y));
                for polarity in [Polarity::On, Polarity::Off] {
                    // Alone among others, and at the end.
                    let mut events: Vec<_> =
                        (0..10).map(|t_us| PackedEvent::new(t_us, 0, 0, Polarity::On)).collect();
                    if let Some(roi) = roi {
                        events.fill(PackedEvent::new(5, roi.x, roi.y, Polarity::On));
                    }
                    for at in [0, 5, 9] {
                        let mut events = events.clone();
                        events[at] = PackedEvent::new(events[at].low_us(), x, y, polarity);
                        let mut gate = Gate::new(&settings, 0, 100).expect("something is in view");
                        let passed = gate.admit(&events);
                        assert_eq!(
                            passed,
                            if inside { 10 } else { at },
                            "({x}, {y}) of {geometry:?}"
                        );
                        let outside = if sensor { Outside::Roi } else { Outside::Sensor };
                        let expected = (!inside).then_some(outside);
                        assert_eq!(
                            events.get(passed).and_then(|event| gate.outside(*event)),
                            expected
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_passes_that_steps_back_or_is_too_late() {
        let settings = Settings::new(Geometry { width_px: 346, height_px: 260 });
        for at in 0..20 {
            for (low_us, passes) in [(99, false), (100, at == 0), (131, true), (300, false)] {
                let event = |index: u32| PackedEvent::new(110 + index, 3, 4, Polarity::On);
                let mut events: Vec<_> = (0..20).map(event).collect();
                events.truncate(at as usize + 1);
                events[at as usize] = PackedEvent::new(low_us, 3, 4, Polarity::On);
                let mut gate = Gate::new(&settings, 100, 300).expect("something is in view");
                assert_eq!(
                    gate.admit(&events),
                    at as usize + usize::from(passes),
                    "{low_us} at {at}"
                );
            }
        }
    }
}

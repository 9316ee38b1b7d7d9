//! The gate that every event passes: in time, and in view.
//!
//! Nearly every event is later than the one before, earlier than the end of the open segment, and in view. That is
//! all that is asked here, of many at once; what else an event may be is told elsewhere, one by one.

use crate::event::{Geometry, PackedEvent};
use crate::settings::Settings;

/// Upper bits of column and row, which no pixel on a sensor has: where they end up set, a subtraction has borrowed.
const BORROWED: u32 = 0x8000_8000;

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
    /// First column and row in view.
    origin: u32,
    /// Columns and rows in view behind these.
    span: u32,
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
        let whole = (0, 0, sensor.width_px, sensor.height_px);
        let (x0, y0, x1, y1) = settings.roi.map_or(whole, |roi| {
            let (x1, y1) =
                (roi.x.saturating_add(roi.width_px), roi.y.saturating_add(roi.height_px));
            (roi.x, roi.y, x1.min(sensor.width_px), y1.min(sensor.height_px))
        });
        let pixel = |x: u16, y: u16| u32::from(y) << 16 | u32::from(x);
        (x0 < x1 && y0 < y1).then(|| Self {
            low_us: last_us as u32,
            // A quarter of the span of the low bits: what is further off is never taken for something near.
            left_us: end_us.saturating_sub(last_us).min(1 << 30) as u32,
            origin: pixel(x0, y0),
            span: pixel(x1 - 1 - x0, y1 - 1 - y0) | BORROWED,
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
        let Self { mut low_us, mut left_us, origin, span, .. } = *self;
        let mut passed = 0;
        // Several share their questions: where none steps far, none steps back, and the last is the latest.
        for several in events.as_chunks::<SHARED>().0 {
            let (mut before_us, mut steps, mut inside) = (low_us, 0, BORROWED);
            for event in several {
                steps |= event.low_us().wrapping_sub(before_us);
                before_us = event.low_us();
                inside &= kept_borrowed(event.pixel(), origin, span);
            }
            let step_us = before_us.wrapping_sub(low_us);
            if steps >= FAR_US || step_us >= left_us || inside != BORROWED {
                break;
            }
            (low_us, left_us) = (before_us, left_us - step_us);
            passed += SHARED;
        }
        for event in &events[passed..] {
            let step_us = event.low_us().wrapping_sub(low_us);
            if step_us >= left_us || is_outside(event.pixel(), origin, span) {
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
        let pixel = event.pixel();
        if event.low_us().wrapping_sub(self.low_us) >= self.left_us
            || !is_outside(pixel, self.origin, self.span)
        {
            None
        } else if self.sensor.contains(pixel as u16, (pixel >> 16) as u16) {
            Some(Outside::Roi)
        } else {
            Some(Outside::Sensor)
        }
    }
}

/// Has all bits of [`BORROWED`] when a pixel is in view.
#[inline(always)]
const fn kept_borrowed(pixel: u32, origin: u32, span: u32) -> u32 {
    let from_origin = pixel.wrapping_sub(origin);
    span.wrapping_sub(from_origin) & !from_origin
}

#[inline(always)]
const fn is_outside(pixel: u32, origin: u32, span: u32) -> bool {
    kept_borrowed(pixel, origin, span) & BORROWED != BORROWED
}

//! The way of a rotor's axis through the window, and its turn beyond an even one.

use heapless::Vec;

use super::polar::Annulus;
use crate::limits::MAX_KNOTS;
use crate::math::sqrt;
use crate::rotors::Disc;
use crate::store::{StoredEvent, Window};

/// What the rotor did beside turning evenly, at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Knot {
    /// Place of the axis from the disc's centre, in pixels.
    pub x_px: f32,
    /// Place of the axis from the disc's centre, in pixels.
    pub y_px: f32,
    /// Turn beyond an even one in radians, positive = clockwise.
    pub turn_rad: f32,
}

/// Knots at equal times from the start of the window on, with straight lines between. The stretches between are
/// called blocks.
#[derive(Clone, Debug)]
pub struct Path {
    knots: Vec<Knot, MAX_KNOTS>,
    /// Time of the first knot since the middle of the window.
    start_us: f32,
    step_us: f32,
    /// Blocks in a microsecond.
    per_us: f32,
}

impl Path {
    /// An axis at rest and an even turn.
    pub const STILL: Self = Self { knots: Vec::new(), start_us: 0.0, step_us: 1.0, per_us: 1.0 };

    /// None yet: all zeros, so that the flash holds no copy of what it lies in.
    pub const UNSET: Self = Self { knots: Vec::new(), start_us: 0.0, step_us: 0.0, per_us: 0.0 };

    /// The same way through knots `step_us` apart from `start_us` on: `blocks` of them and one more.
    #[must_use]
    pub fn divided(&self, start_us: f32, step_us: f32, blocks: usize) -> Self {
        let mut path = Self { knots: Vec::new(), start_us, step_us, per_us: 1.0 / step_us };
        for k in 0..=blocks.clamp(1, MAX_KNOTS - 1) {
            path.knots.push(self.at(start_us + k as f32 * step_us)).ok();
        }
        path
    }

    /// Number of blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.knots.len().saturating_sub(1)
    }

    /// Length of a block in microseconds.
    #[must_use]
    pub const fn step_us(&self) -> f32 {
        self.step_us
    }

    /// Brings all knots to their mean place.
    pub fn rest(&mut self) {
        let (x_px, y_px) = self.centre();
        for knot in &mut self.knots {
            (knot.x_px, knot.y_px) = (x_px, y_px);
        }
    }

    /// Takes the mean place out of the path and returns it.
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn centre(&mut self) -> (f32, f32) {
        let (x_px, y_px) = mean_place(&self.knots);
        for knot in &mut self.knots {
            knot.x_px -= x_px;
            knot.y_px -= y_px;
        }
        (x_px, y_px)
    }

    /// How far its mean place in the second half is from that in the first, in pixels.
    #[must_use]
    pub fn half_to_half_px(&self) -> f32 {
        let (before, behind) = self.knots.split_at(self.knots.len() / 2);
        let ((x, y), (to_x, to_y)) = (mean_place(before), mean_place(behind));
        let (x_px, y_px) = (to_x - x, to_y - y);
        sqrt(x_px * x_px + y_px * y_px)
    }

    /// The knots.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// The knots, to be moved.
    pub fn knots_mut(&mut self) -> &mut [Knot] {
        &mut self.knots
    }

    /// How many blocks lie before an instant.
    fn place(&self, t_us: f32) -> f32 {
        (t_us - self.start_us) * self.per_us
    }

    /// The instant so far through a block, in microseconds since the middle of the window.
    #[must_use]
    pub fn time_us(&self, index: usize, f: f32) -> f32 {
        self.start_us + (index as f32 + f) * self.step_us
    }

    /// Where the rotor was `t_us` after the middle of the window.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn at(&self, t_us: f32) -> Knot {
        let place = self.place(t_us);
        let stretch = self.stretch(place);
        stretch.at(place - stretch.index as f32)
    }

    /// The way through the block at a place, or through that next to it.
    // Not inlined: flash is short.
    #[inline(never)]
    fn stretch(&self, place: f32) -> Stretch {
        // Casting a negative float gives 0.
        let index = (place as usize).min(self.blocks().saturating_sub(1));
        let (Some(a), Some(b)) = (self.knots.get(index), self.knots.get(index + 1)) else {
            return Stretch { index, ..Stretch::default() };
        };
        let way = Knot {
            x_px: b.x_px - a.x_px,
            y_px: b.y_px - a.y_px,
            turn_rad: b.turn_rad - a.turn_rad,
        };
        Stretch { index, start: *a, way }
    }
}

/// Mean place of some knots.
// Not inlined: flash is short.
#[inline(never)]
pub fn mean_place(knots: &[Knot]) -> (f32, f32) {
    let n = (knots.len() as f32).max(1.0);
    let sum = |part: fn(&Knot) -> f32| knots.iter().map(part).sum::<f32>() / n;
    (sum(|knot| knot.x_px), sum(|knot| knot.y_px))
}

/// The straight way through a block.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    index: usize,
    start: Knot,
    /// From there to the block's end.
    way: Knot,
}

impl Stretch {
    /// Where the rotor was so far through the block.
    fn at(&self, f: f32) -> Knot {
        let Self { start, way, .. } = self;
        Knot {
            x_px: start.x_px + f * way.x_px,
            y_px: start.y_px + f * way.y_px,
            turn_rad: start.turn_rad + f * way.turn_rad,
        }
    }
}

/// A rotor's disc that goes along a path.
#[derive(Clone, Copy, Debug)]
pub struct Moving<'p> {
    annulus: Annulus,
    path: &'p Path,
    /// The block of the event before: events of a block follow each other.
    stretch: Stretch,
    start_us: u64,
    middle_us: i32,
}

impl<'p> Moving<'p> {
    /// The disc in this window.
    #[must_use]
    pub fn new(disc: Disc, path: &'p Path, window: &Window<'_>) -> Self {
        let middle_us = (window.duration_us / 2) as i32;
        let (annulus, stretch) = (Annulus::of(disc), path.stretch(0.0));
        Self { annulus, path, stretch, start_us: window.start_us, middle_us }
    }

    /// Position relative to the axis, and its squared length, when the event lies in the disc's annulus.
    #[inline]
    pub fn place(&mut self, event: StoredEvent) -> Option<(f32, f32, f32)> {
        let (.., knot) = self.follow(self.since_middle_us(event));
        self.place_by(event, knot)
    }

    /// The block that an instant lies in, how far through it, and where the rotor was then: `t_us` after the middle of the window.
    #[inline]
    pub fn follow(&mut self, t_us: i32) -> (usize, f32, Knot) {
        let place = self.path.place(t_us as f32);
        if place as usize != self.stretch.index {
            self.stretch = self.path.stretch(place);
        }
        let f = place - self.stretch.index as f32;
        (self.stretch.index, f, self.stretch.at(f))
    }

    /// The same, where the path is known for the instant of the event.
    #[must_use]
    pub fn place_by(&self, event: StoredEvent, knot: Knot) -> Option<(f32, f32, f32)> {
        self.annulus.place_from(event, (knot.x_px, knot.y_px))
    }

    /// Time since the middle of the window in microseconds.
    #[must_use]
    pub const fn since_middle_us(&self, event: StoredEvent) -> i32 {
        event.since(self.start_us) - self.middle_us
    }
}

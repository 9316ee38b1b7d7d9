//! Events of one rotor in polar coordinates about its centre.

use heapless::{Vec, VecView};

use crate::math::{Turn, quick_sqrt};
use crate::rotors::Disc;
use crate::store::{Even, StoredEvent, Window};

/// Inner edge of the annulus that is measured, as a share of the radius: nearer to the centre one pixel
/// spans too large an angle.
const INNER_SHARE: f32 = 0.2;
/// Outer edge, as a share of the radius.
const OUTER_SHARE: f32 = 1.15;

/// The part of the image a rotor is measured in.
#[derive(Clone, Copy, Debug)]
pub struct Annulus {
    x_px: f32,
    y_px: f32,
    inner2: f32,
    outer2: f32,
}

impl Annulus {
    /// The annulus of a disc.
    #[must_use]
    pub fn of(disc: Disc) -> Self {
        let inner = (INNER_SHARE * disc.radius_px).max(2.0);
        let outer = OUTER_SHARE * disc.radius_px;
        Self { x_px: disc.x_px, y_px: disc.y_px, inner2: inner * inner, outer2: outer * outer }
    }

    /// Position relative to the centre, and its squared length, when the event lies in the annulus.
    #[must_use]
    pub fn place(&self, event: StoredEvent) -> Option<(f32, f32, f32)> {
        self.place_from(event, (0.0, 0.0))
    }

    /// The same with the annulus shifted by (x, y) pixels.
    #[must_use]
    pub fn place_from(&self, event: StoredEvent, shift_px: (f32, f32)) -> Option<(f32, f32, f32)> {
        let dx = f32::from(event.x()) - self.x_px - shift_px.0;
        let dy = f32::from(event.y()) - self.y_px - shift_px.1;
        self.within(dx, dy)
    }

    /// A position relative to the centre, and its squared length, when it lies in the annulus.
    fn within(&self, dx: f32, dy: f32) -> Option<(f32, f32, f32)> {
        let r2 = dx * dx + dy * dy;
        (r2 >= self.inner2 && r2 <= self.outer2).then_some((dx, dy, r2))
    }
}

/// One event in polar coordinates, 8 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct PolarEvent {
    /// Time since the middle of the window in microseconds.
    pub t_us: i32,
    /// Upper 16 bits of the direction: 0.1 mrad.
    angle: u16,
    /// Distance from the centre in 1/16 px, and the polarity in the top bit.
    radius_polarity: u16,
}

impl PolarEvent {
    /// Direction as seen from the centre.
    #[must_use]
    pub const fn angle(self) -> Turn {
        Turn((self.angle as u32) << 16)
    }

    /// Distance from the centre in pixels.
    #[must_use]
    pub fn radius_px(self) -> f32 {
        f32::from(self.radius_polarity & 0x7FFF) * 0.0625
    }

    /// Whether the pixel became brighter.
    #[must_use]
    pub const fn is_on(self) -> bool {
        self.radius_polarity & 0x8000 != 0
    }

    /// The same event as seen from (x, y) pixels beside the centre, where it lies in an annulus about that place.
    #[must_use]
    pub fn seen_from(self, x_px: f32, y_px: f32, annulus: &Annulus) -> Option<Self> {
        let (sin, cos) = self.angle().sin_cos();
        let (dx, dy) = (self.radius_px() * cos - x_px, self.radius_px() * sin - y_px);
        let (dx, dy, r2) = annulus.within(dx, dy)?;
        Some(Self::at(dx, dy, r2, self.radius_polarity & 0x8000, self.t_us))
    }

    // One by one, as numbers are handed over in registers, and tuples in memory.
    // Not inlined: flash is short.
    #[inline(never)]
    fn at(dx: f32, dy: f32, r2: f32, polarity: u16, t_us: i32) -> Self {
        let angle = (Turn::of_vector(dy, dx).0 >> 16) as u16;
        let radius = ((quick_sqrt(r2) * 16.0) as u16).min(0x7FFF);
        Self { t_us, angle, radius_polarity: radius | polarity }
    }

    /// Converts one event; `mid_us` is the time that counts as 0, since the window's start.
    pub(super) fn new(
        event: StoredEvent,
        (dx, dy, r2): (f32, f32, f32),
        window: &Window<'_>,
        mid_us: i32,
    ) -> Self {
        let polarity = if window.is_on(event) { 0x8000 } else { 0 };
        Self::at(dx, dy, r2, polarity, event.since(window.start_us) - mid_us)
    }
}

/// A rotor's events, evenly thinned to the capacity, whatever that is.
pub type PolarTrack = VecView<PolarEvent>;
/// The same with room for so many.
pub type PolarEvents<const CAPACITY: usize> = Vec<PolarEvent, CAPACITY>;

/// Fills `track` with the rotor's events of the window, a segment a call; `true` once all are in it.
/// Cost: about 200 instructions for each event in the annulus.
pub fn track(window: &Window<'_>, disc: Disc, track: &mut PolarTrack, tracking: &mut Even) -> bool {
    let annulus = Annulus::of(disc);
    let mid_us = (window.duration_us / 2) as i32;
    if !tracking.is_weighed() {
        track.clear();
    }
    tracking.step(
        window,
        track.capacity(),
        |event| annulus.place(event),
        |event, place| {
            track.push(PolarEvent::new(event, place, window, mid_us)).ok();
        },
    )
}

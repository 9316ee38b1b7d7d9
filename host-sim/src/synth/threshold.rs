//! First event model: a pixel fires when its logarithm of intensity has moved by its threshold since its last event.
//!
//! Time advances in steps that end where the next edge can be at the earliest, so that a pixel between two blades costs
//! nothing. Simulation starts before the recording, unless the scene says otherwise: a pixel that has never fired holds an arbitrary
//! level, and its first visit by a blade is timed differently from all later ones.

use evtach_core::Polarity;

use super::field::{Field, Sample, View};
use super::pixel::{Pixel, Span, Tray};

/// Seconds of simulation beyond either end, for events that jitter brings into the recording.
pub const TAIL_S: f64 = 1e-3;

/// Passes over the warm-up: those that every pixel makes, and how many more are drawn for each.
const PASSES: (u32, u32) = (4, 8);
/// The same where camera or mount move, which already makes every visit different.
const MOVING_PASSES: (u32, u32) = (1, 4);

/// A pixel on its way through the recording.
#[derive(Debug)]
pub struct Run {
    view: View,
    walk: Walk,
}

impl Run {
    /// Brings a pixel to where the recording begins.
    #[must_use]
    pub fn new(field: &Field, mut view: View, pixel: &mut Pixel) -> Self {
        if pixel.starts_cold() {
            let walk = Walk::new(field, &mut view, 0.0, 0.0);
            return Self { view, walk };
        }
        let start_s = -TAIL_S - field.warm_up_s(&view);
        // What matters is how far the level is from the reference. With unequal thresholds that wanders from period to period
        // without ever settling; drawing the number of passes puts each pixel at another point of its round.
        let (least, more) = if field.moves() { MOVING_PASSES } else { PASSES };
        let passes = if view.turns() { pixel.drawn(least, more) } else { 1 };
        let (mut t_s, mut above) = (start_s, 0.0);
        for _ in 0..passes {
            let mut walk = Walk::new(field, &mut view, start_s, above);
            walk.advance(field, &mut view, pixel, -TAIL_S, -TAIL_S, |_, _, _, _| {});
            (t_s, above) = (walk.t_s, walk.now.level - walk.reference);
        }
        let walk = Walk::new(field, &mut view, t_s, above);
        Self { view, walk }
    }

    /// Fires what happens up to a time, or a little beyond it; where it stops changes no event.
    pub fn advance(
        &mut self,
        field: &Field,
        pixel: &mut Pixel,
        until_s: f64,
        span: &Span,
        tray: &mut Tray,
    ) {
        let end_s = span.duration_s + TAIL_S;
        let fire = |pixel: &mut Pixel, t_s: f64, polarity: Polarity, rotor: Option<usize>| {
            pixel.fire(t_s, polarity, rotor, span, tray);
        };
        self.walk.advance(field, &mut self.view, pixel, until_s, end_s, fire);
    }
}

/// A pixel at one time.
#[derive(Clone, Copy, Debug)]
struct Walk {
    /// Time in seconds; events before it have been fired.
    t_s: f64,
    now: Sample,
    /// Level of the last event.
    reference: f64,
}

impl Walk {
    /// A pixel whose level is so far above its reference.
    fn new(field: &Field, view: &mut View, t_s: f64, above: f64) -> Self {
        let now = field.sample(view, t_s);
        Self { t_s, now, reference: now.level - above }
    }

    /// Advances to a time, or a little beyond it when the next look is, or the pixel is then held in reset. None looks beyond the end.
    fn advance(
        &mut self,
        field: &Field,
        view: &mut View,
        pixel: &mut Pixel,
        until_s: f64,
        end_s: f64,
        mut fire: impl FnMut(&mut Pixel, f64, Polarity, Option<usize>),
    ) {
        let refractory_s = pixel.refractory_s();
        let Self { mut t_s, mut now, mut reference } = *self;
        while t_s < until_s.min(end_s) {
            let next_s = (t_s + now.step_s).min(end_s);
            let next = field.sample(view, next_s);
            let moved = next.level - reference;
            let (target, polarity) = if moved > pixel.on() {
                (reference + pixel.on(), Polarity::On)
            } else if moved < -pixel.off() {
                (reference - pixel.off(), Polarity::Off)
            } else {
                (t_s, now) = (next_s, next);
                continue;
            };
            // Two rounds of false position: what is left is far below the jitter and the same at every visit.
            let guess_s = between((t_s, now.level), (next_s, next.level), target);
            let guess = field.sample(view, guess_s);
            let beyond = (guess.level - target) * (target - reference) >= 0.0;
            let event_s = if beyond {
                between((t_s, now.level), (guess_s, guess.level), target)
            } else {
                between((guess_s, guess.level), (next_s, next.level), target)
            };
            fire(pixel, event_s, polarity, next.rotor.or(now.rotor));
            // The pixel is held in reset: what happens meanwhile is lost, and the level it is released at is the new reference.
            t_s = event_s + refractory_s;
            now = field.sample(view, t_s);
            reference = if refractory_s > 0.0 { now.level } else { target };
        }
        *self = Self { t_s, now, reference };
    }
}

/// Time at which the straight line from `a` to `b` reaches the target, not outside of the two.
fn between(a: (f64, f64), b: (f64, f64), target: f64) -> f64 {
    let rise = b.1 - a.1;
    let share = if rise == 0.0 { 1.0 } else { ((target - a.1) / rise).clamp(0.0, 1.0) };
    a.0 + (b.0 - a.0) * share
}

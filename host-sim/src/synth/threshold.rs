//! First event model: a pixel fires when its logarithm of intensity has moved by its threshold since its last event.
//!
//! Time advances in steps that end where the next edge can be at the earliest, so that a pixel between two blades costs
//! nothing. Simulation starts before the recording: a pixel that has never fired holds an arbitrary level, and its first
//! visit by a blade would be timed differently from all later ones.

use evtach_core::Polarity;

use super::field::{Field, View};
use super::pixel::{Pixel, Span, Tray};

/// Seconds of simulation beyond either end, for events that jitter brings into the recording.
pub const TAIL_S: f64 = 1e-3;

/// Passes over the warm-up: those that every pixel makes, and how many more are drawn for each.
const PASSES: (u32, u32) = (4, 8);
/// The same where camera or mount move, which already makes every visit different.
const MOVING_PASSES: (u32, u32) = (1, 4);

/// Simulates one pixel.
pub fn run(field: &Field, view: &mut View, pixel: &mut Pixel, span: &Span, tray: &mut Tray) {
    let start_s = -TAIL_S - field.warm_up_s(view);
    // What matters is how far the level is from the reference. With unequal thresholds that wanders from period to period
    // without ever settling; drawing the number of passes puts each pixel at another point of its round.
    let (least, more) = if field.moves() { MOVING_PASSES } else { PASSES };
    let passes = if view.turns() { pixel.drawn(least, more) } else { 1 };
    let mut state = State { t_s: start_s, above: 0.0 };
    for _ in 0..passes {
        let from = State { t_s: start_s, above: state.above };
        state = advance(field, view, pixel, from, -TAIL_S, |_, _, _, _| {});
    }
    advance(field, view, pixel, state, span.duration_s + TAIL_S, |pixel, t_s, polarity, rotor| {
        pixel.fire(t_s, polarity, rotor, span, tray);
    });
}

/// A pixel at one time.
#[derive(Clone, Copy, Debug)]
struct State {
    /// Time in seconds; events before it have been fired.
    t_s: f64,
    /// Level of intensity above the reference.
    above: f64,
}

/// Advances one pixel to a time, or a little beyond it when it is then held in reset.
fn advance(
    field: &Field,
    view: &mut View,
    pixel: &mut Pixel,
    from: State,
    end_s: f64,
    mut fire: impl FnMut(&mut Pixel, f64, Polarity, Option<usize>),
) -> State {
    let refractory_s = pixel.refractory_s();
    let mut t_s = from.t_s;
    let mut now = field.sample(view, t_s);
    let mut reference = now.level - from.above;
    while t_s < end_s {
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
    State { t_s, above: now.level - reference }
}

/// Time at which the straight line from `a` to `b` reaches the target, not outside of the two.
fn between(a: (f64, f64), b: (f64, f64), target: f64) -> f64 {
    let rise = b.1 - a.1;
    let share = if rise == 0.0 { 1.0 } else { ((target - a.1) / rise).clamp(0.0, 1.0) };
    a.0 + (b.0 - a.0) * share
}

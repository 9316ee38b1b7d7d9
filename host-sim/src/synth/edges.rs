//! Second event model: one event whenever a blade's edge passes the centre of a pixel, from the geometry alone.

use std::f64::consts::TAU;

use evtach_core::Polarity;

use super::field::{Field, Layer, wrapped};
use super::pixel::{Pixel, Span, Tray};

/// Seconds before the recording in which passages still count for the refractory time and for jitter.
const LEAD_S: f64 = 2e-3;
/// A passage is found when Newton's step is below this, in seconds.
const TOLERANCE_S: f64 = 1e-9;

/// Computes the passages of all rotors over one pixel and fires them in order of time.
pub fn run(
    field: &Field,
    contrasts: &[f64],
    place: (u16, u16),
    pixel: &mut Pixel,
    span: &Span,
    tray: &mut Tray,
) {
    let (x, y) = (f64::from(place.0), f64::from(place.1));
    let mut passages: Vec<(f64, Polarity, usize)> = Vec::new();
    for (number, layer) in field.layers.iter().enumerate().filter(|(_, l)| l.reaches(x, y)) {
        for edge in 0..layer.blades.edge_count() {
            of_edge(field, number, layer, edge, (x, y), contrasts[number], span, &mut passages);
        }
    }
    passages.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut ready_s = f64::NEG_INFINITY;
    for (t_s, polarity, rotor) in passages {
        if t_s >= ready_s {
            ready_s = t_s + pixel.refractory_s();
            pixel.fire(t_s, polarity, Some(rotor), span, tray);
        }
    }
}

#[expect(
    clippy::too_many_arguments,
    reason = "one edge of one rotor over one pixel: all of it is needed at once"
)]
fn of_edge(
    field: &Field,
    number: usize,
    layer: &Layer,
    edge: u32,
    (x, y): (f64, f64),
    contrast: f64,
    span: &Span,
    passages: &mut Vec<(f64, Polarity, usize)>,
) {
    let end_s = span.duration_s + LEAD_S;
    // Angle still to turn until the edge is at the pixel, and whether the blade reaches that far.
    let ahead = |t_s: f64| {
        let pose = field.poses.at(t_s);
        let (r, angle) = layer.polar(field.motion.room(&pose, x, y), &pose);
        let ring = layer.blades.ring(r);
        let at = layer.blades.edge(&ring, edge)?;
        Some(wrapped(angle - at - layer.spin.angle(t_s)))
    };
    let mut t_s = -LEAD_S;
    while t_s < end_s {
        let turn_s = TAU / layer.spin.rate(t_s).abs();
        let Some(first) = ahead(t_s) else {
            // Not within the blade's reach now; with a moving camera it may be later.
            if !field.motion.rotors_move() {
                return;
            }
            t_s += turn_s.min(2e-3);
            continue;
        };
        // The next passage in the sense of rotation, then Newton's method.
        let sense = layer.spin.rate(t_s).signum();
        let mut guess_s = t_s + (first * sense).rem_euclid(TAU) / TAU * turn_s;
        let mut found = false;
        for _ in 0..12 {
            let Some(off) = ahead(guess_s) else { break };
            let correction = off / layer.spin.rate(guess_s);
            guess_s += correction;
            if correction.abs() < TOLERANCE_S {
                found = true;
                break;
            }
        }
        if found && guess_s >= t_s - 1e-6 && guess_s < end_s {
            let pose = field.poses.at(guess_s);
            let room = field.motion.room(&pose, x, y);
            let above = field.layers.iter().skip(number + 1);
            if !above.into_iter().any(|l| l.hides(room, &pose, guess_s)) {
                // Ahead in the sense of rotation the pixel goes from background to blade.
                let arrives = edge.is_multiple_of(2) == (sense > 0.0);
                let polarity =
                    if arrives == (contrast > 0.0) { Polarity::On } else { Polarity::Off };
                passages.push((guess_s, polarity, number));
            }
        }
        // Past this passage, well before the same edge's next.
        t_s = guess_s.max(t_s) + 0.5 * turn_s;
    }
}

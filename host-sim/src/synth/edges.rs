//! Second event model: one event whenever a blade's edge passes the centre of a pixel, from the geometry alone.

use std::f64::consts::TAU;

use evtach_core::Polarity;

use super::field::{Field, Layer, wrapped};
use super::pixel::{Pixel, Span, Tray};

/// Seconds before the recording in which passages still count for the refractory time and for jitter.
const LEAD_S: f64 = 2e-3;
/// A passage is found when Newton's step is below this, in seconds.
const TOLERANCE_S: f64 = 2e-8;

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
    let look = |t_s: f64| {
        let pose = field.poses.at(t_s);
        layer.polar(field.motion.room(&pose, x, y), &pose)
    };
    // Angle still to turn until the edge is at the pixel; `None` where the blade does not reach.
    let ahead = |t_s: f64| {
        let (r, angle) = look(t_s);
        let ring = layer.blades.ring(r);
        let at = layer.blades.edge(&ring, edge)?;
        Some(wrapped(angle - at - layer.spin.angle(t_s)))
    };
    let turn_s = |t_s: f64| TAU / layer.spin.rate(t_s).abs();
    let mut t_s = -LEAD_S;
    let mut guess_s = None;
    while t_s < end_s {
        let Some(start_s) = guess_s.or_else(|| {
            let sense = layer.spin.rate(t_s).signum();
            Some(t_s + (ahead(t_s)? * sense).rem_euclid(TAU) / TAU * turn_s(t_s))
        }) else {
            if !field.moves() {
                return;
            }
            // The camera has to bring the pixel over the blades first.
            t_s += (layer.blades.gap(look(t_s).0) / field.peak_image_speed()).max(1e-3);
            continue;
        };
        guess_s = None;
        let Some(passage_s) = newton(start_s, |t_s| Some(ahead(t_s)? / layer.spin.rate(t_s)))
        else {
            // The blade's rim: look again soon.
            t_s = t_s.max(start_s) + turn_s(start_s) * 0.25;
            continue;
        };
        if passage_s >= t_s - 1e-6 && passage_s < end_s {
            let pose = field.poses.at(passage_s);
            let room = field.motion.room(&pose, x, y);
            if !field.layers.iter().skip(number + 1).any(|l| l.hides(room, &pose, passage_s)) {
                // Ahead in the sense of rotation the pixel goes from background to blade.
                let arrives = edge.is_multiple_of(2) == (layer.spin.rate(passage_s) > 0.0);
                let polarity =
                    if arrives == (contrast > 0.0) { Polarity::On } else { Polarity::Off };
                passages.push((passage_s, polarity, number));
            }
        }
        // Past this passage, well before the same edge's next.
        t_s = passage_s.max(t_s) + 0.5 * turn_s(passage_s);
        guess_s = Some(passage_s + turn_s(passage_s)).filter(|next_s| *next_s > t_s);
    }
}

/// The root near a start, given Newton's step at a time.
fn newton(start_s: f64, step: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let mut t_s = start_s;
    for _ in 0..12 {
        let correction_s = step(t_s)?;
        t_s += correction_s;
        if correction_s.abs() < TOLERANCE_S {
            return Some(t_s);
        }
    }
    None
}

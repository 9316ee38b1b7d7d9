//! The heat map with the rotors that were found.

use plotters::prelude::*;

use super::{ReportError, Subject, colour};
use crate::measure::letter;

/// Most cells that are drawn; larger sensors get larger cells.
const MOST_CELLS: usize = 12_000;
/// Width of the drawing in pixels.
const WIDTH: u32 = 900;

/// Draws it.
pub fn draw(subject: &Subject<'_>) -> Result<String, ReportError> {
    let (w, h) = (usize::from(subject.geometry.width_px), usize::from(subject.geometry.height_px));
    // The measurement's own cells are 4 px.
    let cell = (4..).find(|c| w.div_ceil(*c) * h.div_ceil(*c) <= MOST_CELLS).unwrap_or(4);
    let columns = w.div_ceil(cell);
    let mut counts = vec![0u32; columns * h.div_ceil(cell)];
    for event in subject.events {
        let place = usize::from(event.y) / cell * columns + usize::from(event.x) / cell;
        if let Some(count) = counts.get_mut(place) {
            *count += 1;
        }
    }
    let mut svg = String::new();
    let height =
        WIDTH * u32::from(subject.geometry.height_px) / u32::from(subject.geometry.width_px);
    paint(subject, &mut svg, height, cell, &counts).map_err(ReportError::of("heat map"))?;
    Ok(svg)
}

fn paint(
    subject: &Subject<'_>,
    svg: &mut String,
    height: u32,
    cell: usize,
    counts: &[u32],
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let (w, h) = (f64::from(subject.geometry.width_px), f64::from(subject.geometry.height_px));
    let area = SVGBackend::with_string(svg, (WIDTH, height)).into_drawing_area();
    area.fill(&BLACK)?;
    let scale = f64::from(WIDTH) / w;
    let at = |x: f64, y: f64| ((x * scale) as i32, (y * scale) as i32);
    let columns = (w as usize).div_ceil(cell);
    // The root brings slow rotors out beside fast ones.
    let brightest = f64::from(counts.iter().copied().max().unwrap_or(0).max(1)).sqrt();
    for (i, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let (x, y) = ((i % columns * cell) as f64, (i / columns * cell) as f64);
        let corners = [at(x, y), at((x + cell as f64).min(w), (y + cell as f64).min(h))];
        let shade = glow(f64::from(*count).sqrt() / brightest);
        area.draw(&Rectangle::new(corners, shade.filled()))?;
    }
    for rotor in &subject.summary.rotors {
        let (x, y) = at(f64::from(rotor.x_px), f64::from(rotor.y_px));
        let radius = f64::from(rotor.radius_px) * scale;
        let style = colour(rotor.id).stroke_width(3);
        // Dashes of six degrees where there is no speed.
        let dashed = rotor.speed.is_none();
        for piece in 0..30 {
            let from = f64::from(piece) * 12.0;
            let to = if dashed { from + 6.0 } else { from + 12.0 };
            let point = |degrees: f64| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                (x + (radius * cos) as i32, y + (radius * sin) as i32)
            };
            let arc = [from, (from + to) / 2.0, to].map(point);
            area.draw(&PathElement::new(arc.to_vec(), style))?;
        }
        area.draw(&Cross::new((x, y), 6, style))?;
        let font = ("sans-serif", 26).into_font().color(&WHITE);
        let tag = match &rotor.speed {
            Some(speed) => format!(
                "{} {:.1} rpm {}",
                letter(rotor.id),
                speed.rpm(),
                speed.direction().as_str()
            ),
            None => letter(rotor.id),
        };
        // Above the disc, where it is dark; inside at the frame's upper edge.
        let above = y - radius as i32 - 32;
        area.draw(&Text::new(tag, (x - 60, above.max(2)), font))?;
    }
    area.present()
}

/// Black over violet and orange to white: brightness grows evenly, so it also reads in grey.
fn glow(u: f64) -> RGBColor {
    const STOPS: [(f64, f64, f64); 5] = [
        (0.0, 0.0, 4.0),
        (87.0, 16.0, 110.0),
        (188.0, 55.0, 84.0),
        (249.0, 142.0, 9.0),
        (252.0, 255.0, 220.0),
    ];
    let place = u.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let i = (place as usize).min(STOPS.len() - 2);
    let (a, b) = (STOPS[i], STOPS[i + 1]);
    let mix = |a: f64, b: f64| (a + (b - a) * (place - i as f64)) as u8;
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

//! The phase fit of one rotor: its events turned back by the measured speed, and what is left.
//!
//! A picture of the fit, not a measurement: where the speed is right the blades stand still from left to right; a wrong
//! speed makes them slant, a wrong blade count makes them overlap. A reading tells no more than one axis, speed and acceleration of its
//! window, though they were followed through it: how they go meanwhile is left in the picture.

use std::f64::consts::TAU;

use evtach_core::{Polarity, Reading, RotorReading};
use plotters::prelude::*;

use super::{ReportError, Subject, colour};

/// Columns of the picture.
const COLUMNS: usize = 120;
/// Rows of the picture: steps within one symmetry period.
const ROWS: usize = 90;
/// Width and height of the drawing in pixels.
const SIZE: (u32, u32) = (900, 560);

struct Folded {
    /// Share of the busiest cell, by column and row, ON and OFF.
    cells: Vec<[f64; 2]>,
    /// Middle of each block in seconds from the window's middle, and the residual in degrees of the rotor.
    residuals: Vec<(f64, f64)>,
    window_s: f64,
    pitch_deg: f64,
}

/// Draws the sharpest reading of a rotor; `None` where there is none.
pub fn draw(subject: &Subject<'_>, id: u8) -> Result<Option<String>, ReportError> {
    let rows = subject.readings.iter().flat_map(|reading| {
        reading.rotors.iter().filter(|r| r.id == id && r.speed.is_some()).map(move |r| (reading, r))
    });
    let sigma = |r: &RotorReading| r.speed.map_or(f32::MAX, |s| s.omega_sigma_rad_s);
    let Some((reading, rotor)) = rows.min_by(|a, b| sigma(a.1).total_cmp(&sigma(b.1))) else {
        return Ok(None);
    };
    let Some(folded) = fold(subject, reading, rotor) else { return Ok(None) };
    let mut svg = String::new();
    paint(&folded, id, &mut svg).map_err(ReportError::of("phase"))?;
    let middle_s = subject.facts.t_s(reading.t_us);
    let text = format!(
        "<p>The window of {:.0} ms around {middle_s:.3} s, events turned back by the measured speed and folded by {} \
         (light: ON, dark: OFF). Below: what is left of the phase over whole symmetry periods, in degrees of the rotor. \
         Both are about one axis, by one speed and its steady change: the way of an axis that moves, as before a hand, and a speed \
         that hunts are left here, though the measurement follows them; they are no error of the speed.</p>\n",
        folded.window_s * 1e3,
        rotor.blades.map_or("whole turns".to_owned(), |n| format!("{n} blades")),
    );
    Ok(Some(text + &svg))
}

/// Turns the window's events back by the reading's own speed.
fn fold(subject: &Subject<'_>, reading: &Reading, rotor: &RotorReading) -> Option<Folded> {
    let speed = rotor.speed?;
    let window_s = f64::from(reading.window_us) * 1e-6;
    let (omega, alpha) =
        (f64::from(speed.omega_rad_s), f64::from(speed.alpha_rad_s2.unwrap_or(0.0)));
    let n = f64::from(rotor.blades.unwrap_or(1));
    let radius = f64::from(rotor.radius_px) * 1.05;
    let mut cells = vec![[0.0f64; 2]; COLUMNS * ROWS];
    // Blades at different places give different phases: only whole symmetry periods compare.
    let periods = omega.abs() * n * window_s / TAU;
    let per_block = (periods / COLUMNS as f64).ceil().max(1.0);
    let block_s = window_s * per_block / periods;
    let mut phasors = vec![(0.0f64, 0.0f64); (periods / per_block) as usize];
    for event in subject.events {
        let t_s = (event.t_us as f64 - reading.t_us as f64) * 1e-6;
        let (dx, dy) = (
            f64::from(event.x) - f64::from(rotor.x_px),
            f64::from(event.y) - f64::from(rotor.y_px),
        );
        let r = dx.hypot(dy);
        if t_s.abs() >= window_s / 2.0 || r > radius || r < 0.15 * radius {
            continue;
        }
        let turned = omega * t_s + 0.5 * alpha * t_s * t_s;
        let folded = (n * (dy.atan2(dx) - turned)).rem_euclid(TAU);
        let column = (((t_s / window_s + 0.5) * COLUMNS as f64) as usize).min(COLUMNS - 1);
        let row = ((folded / TAU * ROWS as f64) as usize).min(ROWS - 1);
        let on = event.polarity == Polarity::On;
        cells[column * ROWS + row][usize::from(on)] += 1.0;
        let sign = if on { 1.0 } else { -1.0 };
        if let Some(phasor) = phasors.get_mut(((t_s + window_s / 2.0) / block_s) as usize) {
            phasor.0 += sign * folded.cos();
            phasor.1 += sign * folded.sin();
        }
    }
    let busiest = cells.iter().flatten().copied().fold(0.0, f64::max);
    if busiest == 0.0 {
        return None;
    }
    cells.iter_mut().flatten().for_each(|cell| *cell /= busiest);
    let whole = phasors.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
    let mean = f64::atan2(whole.1, whole.0);
    let seen = phasors.iter().enumerate().filter(|(_, p)| p.0 != 0.0 || p.1 != 0.0);
    let residuals = seen.map(|(i, p)| {
        let left = p.1.atan2(p.0) - mean;
        let left = left - TAU * (left / TAU).round();
        ((i as f64 + 0.5) * block_s - window_s / 2.0, (left / n).to_degrees())
    });
    Some(Folded { cells, residuals: residuals.collect(), window_s, pitch_deg: 360.0 / n })
}

fn paint(
    folded: &Folded,
    id: u8,
    svg: &mut String,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let (upper, lower) = area.split_vertically(350);
    let half_ms = folded.window_s * 500.0;
    let mut chart = ChartBuilder::on(&upper)
        .margin(10)
        .x_label_area_size(30)
        .y_label_area_size(60)
        .build_cartesian_2d(-half_ms..half_ms, 0.0..folded.pitch_deg)?;
    chart.configure_mesh().disable_mesh().y_desc("angle, turned back (deg)").x_labels(7).draw()?;
    let (dx, dy) = (2.0 * half_ms / COLUMNS as f64, folded.pitch_deg / ROWS as f64);
    for (i, [off, on]) in folded.cells.iter().enumerate() {
        // ON and OFF of equal strength cancel to the background's grey.
        let tone = (128.0 + 127.0 * (on.sqrt() - off.sqrt())).clamp(0.0, 255.0) as u8;
        if on + off == 0.0 {
            continue;
        }
        let (x, y) = ((i / ROWS) as f64 * dx - half_ms, (i % ROWS) as f64 * dy);
        let fill = RGBColor(tone, tone, tone).filled();
        chart.draw_series([Rectangle::new([(x, y), (x + dx, y + dy)], fill)])?;
    }
    let most = folded.residuals.iter().fold(0.01f64, |m, (_, r)| m.max(r.abs())) * 1.15;
    let mut chart = ChartBuilder::on(&lower)
        .margin(10)
        .x_label_area_size(35)
        .y_label_area_size(60)
        .build_cartesian_2d(-half_ms..half_ms, -most..most)?;
    chart
        .configure_mesh()
        .x_desc("time from the middle of the window (ms)")
        .y_desc("residual (deg)")
        .light_line_style(WHITE)
        .x_labels(7)
        .y_labels(5)
        .draw()?;
    let points = folded.residuals.iter().map(|(t_s, deg)| (t_s * 1e3, *deg));
    chart.draw_series([PathElement::new(
        [(-half_ms, 0.0), (half_ms, 0.0)],
        BLACK.stroke_width(1),
    )])?;
    chart.draw_series(points.map(|point| Circle::new(point, 3, colour(id).filled())))?;
    area.present()
}

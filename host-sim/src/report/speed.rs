//! Speed over time with its error bars.

use evtach_core::Status;
use plotters::prelude::*;

use super::{ReportError, Subject, colour};
use crate::measure::letter;

/// Width of the drawing, and height for each rotor, in pixels.
const SIZE: (u32, u32) = (900, 260);

/// One reading of one rotor.
struct Mark {
    t_s: f64,
    rpm: f64,
    bar: f64,
    locked: bool,
}

/// Draws it; `None` where no reading has a speed.
pub fn draw(subject: &Subject<'_>) -> Result<Option<String>, ReportError> {
    let ids: Vec<u8> =
        subject.summary.rotors.iter().filter(|r| r.speed.is_some()).map(|r| r.id).collect();
    let all: Vec<(u8, Vec<Mark>)> = ids.into_iter().map(|id| (id, marks(subject, id))).collect();
    if all.is_empty() {
        return Ok(None);
    }
    let mut svg = String::new();
    paint(subject, &all, &mut svg).map_err(ReportError::of("speed over time"))?;
    Ok(Some(svg))
}

fn marks(subject: &Subject<'_>, id: u8) -> Vec<Mark> {
    let rows = subject.readings.iter().flat_map(|reading| {
        reading.rotors.iter().filter(|r| r.id == id).map(move |rotor| (reading.t_us, rotor))
    });
    rows.filter_map(|(t_us, rotor)| {
        let speed = rotor.speed?;
        Some(Mark {
            t_s: subject.facts.t_s(t_us),
            rpm: f64::from(speed.rpm()),
            bar: 1.96 * f64::from(speed.rpm_sigma()),
            locked: rotor.status == Status::Locked,
        })
    })
    .collect()
}

fn paint(
    subject: &Subject<'_>,
    all: &[(u8, Vec<Mark>)],
    svg: &mut String,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let size = (SIZE.0, SIZE.1 * all.len() as u32);
    let area = SVGBackend::with_string(svg, size).into_drawing_area();
    area.fill(&WHITE)?;
    let facts = subject.facts;
    let (start_s, end_s) = (facts.t_s(facts.first_us), facts.t_s(facts.last_us));
    let end_s = all.iter().flat_map(|(_, marks)| marks).fold(end_s, |end, mark| end.max(mark.t_s));
    for ((id, marks), panel) in all.iter().zip(area.split_evenly((all.len(), 1))) {
        // The scale follows the locked readings; a coarse one may run off it.
        let any_locked = marks.iter().any(|m| m.locked);
        let fitting = || marks.iter().filter(|m| m.locked || !any_locked);
        let low = fitting().map(|m| m.rpm - m.bar).fold(f64::INFINITY, f64::min);
        let high = fitting().map(|m| m.rpm + m.bar).fold(f64::NEG_INFINITY, f64::max);
        let margin = ((high - low) * 0.1).max(high.abs() * 1e-6).max(1e-3);
        let mut chart = ChartBuilder::on(&panel)
            .margin(10)
            .x_label_area_size(35)
            .y_label_area_size(80)
            .build_cartesian_2d(start_s..end_s.max(start_s + 1e-3), low - margin..high + margin)?;
        chart
            .configure_mesh()
            .x_desc("time from the first event (s)")
            .y_desc(format!("rotor {} (rpm)", letter(*id)))
            .light_line_style(WHITE)
            .y_labels(6)
            .draw()?;
        let paint = colour(*id);
        chart.draw_series(marks.iter().map(|m| {
            PathElement::new(
                [(m.t_s, m.rpm - m.bar), (m.t_s, m.rpm + m.bar)],
                paint.stroke_width(1),
            )
        }))?;
        let style = |m: &Mark| if m.locked { paint.filled() } else { paint.stroke_width(1) };
        chart.draw_series(marks.iter().map(|m| Circle::new((m.t_s, m.rpm), 3, style(m))))?;
    }
    area.present()
}

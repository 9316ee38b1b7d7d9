//! The view in the terminal.

use std::time::Duration;

use evtach_firmware::instrument::Number;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize as _};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Cell, Chart, Dataset, GraphType, Paragraph, Row, Table};

use super::Monitor;
use crate::measure::{ReadingRow, RotorRow};

/// Standard deviations that cover 95 %.
const COVER: f64 = 1.96;

/// Draws everything; `now` is the time since the start.
pub fn draw(frame: &mut Frame<'_>, monitor: &Monitor, now: Duration) {
    let rotors = monitor.latest(now).map_or(0, |(reading, _)| reading.rotors.len()).max(1) as u16;
    let [top, speed, trend, table, bottom] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(3),
        Constraint::Min(6),
        Constraint::Length(rotors + 3),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    let latest = monitor.latest(now);
    frame.render_widget(title(monitor, latest), top);
    let rotor = monitor.rotor().filter(|_| !monitor.is_gone(now));
    frame.render_widget(speed_line(rotor, latest), speed);
    draw_trend(frame, monitor, trend);
    if let Some((reading, _)) = latest {
        frame.render_widget(rotor_table(reading), table);
    }
    let keys =
        Line::from(vec!["q".bold(), " quit   ".into(), "Tab".bold(), " next rotor   ".into()]);
    let [left, right] =
        Layout::horizontal([Constraint::Length(24), Constraint::Min(0)]).areas(bottom);
    frame.render_widget(keys, left);
    frame.render_widget(Line::from(monitor.note().fg(Color::Yellow)), right);
}

fn title<'m>(monitor: &'m Monitor, latest: Option<(&ReadingRow, bool)>) -> Line<'m> {
    let mut spans = vec!["evtach watch ".bold(), monitor.name().into()];
    if let Some((reading, fresh)) = latest {
        let word =
            if fresh { word(&reading.status, reading.reason.as_deref()) } else { "held".into() };
        spans.push(format!("   {:.1} s   ", reading.t_s).fg(Color::DarkGray));
        spans.push(Span::styled(word, Style::new().fg(colour(&reading.status, fresh))));
    }
    spans.into()
}

/// "locked", "coarse", or why there is no speed.
fn word(status: &str, reason: Option<&str>) -> String {
    reason.unwrap_or(status).replace('_', " ")
}

fn colour(status: &str, fresh: bool) -> Color {
    match status {
        _ if !fresh => Color::DarkGray,
        "locked" => Color::Green,
        "coarse" => Color::Yellow,
        _ => Color::Red,
    }
}

/// The speed of the rotor chosen, or dashes.
fn speed_line<'m>(rotor: Option<&RotorRow>, latest: Option<(&ReadingRow, bool)>) -> Paragraph<'m> {
    let (value, error) = rotor.and_then(digits).unzip();
    let fresh = latest.is_some_and(|(_, fresh)| fresh);
    let style = if fresh { Style::new().bold() } else { Style::new().fg(Color::DarkGray) };
    let mut spans = vec![Span::styled(value.unwrap_or_else(|| "-----".into()), style)];
    if let (Some(error), Some(rotor)) = (error, rotor) {
        spans.push(format!(" ± {error} rpm").into());
        spans.push(format!("   {}", turning(rotor)).into());
    } else {
        spans.push(" rpm".into());
    }
    let name = rotor.map_or("speed".to_owned(), |rotor| format!("rotor {}", rotor.id));
    Paragraph::new(Line::from(spans)).block(Block::bordered().title(name))
}

/// Value and error with the digits that the device shows.
fn digits(rotor: &RotorRow) -> Option<(String, String)> {
    let (rpm, sigma) = (rotor.rpm? as f32, rotor.rpm_sigma? as f32);
    Some((Number::supported(rpm, sigma)?.to_string(), Number::of_error(sigma)?.to_string()))
}

fn turning(rotor: &RotorRow) -> String {
    let blades = rotor.blades.map_or(String::new(), |blades| format!("  {blades} blades"));
    format!("{}{blades}", rotor.direction.as_deref().unwrap_or(""))
}

fn draw_trend(frame: &mut Frame<'_>, monitor: &Monitor, area: Rect) {
    let trend = monitor.trend();
    let block = Block::bordered().title("trend, rpm");
    let (Some((from_s, ..)), Some((to_s, ..))) = (trend.first(), trend.last()) else {
        frame.render_widget(block, area);
        return;
    };
    let low = trend.iter().map(|(_, rpm, sigma)| rpm - COVER * sigma).fold(f64::MAX, f64::min);
    let high = trend.iter().map(|(_, rpm, sigma)| rpm + COVER * sigma).fold(f64::MIN, f64::max);
    let margin = ((high - low) * 0.1).max(0.01);
    let (low, high) = (low - margin, high + margin);
    let line: Vec<(f64, f64)> = trend.iter().map(|(t_s, rpm, _)| (*t_s, *rpm)).collect();
    let edges: Vec<(f64, f64)> = trend
        .iter()
        .flat_map(|(t_s, rpm, s)| [(*t_s, rpm - COVER * s), (*t_s, rpm + COVER * s)])
        .collect();
    let dots = |data, colour| {
        Dataset::default()
            .marker(Marker::Braille)
            .graph_type(GraphType::Scatter)
            .style(Style::new().fg(colour))
            .data(data)
    };
    let decimals = if high - low < 10.0 { 2 } else { 0 };
    let to_s = to_s.max(from_s + 1.0);
    let chart = Chart::new(vec![dots(&edges, Color::DarkGray), dots(&line, Color::Cyan)])
        .block(block)
        .x_axis(
            Axis::default()
                .bounds([*from_s, to_s])
                .labels([format!("{from_s:.1} s"), format!("{to_s:.1} s")]),
        )
        .y_axis(
            Axis::default()
                .bounds([low, high])
                .labels([format!("{low:.decimals$}"), format!("{high:.decimals$}")]),
        );
    frame.render_widget(chart, area);
}

fn rotor_table(reading: &ReadingRow) -> Table<'_> {
    let rows = reading.rotors.iter().map(|rotor| {
        let (value, error) = digits(rotor).unwrap_or_else(|| ("-----".into(), String::new()));
        Row::new([
            Cell::from(rotor.id.as_str()),
            Cell::from(format!("{value:>9}")),
            Cell::from(error),
            Cell::from(turning(rotor)),
            Cell::from(format!("({:.0}, {:.0}) r {:.0}", rotor.x_px, rotor.y_px, rotor.radius_px)),
            Cell::from(word(&rotor.status, rotor.reason.as_deref()))
                .style(Style::new().fg(colour(&rotor.status, true))),
        ])
    });
    let widths = [2, 9, 6, 14, 18, 14].map(Constraint::Length);
    let header = ["", "      rpm", "±", "turning", "place, px", "state"];
    let header = Row::new(header).style(Style::new().add_modifier(Modifier::DIM));
    Table::new(rows, widths).header(header).block(Block::bordered().title("rotors"))
}

#[cfg(test)]
mod tests;

//! The last readings of the rotor shown, each with 95 % of its error, and its revolutions.

use core::fmt::Write as _;

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use heapless::String;

use super::text::{self, Align, Ink, SMALL};
use super::theme::{ACCENT, ACCENT_ZONE, BACK, DIM, PANEL, area};
use crate::instrument::{Trend, TrendPoint, View};

const PLOT: Rectangle = area(318, 161, 154, 74);
const BASELINE: i32 = 155;
/// Shortest time from edge to edge, in microseconds.
const SHORTEST_US: u64 = 2_000_000;
/// Standard deviations that cover 95 %.
const COVER: f32 = 1.96;

pub fn changed(a: &View, b: &View) -> bool {
    let of = |v: &View| (v.trend, v.statistics.map(|statistics| statistics.turns_tenths));
    of(a) != of(b)
}

pub fn draw<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    trend: &Trend,
    view: &View,
) -> Result<(), D::Error> {
    target.fill_solid(&area(314, 143, 166, 18), BACK)?;
    target.fill_solid(&PLOT, PANEL)?;
    let ink = Ink { colour: DIM, paper: BACK };
    let left = Point::new(PLOT.top_left.x, BASELINE);
    let right = Point::new(PLOT.top_left.x + PLOT.size.width as i32, BASELINE);
    if let Some(statistics) = view.statistics {
        let mut turns = String::<24>::new();
        let tenths = statistics.turns_tenths;
        write!(turns, "{}.{} turns", tenths / 10, tenths % 10).ok();
        text::draw(target, &SMALL, &turns, left, Align::Left, ink)?;
    }
    let Some(scale) = Scale::of(trend) else { return Ok(()) };
    let mut span = String::<16>::new();
    write!(span, "{} s", (scale.span_us + 500_000) / 1_000_000).ok();
    text::draw(target, &SMALL, &span, right, Align::Right, ink)?;
    for point in trend.points() {
        let x = scale.x(point.t_us);
        let (top, bottom) = (scale.y(upper(point)), scale.y(lower(point)));
        target.fill_solid(&area(x, top, 2, (bottom - top + 1) as u32), ACCENT_ZONE)?;
    }
    for point in trend.points() {
        target.fill_solid(&area(scale.x(point.t_us), scale.y(point.rpm), 2, 2), ACCENT)?;
    }
    Ok(())
}

fn upper(point: &TrendPoint) -> f32 {
    point.rpm + COVER * point.rpm_sigma
}

fn lower(point: &TrendPoint) -> f32 {
    point.rpm - COVER * point.rpm_sigma
}

/// From readings to pixels.
struct Scale {
    to_us: u64,
    span_us: u64,
    top_rpm: f32,
    px_per_rpm: f32,
}

impl Scale {
    /// So that all readings fit with their errors.
    fn of(trend: &Trend) -> Option<Self> {
        let (first, last) = (trend.points().next()?, trend.points().last()?);
        let top_rpm = trend.points().map(upper).fold(f32::MIN, f32::max);
        let bottom_rpm = trend.points().map(lower).fold(f32::MAX, f32::min);
        let room_px = PLOT.size.height as f32 - 8.0;
        Some(Self {
            to_us: last.t_us,
            span_us: (last.t_us - first.t_us).max(SHORTEST_US),
            top_rpm,
            px_per_rpm: room_px / (top_rpm - bottom_rpm).max(1e-3),
        })
    }

    /// Left pixel of a reading's two.
    fn x(&self, t_us: u64) -> i32 {
        let room = u64::from(PLOT.size.width) - 4;
        let before = (self.to_us - t_us) * room / self.span_us;
        PLOT.top_left.x + 2 + (room - before.min(room)) as i32 - 1
    }

    fn y(&self, rpm: f32) -> i32 {
        let below = (self.top_rpm - rpm) * self.px_per_rpm;
        PLOT.top_left.y + 3 + (below as i32).clamp(0, PLOT.size.height as i32 - 6)
    }
}

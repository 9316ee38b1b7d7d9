//! The strip at the top: mode, state, time, alarm, and how many events arrive.

use core::fmt::Write as _;

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use heapless::String;

use super::text::{self, Align, Ink, SMALL, width};
use super::theme::{self, ACCENT, BACK, BAD, BAD_ZONE, DIM, GOOD, PANEL, TEXT, WARN, area};
use crate::instrument::{Beyond, Mode, Rate, SATURATION_EV_S, View};

const BASELINE: i32 = 19;
/// The bar of the event rate.
const BAR: (i32, i32, u32, u32) = (364, 10, 108, 8);
/// Rates at its ends, in events a second.
const BAR_EV_S: (u32, u32) = (1_000, 10_000_000);

pub fn changed(a: &View, b: &View) -> bool {
    let of = |v: &View| (v.mode, v.state, v.time_tenths, v.alarm, v.rate);
    of(a) != of(b)
}

pub fn draw<D: DrawTarget<Color = Rgb565>>(target: &mut D, view: &View) -> Result<(), D::Error> {
    target.fill_solid(&area(0, 0, 480, 28), BACK)?;
    let mut x = 8;
    let (colour, paper) = match view.mode {
        Mode::Live => (TEXT, PANEL),
        Mode::Hold => (BACK, WARN),
        Mode::Max | Mode::Min | Mode::Mean => (BACK, ACCENT),
    };
    x = chip(target, x, view.mode.as_str(), Ink { colour, paper })?;
    let ink = Ink { colour: theme::of_state(view.state), paper: BACK };
    let word = view.state.word();
    text::draw(target, &SMALL, word, Point::new(x, BASELINE), Align::Left, ink)?;
    x += width(&SMALL, word) + 12;
    if let Some((id, beyond)) = view.alarm {
        let mut words = String::<20>::new();
        let side = match beyond {
            Beyond::Low => "LOW",
            Beyond::High => "HIGH",
        };
        write!(words, "ALARM {} {side}", theme::letter(id)).ok();
        chip(target, x, &words, Ink { colour: BACK, paper: BAD })?;
    } else if let Some(tenths) = view.time_tenths {
        let mut time = String::<24>::new();
        write!(time, "{}.{} s", tenths / 10, tenths % 10).ok();
        let ink = Ink { colour: DIM, paper: BACK };
        text::draw(target, &SMALL, &time, Point::new(x, BASELINE), Align::Left, ink)?;
    }
    draw_rate(target, view.rate)
}

/// A word on a coloured ground; where the next one begins.
fn chip<D: DrawTarget<Color = Rgb565>>(
    target: &mut D,
    x: i32,
    word: &str,
    ink: Ink,
) -> Result<i32, D::Error> {
    let wide = width(&SMALL, word) + 12;
    theme::fill_round(target, area(x, 4, wide as u32, 20), ink.paper)?;
    text::draw(target, &SMALL, word, Point::new(x + 6, BASELINE), Align::Left, ink)?;
    Ok(x + wide + 10)
}

/// Rate in words and as a bar on a logarithmic scale, with the zone in which the device cannot use all events.
fn draw_rate<D: DrawTarget<Color = Rgb565>>(target: &mut D, rate: Rate) -> Result<(), D::Error> {
    let full = rate.events_per_s >= SATURATION_EV_S || rate.lost_permille > 0;
    let mut words = String::<24>::new();
    let colour = if rate.lost_permille > 0 {
        write!(words, "lost {}.{} %", rate.lost_permille / 10, rate.lost_permille % 10).ok();
        BAD
    } else {
        write_rate(&mut words, rate.events_per_s);
        DIM
    };
    let (x, y, wide, high) = BAR;
    let ink = Ink { colour, paper: BACK };
    text::draw(target, &SMALL, &words, Point::new(x - 8, BASELINE), Align::Right, ink)?;
    let zone = along(SATURATION_EV_S, wide);
    let filled = along(rate.events_per_s, wide);
    target.fill_solid(&area(x, y, zone, high), PANEL)?;
    target.fill_solid(&area(x + zone as i32, y, wide - zone, high), BAD_ZONE)?;
    target.fill_solid(&area(x, y, filled, high), if full { BAD } else { GOOD })
}

/// Pixels from the left end of the bar to a rate.
fn along(events_per_s: u32, wide: u32) -> u32 {
    let (least, most) = BAR_EV_S;
    let above = log2_times_256(events_per_s.clamp(least, most)) - log2_times_256(least);
    above * wide / (log2_times_256(most) - log2_times_256(least))
}

/// 256 times the binary logarithm, by straight lines between powers of two: 9 % of an octave off at most.
const fn log2_times_256(value: u32) -> u32 {
    let octave = value.ilog2();
    let within = ((value as u64) << 8 >> octave) as u32 - 256;
    (octave << 8) + within
}

/// A rate with three digits.
pub fn write_rate(words: &mut String<24>, events_per_s: u32) {
    let (scale, unit) = match events_per_s {
        0..1_000 => {
            write!(words, "{events_per_s} ev/s").ok();
            return;
        }
        1_000..1_000_000 => (1_000, "kev/s"),
        _ => (1_000_000, "Mev/s"),
    };
    let whole = events_per_s / scale;
    let hundredths = events_per_s % scale * 100 / scale;
    match whole {
        0..10 => write!(words, "{whole}.{hundredths:02} {unit}"),
        10..100 => write!(words, "{whole}.{} {unit}", hundredths / 10),
        _ => write!(words, "{whole} {unit}"),
    }
    .ok();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_have_three_digits() {
        for (rate, text) in [
            (0, "0 ev/s"),
            (999, "999 ev/s"),
            (1_000, "1.00 kev/s"),
            (12_345, "12.3 kev/s"),
            (999_999, "999 kev/s"),
            (1_020_000, "1.02 Mev/s"),
            (u32::MAX, "4294 Mev/s"),
        ] {
            let mut words = String::new();
            write_rate(&mut words, rate);
            assert_eq!(words, text);
        }
    }

    #[test]
    fn the_bar_is_logarithmic_and_ends_at_its_ends() {
        let (_, _, wide, _) = BAR;
        assert_eq!(
            [0, 1_000, 10_000_000, u32::MAX].map(|rate| along(rate, wide)),
            [0, 0, wide, wide]
        );
        for (rate, quarter) in [(10_000, 1), (100_000, 2), (1_000_000, 3)] {
            assert!(along(rate, wide).abs_diff(quarter * wide / 4) <= 1, "{rate}");
        }
    }
}

//! A part of a recording, as people state it.

use std::ops::Range;

use anyhow::bail;
use evtach_core::Roi;

/// Options of the subcommands that may read a part.
#[derive(clap::Args, Clone, Copy, Default)]
pub struct Span {
    /// Leave out what comes before this many seconds from the first event.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    start: Option<f64>,
    /// Leave out what comes this many seconds from the first event, or later.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    end: Option<f64>,
}

impl Span {
    /// Microseconds from the first event.
    ///
    /// # Errors
    /// When nothing lies between the two.
    pub fn since_us(self) -> anyhow::Result<Range<u64>> {
        let micros = |seconds: f64| (seconds * 1e6).round() as u64;
        let since_us = self.start.map_or(0, micros)..self.end.map_or(u64::MAX, micros);
        if since_us.is_empty() {
            let Self { start, end } = self;
            let (start_s, end_s) = (start.unwrap_or_default(), end.unwrap_or_default());
            bail!("--start {start_s} does not lie before --end {end_s}; nothing is between them");
        }
        Ok(since_us)
    }

    /// The part of a recording that this and a region leave, in words; `None` where nothing was stated.
    pub fn part(self, roi: Option<Roi>) -> Option<String> {
        let span = match (self.start, self.end) {
            (Some(_), Some(_)) => Some("between --start and --end"),
            (Some(_), None) => Some("from --start on"),
            (None, Some(_)) => Some("before --end"),
            (None, None) => None,
        };
        let stated: Vec<&str> = span.into_iter().chain(roi.map(|_| "inside --roi")).collect();
        (!stated.is_empty()).then(|| stated.join(" "))
    }
}

/// A time of a recording, which is a number and not negative.
pub fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| seconds.is_finite() && *seconds >= 0.0);
    seconds.ok_or_else(|| format!("\"{text}\" is no time; write seconds from 0 on, as 1.5"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_checked() {
        assert_eq!(parse_seconds("0.05"), Ok(0.05));
        for text in ["", "-1", "nan", "inf", "1s"] {
            assert!(parse_seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_span_ends_behind_its_start() {
        let since = |start, end| Span { start, end }.since_us().ok();
        assert_eq!(since(None, None), Some(0..u64::MAX));
        assert_eq!(since(Some(0.1), Some(0.2)), Some(100_000..200_000));
        for (start, end) in [(Some(0.2), Some(0.1)), (Some(0.2), Some(0.2)), (None, Some(0.0))] {
            assert_eq!(since(start, end), None);
        }
    }
}

//! A part of a recording, as people state it.

use std::ops::Range;

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
    /// Whether nothing was stated.
    pub const fn is_all(self) -> bool {
        self.start.is_none() && self.end.is_none()
    }

    /// Microseconds from the first event.
    pub fn since_us(self) -> Range<u64> {
        let micros = |seconds: f64| (seconds * 1e6).round() as u64;
        self.start.map_or(0, micros)..self.end.map_or(u64::MAX, micros)
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
}

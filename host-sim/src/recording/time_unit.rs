//! The unit of times that come as bare numbers.

/// In microseconds this is beyond the year 5000; in nanoseconds since 1970 it is 1973.
const LEAST_NANOSECONDS: f64 = 1e17;

/// Unit of the times in a text or NumPy recording, which may not say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum TimeUnit {
    /// Seconds.
    #[value(name = "s")]
    Seconds,
    /// Milliseconds.
    #[value(name = "ms")]
    Milliseconds,
    /// Microseconds.
    #[value(name = "us")]
    Microseconds,
    /// Nanoseconds.
    #[value(name = "ns")]
    Nanoseconds,
}

impl TimeUnit {
    /// Power of ten from this unit to microseconds.
    pub(crate) const fn exponent(self) -> i32 {
        match self {
            Self::Seconds => 6,
            Self::Milliseconds => 3,
            Self::Microseconds => 0,
            Self::Nanoseconds => -3,
        }
    }

    /// Seconds are told by fractions finer than a millisecond between events closer than one second, nanoseconds since 1970 by their size.
    pub(crate) fn from_times(times: &[f64]) -> Self {
        let fractional = times.iter().any(|t| (t * 1e3).fract() != 0.0 && t.fract() != 0.0);
        let step = match (times.first(), times.last()) {
            (Some(first), Some(last)) => (last - first).abs() / times.len() as f64,
            _ => 0.0,
        };
        if fractional && step < 1.0 {
            Self::Seconds
        } else if times.iter().all(|t| *t >= LEAST_NANOSECONDS) && !times.is_empty() {
            Self::Nanoseconds
        } else {
            Self::Microseconds
        }
    }

    /// Word for people.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Seconds => "seconds",
            Self::Milliseconds => "milliseconds",
            Self::Microseconds => "microseconds",
            Self::Nanoseconds => "nanoseconds",
        }
    }

    /// The unit of a recording's times, and a sentence on it: as the person stated, else as told `by` what holds the times, else as the
    /// first of them look.
    pub(crate) fn settle(
        stated: Option<Self>,
        told: Option<Self>,
        by: &str,
        seen: Self,
    ) -> (Self, String) {
        let (unit, how) = match (stated, told) {
            (Some(unit), _) => (unit, "as given by --time-unit".to_owned()),
            (None, Some(unit)) => (unit, format!("as its {by} says")),
            (None, None) => (seen, "from the first events; --time-unit overrides".to_owned()),
        };
        (unit, format!("time in {}, {how}", unit.name()))
    }
}

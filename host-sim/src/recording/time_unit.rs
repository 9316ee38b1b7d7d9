//! The unit of times that come as bare numbers.

use super::error::RecordingError;

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

    /// The unit that bare times look to be in. Whole numbers are microseconds, or nanoseconds since 1970 by their size;
    /// fractions finer than a thousandth are seconds. Thousandths are milliseconds where a camera could not send that many
    /// events a microsecond, microseconds where it would send less than one a millisecond; between the two they may be
    /// either: `None`.
    ///
    /// `epsilon` is the relative precision of the numbers.
    pub(crate) fn from_times(times: &[f64], epsilon: f64) -> Option<Self> {
        let times: Vec<f64> = times.iter().copied().filter(|t| t.is_finite()).collect();
        let first = times.first().copied().unwrap_or_default();
        let last = times.last().copied().unwrap_or_default();
        let step = (last - first).abs() / times.len().max(1) as f64;
        if times.iter().all(|t| t.fract() == 0.0) {
            let since_1970 = !times.is_empty() && times.iter().all(|t| *t >= LEAST_NANOSECONDS);
            return Some(if since_1970 { Self::Nanoseconds } else { Self::Microseconds });
        }
        let thousandths = times.iter().map(|t| t.abs() * 1e3);
        let rounding = thousandths.clone().fold(0.0, f64::max) * epsilon;
        let finer = thousandths.into_iter().any(|t| (t - t.round()).abs() > rounding.max(1e-4));
        match step {
            _ if rounding > 0.1 => None,
            1.0.. => Some(Self::Microseconds),
            _ if finer => Some(Self::Seconds),
            ..0.01 => Some(Self::Milliseconds),
            _ => None,
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

    /// The unit of a recording's times, and a sentence on it: as the person stated, else as told `by` what holds the times, else as
    /// `seen` from the first of them.
    ///
    /// # Errors
    /// When none of the three says.
    pub(crate) fn settle(
        stated: Option<Self>,
        told: Option<Self>,
        by: &str,
        seen: Option<Self>,
    ) -> Result<(Self, String), RecordingError> {
        let (unit, how) = match (stated, told, seen) {
            (Some(unit), _, _) => (unit, "as given by --time-unit".to_owned()),
            (None, Some(unit), _) => (unit, format!("as its {by} says")),
            (None, None, Some(unit)) => {
                (unit, "from the first events; --time-unit overrides".to_owned())
            }
            (None, None, None) => {
                return Err(RecordingError::Unsupported {
                    what: "the unit of the times is not told, and may be more than one".to_owned(),
                    advice: format!(
                        "give --time-unit s, ms, us or ns, or name the {by} t_ms or t_us"
                    ),
                });
            }
        };
        Ok((unit, format!("time in {}, {how}", unit.name())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times from 40 ms on, at a rate, as they read in a unit with so many decimals.
    fn written(events_a_second: f64, units_a_second: f64, decimals: usize) -> Vec<f64> {
        (0..256)
            .filter_map(|event| {
                let second = 0.04 + f64::from(event) / events_a_second;
                format!("{:.decimals$}", second * units_a_second).parse().ok()
            })
            .collect()
    }

    #[test]
    fn fractions_tell_seconds_from_milliseconds() {
        for rate in [2.3e3, 1.1e4, 2.1e5, 1.3e6, 1.7e7] {
            let seen = |per_second, decimals| {
                TimeUnit::from_times(&written(rate, per_second, decimals), f64::EPSILON)
            };
            assert_eq!(seen(1.0, 6), Some(TimeUnit::Seconds), "{rate}");
            assert_eq!(seen(1.0, 9), Some(TimeUnit::Seconds), "{rate}");
            assert_eq!(seen(1e6, 0), Some(TimeUnit::Microseconds), "{rate}");
            // At 11 000 events a second, milliseconds may be microseconds at 11 million.
            let milliseconds = (rate > 1e5).then_some(TimeUnit::Milliseconds);
            assert_eq!(seen(1e3, 3), milliseconds, "{rate}");
        }
        let slow = TimeUnit::from_times(&written(5e5, 1e6, 3), f64::EPSILON);
        assert_eq!(slow, Some(TimeUnit::Microseconds));
    }

    #[test]
    fn what_single_precision_has_rounded_is_no_fraction() {
        let rounded = |per_second, decimals| {
            let times = written(1e6, per_second, decimals);
            let times: Vec<f64> = times.iter().map(|t| f64::from(*t as f32)).collect();
            TimeUnit::from_times(&times, f32::EPSILON.into())
        };
        assert_eq!(rounded(1e3, 3), Some(TimeUnit::Milliseconds));
        assert_eq!(rounded(1.0, 6), Some(TimeUnit::Seconds));
        let late: Vec<f64> =
            written(1e6, 1e3, 3).iter().map(|t| f64::from((t + 60e3) as f32)).collect();
        assert_eq!(TimeUnit::from_times(&late, f32::EPSILON.into()), None);
    }
}

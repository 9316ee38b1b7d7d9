//! Speeds in the unit that the person chose.

use evtach_core::Speed;

use super::error::ErrorCode;
use crate::instrument::Unit;

/// The word for a unit, in queries and as a parameter.
#[must_use]
pub const fn word(unit: Unit) -> &'static str {
    match unit {
        Unit::Rpm => "RPM",
        Unit::Hertz => "HZ",
        Unit::RadPerS => "RADS",
        Unit::MsPerTurn => "MS",
    }
}

/// The unit of a word or of a number's suffix, and how many of it the suffix stands for.
fn named(name: &[u8]) -> Option<(Unit, f32)> {
    [
        ("RPM", Unit::Rpm, 1.0),
        ("KRPM", Unit::Rpm, 1e3),
        ("HZ", Unit::Hertz, 1.0),
        ("KHZ", Unit::Hertz, 1e3),
        ("RADS", Unit::RadPerS, 1.0),
        ("RAD/S", Unit::RadPerS, 1.0),
        ("MS", Unit::MsPerTurn, 1.0),
        ("S", Unit::MsPerTurn, 1e3),
    ]
    .into_iter()
    .find_map(|(text, unit, scale)| {
        name.eq_ignore_ascii_case(text.as_bytes()).then_some((unit, scale))
    })
}

/// The unit that a word names.
pub fn unit(name: &[u8]) -> Option<Unit> {
    named(name).filter(|&(_, scale)| scale == 1.0).map(|(unit, _)| unit)
}

/// A number with a suffix in rpm; without a suffix it is in `unit`.
pub fn to_rpm(value: f32, suffix: &[u8], unit: Unit) -> Result<f32, ErrorCode> {
    let (unit, scale) = if suffix.is_empty() {
        (unit, 1.0)
    } else {
        named(suffix).ok_or(ErrorCode::InvalidSuffix)?
    };
    let value = value * scale;
    let rpm = match unit {
        Unit::Rpm => value,
        Unit::Hertz => value * 60.0,
        Unit::RadPerS => value * Speed::RPM_PER_RAD_S,
        Unit::MsPerTurn => 60e3 / value,
    };
    if rpm.is_finite() { Ok(rpm) } else { Err(ErrorCode::DataOutOfRange) }
}

/// Revolutions per minute in this unit; `None` for the time of a turn at rest.
#[must_use]
pub fn in_unit(rpm: f32, unit: Unit) -> Option<f32> {
    match unit {
        Unit::Rpm => Some(rpm),
        Unit::Hertz => Some(rpm / 60.0),
        Unit::RadPerS => Some(rpm / Speed::RPM_PER_RAD_S),
        Unit::MsPerTurn => (rpm > 0.0).then(|| 60e3 / rpm),
    }
}

/// The standard error of a speed in this unit.
#[must_use]
pub fn sigma_in_unit(speed: &Speed, unit: Unit) -> Option<f32> {
    match unit {
        Unit::MsPerTurn => {
            in_unit(speed.rpm(), unit).map(|ms| ms * (speed.rpm_sigma() / speed.rpm()))
        }
        Unit::Rpm | Unit::Hertz | Unit::RadPerS => in_unit(speed.rpm_sigma(), unit),
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::Frame;

    use super::*;

    #[test]
    fn one_speed_in_every_unit() {
        for (unit, expected) in [
            (Unit::Rpm, 3000.0),
            (Unit::Hertz, 50.0),
            (Unit::RadPerS, 314.159_27),
            (Unit::MsPerTurn, 20.0),
        ] {
            let found = in_unit(3000.0, unit).expect("a speed");
            assert!((found / expected - 1.0).abs() < 1e-6, "{unit:?}: {found}");
            let rpm = to_rpm(expected, b"", unit).expect("a limit");
            assert!((rpm / 3000.0 - 1.0).abs() < 1e-6, "{unit:?}: {rpm}");
        }
        assert_eq!(in_unit(0.0, Unit::MsPerTurn), None);
        assert_eq!(to_rpm(1.5, b"krpm", Unit::Hertz), Ok(1500.0));
        assert_eq!(to_rpm(1.5, b"V", Unit::Hertz), Err(ErrorCode::InvalidSuffix));
        assert_eq!(to_rpm(0.0, b"MS", Unit::Hertz), Err(ErrorCode::DataOutOfRange));
    }

    #[test]
    fn sigma_keeps_its_share_of_the_speed() {
        let speed = Speed {
            omega_rad_s: -100.0,
            omega_sigma_rad_s: 0.5,
            alpha_rad_s2: None,
            frame: Frame::Camera,
        };
        for unit in [Unit::Rpm, Unit::Hertz, Unit::RadPerS, Unit::MsPerTurn] {
            let value = in_unit(speed.rpm(), unit).expect("a speed");
            let sigma = sigma_in_unit(&speed, unit).expect("a sigma");
            assert!((sigma / value - 0.005).abs() < 1e-7, "{unit:?}");
        }
    }
}

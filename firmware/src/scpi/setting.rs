//! What can be set: `UNIT`, `SENSe` and `CALCulate:LIMit`.

use evtach_core::Roi;

use super::commands::{Setting, Side};
use super::device::{Device, View};
use super::error::{ErrorCode, ScpiError};
use super::header::is_word;
use super::parameter::{Parameter, Parameters};
use super::response::Response;
use super::seconds::Seconds;
use super::speed;
use crate::instrument::{MAX_BLADES, MAX_TRIM_PPM, Preferences};

/// Largest limit in rpm.
const MAX_RPM: f32 = 1e6;
/// Shortest and longest window in seconds.
const WINDOW_S: (f32, f32) = (0.01, 2.0);

/// Carries out the command that sets.
pub fn set(
    setting: Setting,
    parameters: &mut Parameters<'_>,
    device: &mut impl Device,
) -> Result<(), ScpiError> {
    let old = device.preferences();
    let new = match setting {
        Setting::Roi => return set_roi(parameters, device),
        Setting::Window => return set_window(parameters, device),
        Setting::Unit => {
            let (parameter, place) = parameters.required()?;
            let unit = match parameter {
                Parameter::Word(word) => speed::unit(word).ok_or(ErrorCode::InvalidCharacterData),
                Parameter::Number(..) => Err(ErrorCode::DataType),
            };
            Preferences { unit: unit.map_err(|code| ScpiError::at(code, place))?, ..old }
        }
        Setting::Blades => Preferences { blades: blades(parameters)?, ..old },
        Setting::Clock => {
            let (parameter, place) = parameters.required()?;
            let ppm = match parameter {
                Parameter::Number(ppm, unit) if unit.is_empty() || is_word(unit, "PPM") => {
                    let near = (-MAX_TRIM_PPM..=MAX_TRIM_PPM).contains(&ppm);
                    near.then_some(ppm).ok_or(ErrorCode::DataOutOfRange)
                }
                Parameter::Number(..) => Err(ErrorCode::InvalidSuffix),
                Parameter::Word(_) => Err(ErrorCode::DataType),
            };
            let clock_trim_ppm = ppm.map_err(|code| ScpiError::at(code, place))?;
            Preferences { clock_trim_ppm, ..old }
        }
        Setting::Limit(side) => {
            let (parameter, place) = parameters.required()?;
            let rpm = match parameter {
                Parameter::Number(value, suffix) => speed::to_rpm(value, suffix, old.unit),
                Parameter::Word(_) => Err(ErrorCode::DataType),
            }
            .and_then(|rpm| {
                let within = rpm > 0.0 && rpm <= MAX_RPM;
                within.then_some(rpm).ok_or(ErrorCode::DataOutOfRange)
            })
            .map_err(|code| ScpiError::at(code, place))?;
            with_limit(old, side, Some(rpm))
        }
        Setting::LimitState(side) => {
            let mut ahead = *parameters;
            let (_, place) = ahead.required()?;
            match (parameters.switch()?, limit(&old, side)) {
                (true, None) => return Err(ScpiError::at(ErrorCode::SettingsConflict, place)),
                (true, Some(_)) => old,
                (false, _) => with_limit(old, side, None),
            }
        }
    };
    parameters.end()?;
    change(device, new);
    Ok(())
}

/// Sets preferences that differ: a flash wears.
pub fn change(device: &mut impl Device, new: Preferences) {
    if new != device.preferences() {
        device.set_preferences(new);
    }
}

const fn limit(preferences: &Preferences, side: Side) -> Option<f32> {
    match side {
        Side::Lower => preferences.alarm.low_rpm,
        Side::Upper => preferences.alarm.high_rpm,
    }
}

const fn with_limit(mut preferences: Preferences, side: Side, rpm: Option<f32>) -> Preferences {
    match side {
        Side::Lower => preferences.alarm.low_rpm = rpm,
        Side::Upper => preferences.alarm.high_rpm = rpm,
    }
    preferences
}

fn blades(parameters: &mut Parameters<'_>) -> Result<Option<u8>, ScpiError> {
    let mut ahead = *parameters;
    let (parameter, place) = ahead.required()?;
    match parameter {
        Parameter::Word(word) if is_word(word, "AUTO") => {
            *parameters = ahead;
            Ok(None)
        }
        Parameter::Word(_) => Err(ScpiError::at(ErrorCode::InvalidCharacterData, place)),
        Parameter::Number(..) => match parameters.integer(MAX_BLADES.into())? {
            0 => Err(ScpiError::at(ErrorCode::DataOutOfRange, place)),
            blades => Ok(Some(blades as u8)),
        },
    }
}

fn set_roi(parameters: &mut Parameters<'_>, device: &mut impl Device) -> Result<(), ScpiError> {
    let mut ahead = *parameters;
    let (first, place) = ahead.required()?;
    let view = device.view();
    let roi = match first {
        Parameter::Word(word) if is_word(word, "FULL") => {
            *parameters = ahead;
            None
        }
        Parameter::Word(_) => {
            return Err(ScpiError::at(ErrorCode::InvalidCharacterData, place));
        }
        Parameter::Number(..) => {
            let mut side = || parameters.integer(evtach_core::Geometry::MAX_PX);
            let (x, y, width_px, height_px) = (side()?, side()?, side()?, side()?);
            let geometry =
                device.geometry().ok_or(ScpiError::at(ErrorCode::SettingsConflict, place))?;
            if width_px == 0
                || height_px == 0
                || x + width_px > geometry.width_px
                || y + height_px > geometry.height_px
            {
                return Err(ScpiError::at(ErrorCode::DataOutOfRange, place));
            }
            Some(Roi { x, y, width_px, height_px })
        }
    };
    parameters.end()?;
    device.set_view(View { roi, ..view });
    Ok(())
}

fn set_window(parameters: &mut Parameters<'_>, device: &mut impl Device) -> Result<(), ScpiError> {
    let (parameter, place) = parameters.required()?;
    let seconds = match parameter {
        Parameter::Word(word) if is_word(word, "AUTO") => Ok(None),
        Parameter::Word(_) => Err(ErrorCode::InvalidCharacterData),
        Parameter::Number(value, unit) => match unit {
            b"" => Ok(1.0),
            unit if is_word(unit, "S") => Ok(1.0),
            unit if is_word(unit, "MS") => Ok(1e-3),
            unit if is_word(unit, "US") => Ok(1e-6),
            _ => Err(ErrorCode::InvalidSuffix),
        }
        .and_then(|scale| {
            let seconds = value * scale;
            let within = (WINDOW_S.0..=WINDOW_S.1).contains(&seconds);
            within.then_some(Some(seconds)).ok_or(ErrorCode::DataOutOfRange)
        }),
    }
    .map_err(|code| ScpiError::at(code, place))?;
    parameters.end()?;
    let window_us = seconds.map(|seconds| (seconds * 1e6 + 0.5) as u32);
    device.set_view(View { window_us, ..device.view() });
    Ok(())
}

/// Carries out the query.
pub fn get(setting: Setting, device: &impl Device, out: &mut Response) {
    let preferences = device.preferences();
    match setting {
        Setting::Unit => out.plain(speed::word(preferences.unit)),
        Setting::Blades => match preferences.blades {
            Some(blades) => out.plain(blades),
            None => out.plain("AUTO"),
        },
        Setting::Clock => out.number(Some(preferences.clock_trim_ppm)),
        Setting::Limit(side) => {
            let rpm = limit(&preferences, side);
            out.number(rpm.and_then(|rpm| speed::in_unit(rpm, preferences.unit)));
        }
        Setting::LimitState(side) => out.plain(u8::from(limit(&preferences, side).is_some())),
        Setting::Roi => match device.view().roi {
            Some(Roi { x, y, width_px, height_px }) => {
                [x, y, width_px, height_px].into_iter().for_each(|side| out.plain(side));
            }
            None => out.plain("FULL"),
        },
        Setting::Window => match device.view().window_us {
            Some(window_us) => out.plain(Seconds(u64::from(window_us))),
            None => out.plain("AUTO"),
        },
    }
}

//! Answers from a reading.

use evtach_core::{Reading, RotorReading};

use super::commands::{Collected, Item};
use super::device::Device;
use super::error::{ErrorCode, ScpiError};
use super::log::Letter;
use super::parameter::{Parameter, Parameters};
use super::response::Response;
use super::seconds::Seconds;
use super::speed;
use crate::instrument::Unit;

/// A rotor by letter (A to Z), or by number from 1; none: the one chosen, else the first with a speed.
pub fn rotor_parameter(parameters: &mut Parameters<'_>) -> Result<Option<u8>, ScpiError> {
    let mut ahead = *parameters;
    let Some((parameter, place)) = ahead.next()? else { return Ok(None) };
    match parameter {
        Parameter::Word(&[letter]) => {
            *parameters = ahead;
            Ok(Some(letter.to_ascii_uppercase().wrapping_sub(b'A')))
        }
        Parameter::Word(_) => Err(ScpiError::at(ErrorCode::InvalidCharacterData, place)),
        Parameter::Number(..) => match parameters.integer(255)? {
            0 => Err(ScpiError::at(ErrorCode::DataOutOfRange, place)),
            number => Ok(Some((number - 1) as u8)),
        },
    }
}

fn find(reading: &Reading, wanted: Option<u8>) -> Option<&RotorReading> {
    match wanted {
        Some(id) => reading.rotors.iter().find(|rotor| rotor.id == id),
        None => {
            let fast = reading.rotors.iter().find(|rotor| rotor.speed.is_some());
            fast.or(reading.rotors.first())
        }
    }
}

fn speed_of(rotor: Option<&RotorReading>, unit: Unit) -> Option<f32> {
    rotor?.speed.as_ref().and_then(|found| speed::in_unit(found.rpm(), unit))
}

/// The speed of a rotor in the unit chosen, as `FETCh?`, `READ?` and `MEASure?` answer it.
pub fn speed(rotor: Option<u8>, device: &impl Device, out: &mut Response) {
    let rotor = rotor.or(device.selected());
    let rotor = device.reading().and_then(|reading| find(reading, rotor));
    out.number(speed_of(rotor, device.preferences().unit));
}

/// Whether the reading has the speed that `MEASure?` waits for.
pub fn has_speed(rotor: Option<u8>, device: &impl Device) -> bool {
    let rotor = rotor.or(device.selected());
    device
        .reading()
        .and_then(|reading| find(reading, rotor))
        .is_some_and(|rotor| rotor.speed.is_some())
}

/// `CONFigure?`
pub fn configured(device: &impl Device, out: &mut Response) {
    out.text("SPEED");
    match device.selected() {
        Some(id) => out.plain(Letter(id)),
        None => out.plain("AUTO"),
    }
}

/// `FETCh:...?`
pub fn fetch(
    item: Item,
    parameters: &mut Parameters<'_>,
    device: &impl Device,
    out: &mut Response,
) -> Result<(), ScpiError> {
    let whole = matches!(item, Item::All | Item::Rotors | Item::Time | Item::Window | Item::Events);
    let asked = if whole { None } else { rotor_parameter(parameters)? };
    parameters.end()?;
    let unit = device.preferences().unit;
    let reading = device.reading();
    let rotor = reading.and_then(|reading| find(reading, asked.or(device.selected())));
    let found = rotor.and_then(|rotor| rotor.speed.as_ref());
    match item {
        Item::Speed => speed(asked, device, out),
        Item::Sigma => out.number(found.and_then(|found| speed::sigma_in_unit(found, unit))),
        Item::Direction => out.plain(direction(rotor)),
        Item::Blades => match rotor.and_then(|rotor| rotor.blades) {
            Some(blades) => out.plain(blades),
            None => out.number(None),
        },
        Item::Position => {
            out.number(rotor.map(|rotor| rotor.x_px));
            out.number(rotor.map(|rotor| rotor.y_px));
            out.number(rotor.map(|rotor| rotor.radius_px));
        }
        Item::Status => out.text(rotor.map_or("refused", |rotor| rotor.status.as_str())),
        Item::Reason => {
            let reason = match (rotor, reading) {
                (Some(rotor), _) => rotor.status.reason(),
                // A rotor that is not there, in a reading of others.
                (None, Some(reading)) if asked.or(device.selected()).is_none() => {
                    reading.status.reason()
                }
                (None, Some(_)) => Some(evtach_core::Reason::NoRotation),
                (None, None) => Some(device.reason()),
            };
            out.text(reason.map_or("", evtach_core::Reason::as_str));
        }
        Item::All => {
            let rotors = reading.map_or(&[][..], |reading| &reading.rotors[..]);
            out.plain(rotors.len());
            for rotor in rotors {
                let found = rotor.speed.as_ref();
                out.plain(Letter(rotor.id));
                out.number(found.and_then(|found| speed::in_unit(found.rpm(), unit)));
                out.number(found.and_then(|found| speed::sigma_in_unit(found, unit)));
                out.plain(direction(Some(rotor)));
                match rotor.blades {
                    Some(blades) => out.plain(blades),
                    None => out.number(None),
                }
                out.text(rotor.status.as_str());
            }
        }
        Item::Rotors => {
            let rotors = reading.map_or(&[][..], |reading| &reading.rotors[..]);
            out.plain(rotors.len());
            rotors.iter().for_each(|rotor| out.plain(Letter(rotor.id)));
        }
        Item::Time => match reading {
            Some(reading) => out.plain(Seconds(reading.t_us)),
            None => out.number(None),
        },
        Item::Window => match reading {
            Some(reading) => out.plain(Seconds(u64::from(reading.window_us))),
            None => out.number(None),
        },
        Item::Events => match reading {
            Some(reading) => {
                for count in [reading.events, reading.thinned, reading.lost] {
                    out.plain(count);
                }
            }
            None => (0..3).for_each(|_| out.number(None)),
        },
    }
    Ok(())
}

fn direction(rotor: Option<&RotorReading>) -> &'static str {
    match rotor.and_then(|rotor| rotor.speed.as_ref()).map(evtach_core::Speed::direction) {
        Some(evtach_core::Direction::Cw) => "CW",
        Some(evtach_core::Direction::Ccw) => "CCW",
        None => "NONE",
    }
}

/// `CALCulate:AVERage:...?`
pub fn collected(item: Collected, device: &impl Device, out: &mut Response) {
    let statistics = device.statistics();
    let unit = device.preferences().unit;
    let rpm = match item {
        Collected::Count => {
            return out.plain(statistics.map_or(0, |statistics| statistics.readings));
        }
        Collected::Revolutions => return out.number(device.revolutions()),
        Collected::Maximum => statistics.map(|statistics| statistics.max_rpm),
        Collected::Minimum => statistics.map(|statistics| statistics.min_rpm),
        Collected::Average => statistics.map(|statistics| statistics.mean_rpm),
    };
    out.number(rpm.and_then(|rpm| speed::in_unit(rpm, unit)));
}

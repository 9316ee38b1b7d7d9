//! What is to be shown, as plain values: the screen, the link and `evtach watch` read the same.

use evtach_core::limits::MAX_ROTORS;
use evtach_core::{Direction, Status};
use heapless::Vec;

use crate::sensor::usb::Trouble;

use super::{Beyond, Mode, Number, Page, Preferences, Rate, State};

/// A value in the chosen unit with one standard deviation of its error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shown {
    /// The digits that the error supports.
    pub value: Number,
    /// Two digits of the error.
    pub error: Number,
}

/// One rotor of the list.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Row {
    /// Identity: 0 is shown as "A".
    pub id: u8,
    /// Centre in pixels of the sensor.
    pub x_px: f32,
    /// Centre in pixels of the sensor.
    pub y_px: f32,
    /// Radius in pixels of the sensor.
    pub radius_px: f32,
    /// How far the measurement got.
    pub status: Status,
    /// Its last speed.
    pub speed: Option<Shown>,
    /// Sense of rotation, with a speed.
    pub direction: Option<Direction>,
    /// Equal blades, where found.
    pub blades: Option<u8>,
    /// Difference from the mean of all rotors that have a speed, in tenths of a percent; with two rotors or more.
    pub off_mean_permille: Option<i16>,
    /// Whether it is beyond a limit of the alarm.
    pub beyond: Option<Beyond>,
}

/// Extremes and mean of the rotor that the big number shows, since the last reset, in the chosen unit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Statistics {
    /// Largest value: in milliseconds the slowest turn.
    pub max: Option<Shown>,
    /// Smallest value.
    pub min: Option<Shown>,
    /// Mean of the readings.
    pub mean: Option<Shown>,
    /// Revolutions while it was measured, in tenths.
    pub turns_tenths: u64,
}

/// Everything on the screen but picture and trend.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct View {
    /// What fills the screen: a fault is shown on the main page.
    pub page: Page,
    /// Which value the big number shows.
    pub mode: Mode,
    /// In which state the measurement stands.
    pub state: State,
    /// Why there is no sensor, where something is plugged in.
    pub trouble: Option<Trouble>,
    /// Sensor time since the first reading, in tenths of a second: of the reading while it is held.
    pub time_tenths: Option<u64>,
    /// Rotor that the big number shows.
    pub rotor: Option<u8>,
    /// The big number. `None`: dashes.
    pub speed: Option<Shown>,
    /// Sense of rotation.
    pub direction: Option<Direction>,
    /// Blade number, found or typed in.
    pub blades: Option<u8>,
    /// Rotors in the order of their letters.
    pub rotors: Vec<Row, MAX_ROTORS>,
    /// Since the last reset.
    pub statistics: Option<Statistics>,
    /// The first rotor beyond a limit of the alarm.
    pub alarm: Option<(u8, Beyond)>,
    /// Events that arrive.
    pub rate: Rate,
    /// What the person chose.
    pub preferences: Preferences,
    /// Counts up with every new picture.
    pub picture: u32,
    /// Counts up with every change of the trend.
    pub trend: u32,
}

//! The instrument: what a person sets and asks for, without a screen, a port or a clock.
//!
//! Readings, counts of events, the sensor's presence, faults and the person's [`Action`]s go in, with the time as an
//! argument; a [`View`] comes out, which the screen and the link show. A number stands in it only where one was measured.

mod action;
mod number;
mod picture;
mod preferences;
mod show;
mod state;
mod tally;
mod traffic;
mod trend;
mod view;

use evtach_core::limits::MAX_ROTORS;
use evtach_core::{Direction, Reading, RotorReading, Status};
use heapless::Vec;

pub use action::{Action, Mode, Page, Setting, Step};
pub use number::Number;
pub use picture::{BRIGHTEST, Picture};
pub use preferences::{Alarm, Beyond, MAX_BLADES, MAX_TRIM_PPM, Preferences, Unit};
pub use state::State;
pub use traffic::{Rate, SATURATION_EV_S, Traffic};
pub use trend::{TREND_POINTS, Trend, TrendPoint};
pub use view::{Row, Shown, Statistics, View};

use tally::{Rpm, Tallies};
use traffic::Meter;

/// What happened to the device itself. Kept over a reset, then shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Fault {
    /// The program stopped itself: a panic.
    Panic,
    /// The processor stopped the program: a fault exception, the stack's end among them.
    Exception,
    /// The watchdog reset the device: a task hung.
    Watchdog,
    /// The stored preferences could not be read; the defaults stand.
    Preferences,
}

/// What is known of the sensor, apart from its events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sensor {
    /// None answers.
    #[default]
    Absent,
    /// One answers.
    Present,
}

/// A rotor of the last reading, corrected by the clock trim.
#[derive(Clone, Debug)]
struct Seen {
    rotor: RotorReading,
    rpm: Option<Rpm>,
}

/// The last speed of the rotor that the big number shows.
#[derive(Clone, Copy, Debug)]
struct LastSpeed {
    rpm: Rpm,
    direction: Direction,
    blades: Option<u8>,
    status: Status,
    /// End of its window in sensor time.
    end_us: u64,
    window_us: u32,
}

/// The last reading, as far as it is shown.
#[derive(Debug)]
struct Latest {
    t_us: u64,
    end_us: u64,
    window_us: u32,
    status: Status,
    rotors: Vec<Seen, MAX_ROTORS>,
}

/// What a reading is judged by, apart from what it says.
#[derive(Clone, Copy, Debug)]
struct Scene {
    now_us: u64,
    sensor: Sensor,
    /// Whether no event came for a while.
    silent: bool,
}

/// What a person sets and asks for.
#[derive(Debug)]
pub struct Instrument {
    preferences: Preferences,
    mode: Mode,
    mode_before_hold: Mode,
    page: Page,
    sensor: Sensor,
    fault: Option<Fault>,
    now_us: u64,
    /// Time of the first reading.
    first_us: Option<u64>,
    meter: Meter,
    selected: Option<u8>,
    /// Whether the person chose the rotor: then it stays, even when it is gone.
    chosen: bool,
    latest: Option<Latest>,
    last_speed: Option<LastSpeed>,
    tallies: Tallies,
    trend: Trend,
    picture: Picture,
    pictures: u32,
    trends: u32,
    /// The last alarm, and until when it stands.
    alarm: Option<(u8, Beyond, u64)>,
    /// What was so when the person asked to hold.
    held: Scene,
}

impl Instrument {
    /// An instrument that has measured nothing yet.
    #[must_use]
    pub const fn new(preferences: Preferences) -> Self {
        Self {
            preferences,
            mode: Mode::Live,
            mode_before_hold: Mode::Live,
            page: Page::Main,
            sensor: Sensor::Absent,
            fault: None,
            now_us: 0,
            first_us: None,
            meter: Meter::NEW,
            selected: None,
            chosen: false,
            latest: None,
            last_speed: None,
            tallies: Tallies::NEW,
            trend: Trend::NEW,
            picture: Picture::EMPTY,
            pictures: 0,
            trends: 0,
            alarm: None,
            held: Scene { now_us: 0, sensor: Sensor::Absent, silent: true },
        }
    }

    /// What the person chose.
    #[must_use]
    pub const fn preferences(&self) -> &Preferences {
        &self.preferences
    }

    /// The last readings of the rotor that the big number shows.
    #[must_use]
    pub const fn trend(&self) -> &Trend {
        &self.trend
    }

    /// What the camera sees.
    #[must_use]
    pub const fn picture(&self) -> &Picture {
        &self.picture
    }

    /// Takes in whether a sensor answers.
    pub fn set_sensor(&mut self, sensor: Sensor) {
        self.sensor = sensor;
    }

    /// Takes in the time and how many events have come so far.
    ///
    /// `now_us` is the sensor's time; while it is silent, its last time and what has passed since by the device's clock.
    pub fn tick(&mut self, now_us: u64, traffic: Traffic) {
        self.now_us = now_us;
        self.meter.update(now_us, traffic);
    }

    /// Takes in a picture; while the screen is held it stays the one of then.
    pub fn show_picture(&mut self, picture: &Picture) {
        if self.mode != Mode::Hold {
            self.picture.clone_from(picture);
            self.pictures = self.pictures.wrapping_add(1);
        }
    }

    /// Takes in a reading; while the screen is held, it goes into max, min, mean, revolutions and alarm only.
    pub fn observe(&mut self, reading: &Reading) {
        let trim_ppm = self.preferences.clock_trim_ppm;
        let rpm = |rotor: &RotorReading| rotor.speed.as_ref().map(|s| Rpm::of(s, trim_ppm));
        let measured = || reading.rotors.iter().filter_map(|r| Some((r.id, rpm(r)?)));
        self.tallies.add(reading.t_us, measured());
        let end_us = reading.t_us.saturating_add(u64::from(reading.window_us / 2));
        let until_us = end_us.saturating_add(fresh_us(reading.window_us));
        let alarm = self.preferences.alarm;
        self.alarm =
            measured().find_map(|(id, rpm)| Some((id, alarm.beyond(rpm.value)?, until_us)));
        if self.mode == Mode::Hold {
            return;
        }
        if self.latest.as_ref().is_some_and(|latest| reading.t_us < latest.t_us) {
            // The sensor's clock began anew: what was before has no place on its time.
            (self.first_us, self.last_speed, self.now_us) = (None, None, 0);
            self.clear_trend();
        }
        self.now_us = self.now_us.max(end_us);
        self.first_us.get_or_insert(reading.t_us);
        let rotors = reading.rotors.iter();
        let rotors = rotors.map(|rotor| Seen { rotor: rotor.clone(), rpm: rpm(rotor) }).collect();
        let Reading { t_us, window_us, status, .. } = *reading;
        self.latest = Some(Latest { t_us, end_us, window_us, status, rotors });
        self.choose_rotor();
        self.last_speed = self.latest_speed().or(self.last_speed.take());
        if let Some(LastSpeed { rpm, end_us: of_us, .. }) = self.last_speed
            && of_us == end_us
        {
            self.trend.push(TrendPoint { t_us, rpm: rpm.value, rpm_sigma: rpm.sigma });
            self.trends = self.trends.wrapping_add(1);
        }
    }

    /// Chooses a rotor where the person has not: the first with a speed, and another only once its number is gone.
    fn choose_rotor(&mut self) {
        let shown = self.selected.is_some() && (self.chosen || self.visible_speed().is_some());
        let Some(latest) = &self.latest else { return };
        let measured = latest.rotors.iter().find(|seen| seen.rpm.is_some());
        if let Some(seen) = measured.or(latest.rotors.first())
            && !shown
        {
            self.show_rotor(seen.rotor.id);
        }
    }

    fn show_rotor(&mut self, id: u8) {
        if self.selected != Some(id) {
            self.selected = Some(id);
            self.last_speed = self.latest_speed();
            self.clear_trend();
        }
    }

    /// The speed that the last reading gives for the rotor shown.
    fn latest_speed(&self) -> Option<LastSpeed> {
        let Latest { end_us, window_us, rotors, .. } = self.latest.as_ref()?;
        let seen = rotors.iter().find(|seen| Some(seen.rotor.id) == self.selected)?;
        let RotorReading { status, blades, speed, .. } = &seen.rotor;
        let direction = speed.as_ref()?.direction();
        let (rpm, blades, status) = (seen.rpm?, *blades, *status);
        Some(LastSpeed { rpm, direction, blades, status, end_us: *end_us, window_us: *window_us })
    }

    fn clear_trend(&mut self) {
        self.trend.clear();
        self.trends = self.trends.wrapping_add(1);
    }

    fn reset(&mut self) {
        self.tallies.clear();
        self.clear_trend();
    }
}

/// How long a reading stands for the present: two windows, and a second at least.
fn fresh_us(window_us: u32) -> u64 {
    (2 * u64::from(window_us)).max(1_000_000)
}

#[cfg(test)]
mod tests;

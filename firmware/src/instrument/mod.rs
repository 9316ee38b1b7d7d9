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

use evtach_core::{Direction, Reading, Status};

use crate::sensor::usb::Trouble;

pub use action::{Action, Mode, Page, Setting, Step};
pub use number::Number;
pub use picture::{BRIGHTEST, Picture};
pub use preferences::{Alarm, Beyond, MAX_BLADES, MAX_TRIM_PPM, Preferences, Unit};
pub use state::State;
pub use tally::Tally;
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
    /// The crystal of the device's clock does not swing: nothing is measured.
    Crystal,
    /// The external memory does not hold what is written to it: nothing is measured.
    Memory,
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
    trouble: Option<Trouble>,
    fault: Option<Fault>,
    now_us: u64,
    /// Time of the first reading.
    first_us: Option<u64>,
    meter: Meter,
    selected: Option<u8>,
    /// Whether the person chose the rotor: then it stays, even when it is gone.
    chosen: bool,
    /// The last reading, its speeds corrected by the clock trim.
    latest: Option<Reading>,
    readings: u32,
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
            trouble: None,
            fault: None,
            now_us: 0,
            first_us: None,
            meter: Meter::NEW,
            selected: None,
            chosen: false,
            latest: None,
            readings: 0,
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

    /// Takes over preferences as a whole; what is out of range stays as it was.
    pub fn set_preferences(&mut self, preferences: Preferences) {
        let Preferences { unit, alarm, blades, clock_trim_ppm } = preferences;
        self.act(Action::Unit(unit));
        self.act(Action::Alarm(alarm));
        self.act(Action::Blades(blades));
        self.act(Action::ClockTrim(clock_trim_ppm));
    }

    /// Whether a sensor answers.
    #[must_use]
    pub const fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// What happened to the device and has not been acknowledged.
    #[must_use]
    pub const fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// The last reading, or the one that is held, its speeds corrected by the clock trim; however old it is.
    #[must_use]
    pub const fn reading(&self) -> Option<&Reading> {
        self.latest.as_ref()
    }

    /// Readings so far; wraps.
    #[must_use]
    pub const fn readings(&self) -> u32 {
        self.readings
    }

    /// Time of the first reading in sensor time, in microseconds.
    #[must_use]
    pub const fn first_us(&self) -> Option<u64> {
        self.first_us
    }

    /// What is remembered of the rotor that the big number shows, since the last reset.
    #[must_use]
    pub fn tally(&self) -> Option<&Tally> {
        self.tallies.of(self.selected?)
    }

    /// The rotor that was asked for; `None`: the device chooses.
    #[must_use]
    pub const fn chosen(&self) -> Option<u8> {
        if self.chosen { self.selected } else { None }
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

    /// Takes in why none does, where something is plugged in.
    pub fn set_trouble(&mut self, trouble: Option<Trouble>) {
        self.trouble = trouble;
    }

    /// Why no sensor answers, where something is plugged in.
    #[must_use]
    pub const fn trouble(&self) -> Option<Trouble> {
        self.trouble
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
        self.take_in(reading.clone());
    }

    /// The same, of a reading that nobody else needs: it is a kilobyte and more, and stacks are short.
    pub fn take_in(&mut self, mut reading: Reading) {
        let trim = 1.0 + self.preferences.clock_trim_ppm * 1e-6;
        for speed in reading.rotors.iter_mut().filter_map(|rotor| rotor.speed.as_mut()) {
            // A clock that runs fast counts too many microseconds a turn.
            speed.omega_rad_s *= trim;
            speed.omega_sigma_rad_s *= trim;
        }
        let measured = || reading.rotors.iter().filter_map(|r| Some((r.id, Rpm::of(r)?)));
        self.tallies.add(reading.t_us, measured());
        let until_us = end_us(&reading).saturating_add(fresh_us(reading.window_us));
        let alarm = self.preferences.alarm;
        self.alarm =
            measured().find_map(|(id, rpm)| Some((id, alarm.beyond(rpm.value)?, until_us)));
        if self.mode == Mode::Hold {
            return;
        }
        self.readings = self.readings.wrapping_add(1);
        if self.latest.as_ref().is_some_and(|latest| reading.t_us < latest.t_us) {
            // The sensor's clock began anew: what was before has no place on its time.
            (self.first_us, self.last_speed, self.now_us) = (None, None, 0);
            self.clear_trend();
        }
        let t_us = reading.t_us;
        self.now_us = self.now_us.max(end_us(&reading));
        self.first_us.get_or_insert(t_us);
        self.latest = Some(reading);
        self.choose_rotor();
        if let Some(speed) = self.latest_speed() {
            self.last_speed = Some(speed);
            let Rpm { value, sigma } = speed.rpm;
            self.trend.push(TrendPoint { t_us, rpm: value, rpm_sigma: sigma });
            self.trends = self.trends.wrapping_add(1);
        }
    }

    /// Chooses a rotor where the person has not: the first with a speed, and another only once its number is gone.
    fn choose_rotor(&mut self) {
        let shown = self.selected.is_some() && (self.chosen || self.visible_speed().is_some());
        let Some(latest) = &self.latest else { return };
        let measured = latest.rotors.iter().find(|rotor| rotor.speed.is_some());
        if let Some(rotor) = measured.or(latest.rotors.first())
            && !shown
        {
            self.show_rotor(rotor.id);
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
        let latest = self.latest.as_ref()?;
        let rotor = latest.rotors.iter().find(|rotor| Some(rotor.id) == self.selected)?;
        Some(LastSpeed {
            rpm: Rpm::of(rotor)?,
            direction: rotor.speed.as_ref()?.direction(),
            blades: rotor.blades,
            status: rotor.status,
            end_us: end_us(latest),
            window_us: latest.window_us,
        })
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

const _: () = assert!(size_of::<Instrument>() <= 7 * 1024, "RAM of the device");

/// When the window of a reading ends.
fn end_us(reading: &Reading) -> u64 {
    reading.t_us.saturating_add(u64::from(reading.window_us / 2))
}

/// How long a reading stands for the present: two windows, and a second at least.
fn fresh_us(window_us: u32) -> u64 {
    (2 * u64::from(window_us)).max(1_000_000)
}

#[cfg(test)]
mod tests;

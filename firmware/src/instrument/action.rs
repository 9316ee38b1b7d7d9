//! What a person can ask of the instrument, whether by touch, by the button or over the link.

use super::{Alarm, Fault, Instrument, MAX_BLADES, MAX_TRIM_PPM, Preferences, Unit};

/// Which value the big number shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// The last reading.
    #[default]
    Live,
    /// The reading at the moment it was chosen; number, picture and time stand still together.
    Hold,
    /// The largest reading since the last reset.
    Max,
    /// The smallest reading since the last reset.
    Min,
    /// The mean of the readings since the last reset.
    Mean,
}

impl Mode {
    /// All, in the order in which a key steps through them.
    pub const ALL: [Self; 5] = [Self::Live, Self::Hold, Self::Max, Self::Min, Self::Mean];

    /// The label on the screen.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Live => "LIVE",
            Self::Hold => "HOLD",
            Self::Max => "MAX",
            Self::Min => "MIN",
            Self::Mean => "MEAN",
        }
    }

    const fn next(self) -> Self {
        match self {
            Self::Live => Self::Max,
            Self::Max => Self::Min,
            Self::Min => Self::Mean,
            Self::Mean | Self::Hold => Self::Live,
        }
    }
}

/// What fills the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Page {
    /// The big number.
    #[default]
    Main,
    /// The heat map, large, for aiming.
    Aim,
    /// What is kept over power cycles.
    Settings,
}

/// A setting that steps up and down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Setting {
    /// Lower limit of the alarm.
    AlarmLow,
    /// Upper limit of the alarm.
    AlarmHigh,
    /// Correction of the sensor's clock.
    ClockTrim,
}

/// Which way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Step {
    /// Down by one step.
    Less,
    /// Up by one step.
    More,
    /// Switched off, or zero.
    Off,
}

/// One wish. What is out of range is not taken.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Action {
    /// The fault on the screen has been seen: go on measuring.
    Acknowledge,
    /// To hold, or from hold back to the mode before.
    ToggleHold,
    /// Live, max, min, mean, and round again.
    NextMode,
    /// This mode.
    Mode(Mode),
    /// Max, min, mean, revolutions and trend begin anew.
    Reset,
    /// The next unit.
    NextUnit,
    /// This unit.
    Unit(Unit),
    /// The next rotor in the list for the big number.
    NextRotor,
    /// This rotor (0 is A) for the big number; `None` lets the device choose.
    Rotor(Option<u8>),
    /// This blade number, 1 to 32; `None`: find it.
    Blades(Option<u8>),
    /// Twice the blade number: the speed shown was twice the true one.
    BladesTwice,
    /// Half of the blade number: the speed shown was half the true one.
    BladesHalf,
    /// Limits of the alarm, each above 0.
    Alarm(Alarm),
    /// What the sensor's clock runs fast by in ppm, -1000 to 1000.
    ClockTrim(f32),
    /// One step of a setting.
    Step(Setting, Step),
    /// This page.
    Page(Page),
}

impl Instrument {
    /// Does what is asked.
    pub fn act(&mut self, action: Action) {
        match action {
            Action::Acknowledge => self.fault = None,
            Action::ToggleHold if self.mode == Mode::Hold => self.set_mode(self.mode_before_hold),
            Action::ToggleHold => self.set_mode(Mode::Hold),
            Action::NextMode => self.set_mode(self.mode.next()),
            Action::Mode(mode) => self.set_mode(mode),
            Action::Reset => self.reset(),
            Action::NextUnit => self.preferences.unit = self.preferences.unit.next(),
            Action::Unit(unit) => self.preferences.unit = unit,
            Action::NextRotor => self.select_next(),
            Action::Rotor(Some(id)) => self.select(id),
            Action::Rotor(None) => self.chosen = false,
            Action::Blades(blades) => self.set_blades(blades),
            Action::BladesTwice => {
                let blades = self.blades().unwrap_or(1).saturating_mul(2);
                self.set_blades(Some(blades.min(MAX_BLADES)));
            }
            Action::BladesHalf => {
                let blades = self.blades().unwrap_or(1) / 2;
                self.set_blades(Some(blades.max(1)));
            }
            Action::Alarm(alarm) => self.set_alarm(alarm),
            Action::ClockTrim(ppm) => self.set_clock_trim(ppm),
            Action::Step(setting, step) => self.step(setting, step),
            Action::Page(page) => self.page = page,
        }
    }

    /// Shows a fault until it is acknowledged.
    pub const fn fail(&mut self, fault: Fault) {
        self.fault = Some(fault);
    }

    fn set_mode(&mut self, mode: Mode) {
        if mode == self.mode {
            return;
        }
        if mode == Mode::Hold {
            self.held = self.scene();
            self.mode_before_hold = self.mode;
        }
        self.mode = mode;
    }

    /// The rotor after the one shown, in the order of the list.
    fn select_next(&mut self) {
        let Some(latest) = &self.latest else { return };
        let ids = || latest.rotors.iter().map(|rotor| rotor.id);
        let next = ids().find(|id| Some(*id) > self.selected).or_else(|| ids().next());
        if let Some(id) = next {
            self.select(id);
        }
    }

    fn select(&mut self, id: u8) {
        self.show_rotor(id);
        self.chosen = true;
    }

    fn set_blades(&mut self, blades: Option<u8>) {
        if blades.is_none_or(|blades| (1..=MAX_BLADES).contains(&blades)) {
            self.preferences.blades = blades;
        }
    }

    fn set_alarm(&mut self, alarm: Alarm) {
        if alarm.is_valid() && alarm != self.preferences.alarm {
            self.preferences.alarm = alarm;
            self.alarm = None;
        }
    }

    fn set_clock_trim(&mut self, ppm: f32) {
        if ppm.abs() <= MAX_TRIM_PPM {
            self.preferences.clock_trim_ppm = ppm;
        }
    }

    fn step(&mut self, setting: Setting, step: Step) {
        let Preferences { mut alarm, clock_trim_ppm, .. } = self.preferences;
        let speed_rpm = self.shown_rpm();
        match setting {
            Setting::AlarmLow => alarm.low_rpm = stepped(alarm.low_rpm, speed_rpm, step),
            Setting::AlarmHigh => alarm.high_rpm = stepped(alarm.high_rpm, speed_rpm, step),
            Setting::ClockTrim => self.set_clock_trim(match step {
                Step::Less => (clock_trim_ppm - 1.0).max(-MAX_TRIM_PPM),
                Step::More => (clock_trim_ppm + 1.0).min(MAX_TRIM_PPM),
                Step::Off => 0.0,
            }),
        }
        self.set_alarm(alarm);
    }
}

/// A limit one step further. A step is one in the second digit; a limit that was off begins at the speed shown.
fn stepped(limit_rpm: Option<f32>, speed_rpm: Option<f32>, step: Step) -> Option<f32> {
    const LEAST_RPM: u32 = 10;
    const MOST_RPM: u32 = 990_000;
    let now = match limit_rpm {
        Some(rpm) => rpm,
        None if step == Step::Off => return None,
        None => speed_rpm.unwrap_or(1_000.0),
    };
    let now = (now as u32).clamp(LEAST_RPM, MOST_RPM);
    let decade = 10_u32.pow(now.ilog10() - 1);
    let stepped = match step {
        Step::Off => return None,
        Step::More => (now / decade + 1) * decade,
        // One below 1000 is 990.
        Step::Less => {
            let below = now.saturating_sub(1).max(LEAST_RPM);
            let decade = 10_u32.pow(below.ilog10() - 1);
            below / decade * decade
        }
    };
    Some(stepped.clamp(LEAST_RPM, MOST_RPM) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_steps_in_its_second_digit() {
        let more = |rpm: f32| stepped(Some(rpm), None, Step::More);
        let less = |rpm: f32| stepped(Some(rpm), None, Step::Less);
        assert_eq!(more(1_000.0), Some(1_100.0));
        assert_eq!(more(9_900.0), Some(10_000.0));
        assert_eq!(less(10_000.0), Some(9_900.0));
        assert_eq!(less(1_100.0), Some(1_000.0));
        assert_eq!(less(1_000.0), Some(990.0));
        assert_eq!(more(1_180.27), Some(1_200.0));
        assert_eq!(less(10.0), Some(10.0));
        assert_eq!(more(990_000.0), Some(990_000.0));
    }

    #[test]
    fn a_limit_that_was_off_begins_at_the_speed_shown() {
        assert_eq!(stepped(None, Some(1_180.0), Step::More), Some(1_200.0));
        assert_eq!(stepped(None, Some(1_180.0), Step::Less), Some(1_100.0));
        assert_eq!(stepped(None, None, Step::More), Some(1_100.0));
        assert_eq!(stepped(None, Some(1_180.0), Step::Off), None);
        assert_eq!(stepped(Some(500.0), None, Step::Off), None);
    }
}

//! From what was taken in to what is shown.

use evtach_core::limits::MAX_ROTORS;
use evtach_core::{Reason, RotorReading};
use heapless::Vec;

use super::tally::Rpm;
use super::{
    Beyond, Instrument, LastSpeed, Mode, Number, Page, Row, Scene, Sensor, Shown, State,
    Statistics, Unit, View, end_us, fresh_us,
};

/// A sensor without an event for this long is silent.
const SILENT_US: u64 = 500_000;

/// A reading older than this says nothing about the present.
const OLD_READING_US: u64 = 3_000_000;

/// With more events lost than this and no new reading, that is why.
const MOST_LOST_PERMILLE: u16 = 500;

impl Instrument {
    /// What is to be shown now.
    #[must_use]
    pub fn view(&self) -> View {
        let state = self.state();
        let failed = matches!(state, State::Fault(_));
        let statistics = self.statistics().filter(|_| !failed);
        let last = self.visible_speed().map(|(last, _)| last);
        let speed = match self.mode {
            _ if failed => None,
            Mode::Live | Mode::Hold => last.and_then(|last| self.shown(last.rpm)),
            Mode::Max => statistics.and_then(|statistics| statistics.max),
            Mode::Min => statistics.and_then(|statistics| statistics.min),
            Mode::Mean => statistics.and_then(|statistics| statistics.mean),
        };
        let time_us = self.latest.as_ref().zip(self.first_us);
        View {
            page: if failed { Page::Main } else { self.page },
            mode: self.mode,
            state,
            trouble: self.trouble.filter(|_| state == State::Refused(Reason::NoSensor)),
            time_tenths: time_us.map(|(latest, first_us)| (latest.t_us - first_us) / 100_000),
            rotor: self.selected,
            speed,
            direction: last.filter(|_| !failed).map(|last| last.direction),
            blades: self.preferences.blades.or(last.and_then(|last| last.blades)),
            rotors: if failed { Vec::new() } else { self.rows() },
            statistics,
            alarm: self.alarm(),
            rate: self.meter.rate,
            preferences: self.preferences,
            picture: self.pictures,
            trend: self.trends,
        }
    }

    /// The speed shown, in revolutions per minute.
    pub(super) fn shown_rpm(&self) -> Option<f32> {
        self.visible_speed().map(|(last, _)| last.rpm.value)
    }

    /// Blade number, typed in or found.
    pub(super) fn blades(&self) -> Option<u8> {
        let found = self.visible_speed().and_then(|(last, _)| last.blades);
        self.preferences.blades.or(found)
    }

    pub(super) fn scene(&self) -> Scene {
        if self.mode == Mode::Hold {
            return self.held;
        }
        let now_us = self.now_us;
        let silent_us = self.meter.last_event_us.map(|us| now_us.saturating_sub(us));
        let silent = silent_us.is_none_or(|us| us > SILENT_US);
        Scene { now_us, sensor: self.sensor, silent }
    }

    /// The last speed of the rotor shown while it may be seen, and whether it is that of the present.
    ///
    /// It stands for the present until it is as old as two windows and a second at least, or the next reading does not
    /// give one. Then it may be seen, in grey, for as long again.
    pub(super) fn visible_speed(&self) -> Option<(LastSpeed, bool)> {
        let scene = self.scene();
        let last = self.last_speed.filter(|_| scene.sensor == Sensor::Present)?;
        let newest = self.latest.as_ref().is_some_and(|latest| end_us(latest) == last.end_us);
        let age_us = scene.now_us.saturating_sub(last.end_us);
        let fresh_us = fresh_us(last.window_us);
        let seen_us = if newest { 2 * fresh_us } else { fresh_us };
        (age_us <= seen_us).then_some((last, newest && age_us <= fresh_us))
    }

    /// In which state the measurement stands.
    #[must_use]
    pub fn state(&self) -> State {
        let scene = self.scene();
        if let Some(fault) = self.fault {
            return State::Fault(fault);
        }
        if scene.sensor == Sensor::Absent {
            return State::Refused(Reason::NoSensor);
        }
        match self.visible_speed() {
            Some((last, true)) => State::from(last.status),
            Some((_, false)) => State::Held,
            None if scene.silent => State::Refused(Reason::NoEvents),
            None => State::Refused(self.refusal(&scene)),
        }
    }

    /// Why there is no speed of the rotor shown.
    fn refusal(&self, scene: &Scene) -> Reason {
        let age_us = |reading| scene.now_us.saturating_sub(end_us(reading));
        let mostly_lost = self.meter.rate.lost_permille > MOST_LOST_PERMILLE;
        let waiting = if mostly_lost { Reason::Saturated } else { Reason::Searching };
        let Some(latest) = self.latest.as_ref().filter(|latest| age_us(latest) <= OLD_READING_US)
        else {
            return waiting;
        };
        let shown = latest.rotors.iter().find(|rotor| Some(rotor.id) == self.selected);
        match shown {
            // A speed, but too old: the next reading takes its time.
            Some(rotor) => rotor.status.reason().unwrap_or(waiting),
            // Other rotors may have a speed, but this one has gone.
            None => latest.status.reason().unwrap_or(Reason::NoRotation),
        }
    }

    fn shown(&self, rpm: Rpm) -> Option<Shown> {
        let unit = self.preferences.unit;
        let sigma = unit.error_of_rpm(rpm.value, rpm.sigma);
        let value = Number::supported(unit.of_rpm(rpm.value), sigma)?;
        Some(Shown { value, error: Number::of_error(sigma)? })
    }

    fn statistics(&self) -> Option<Statistics> {
        let tally = self.tally()?;
        let (mut max, mut min) = (tally.max, tally.min);
        if self.preferences.unit == Unit::MsPerTurn {
            // The slowest turn is the longest.
            core::mem::swap(&mut max, &mut min);
        }
        Some(Statistics {
            max: self.shown(max),
            min: self.shown(min),
            mean: self.shown(tally.mean()),
            turns_tenths: tally.turns_tenths(),
        })
    }

    /// The first rotor beyond a limit, as long as the last reading stands for the present.
    #[must_use]
    pub fn alarm(&self) -> Option<(u8, Beyond)> {
        let (id, beyond, until_us) = self.alarm?;
        (self.now_us <= until_us && self.sensor == Sensor::Present).then_some((id, beyond))
    }

    /// The rotors of the last reading, as long as that stands for the present.
    fn rows(&self) -> Vec<Row, MAX_ROTORS> {
        let scene = self.scene();
        let fresh = self.latest.as_ref().filter(|latest| {
            let age_us = scene.now_us.saturating_sub(end_us(latest));
            scene.sensor == Sensor::Present && age_us <= fresh_us(latest.window_us)
        });
        let Some(latest) = fresh else { return Vec::new() };
        let speeds = || latest.rotors.iter().filter_map(Rpm::of);
        let measured = speeds().count();
        let mean_rpm = speeds().map(|rpm| rpm.value).sum::<f32>() / measured.max(1) as f32;
        let mean_rpm = (measured > 1).then_some(mean_rpm);
        latest.rotors.iter().map(|rotor| self.row(rotor, mean_rpm)).collect()
    }

    fn row(&self, rotor: &RotorReading, mean_rpm: Option<f32>) -> Row {
        let rpm = Rpm::of(rotor);
        let off_mean = rpm.zip(mean_rpm).map(|(rpm, mean)| (rpm.value / mean - 1.0) * 1e3);
        let half = |off: f32| if off < 0.0 { off - 0.5 } else { off + 0.5 };
        Row {
            id: rotor.id,
            x_px: rotor.x_px,
            y_px: rotor.y_px,
            radius_px: rotor.radius_px,
            status: rotor.status,
            speed: rpm.and_then(|rpm| self.shown(rpm)),
            direction: rotor.speed.as_ref().map(evtach_core::Speed::direction),
            blades: rotor.blades,
            off_mean_permille: off_mean.map(|off| half(off) as i16),
            beyond: rpm.and_then(|rpm| self.preferences.alarm.beyond(rpm.value)),
        }
    }
}

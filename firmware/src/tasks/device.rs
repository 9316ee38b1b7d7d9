//! The device as the link sees it.

use evtach_core::{Geometry, Reading, Reason};

use super::front::{Front, Panel, Recording};
use crate::instrument::{Action, Fault, Mode, Preferences, Sensor, State};
use crate::scpi::{Device, Identity, RecorderFailed, RecorderStatus, Statistics, View};

impl<R: Recording, P: Panel> Device for Front<R, P> {
    fn identity(&self) -> Identity<'_> {
        Identity { serial: self.serial, version: env!("CARGO_PKG_VERSION") }
    }

    fn sensor(&self) -> Sensor {
        if self.shared.acquired().sensor.is_some() { Sensor::Present } else { Sensor::Absent }
    }

    fn reading(&self) -> Option<&Reading> {
        let shown = match self.instrument.state() {
            State::Locked | State::Coarse | State::Held => true,
            State::Fault(_) => false,
            State::Refused(reason) => !matches!(
                reason,
                Reason::NoSensor | Reason::NoEvents | Reason::Searching | Reason::Fault
            ),
        };
        self.reading.as_ref().filter(|_| shown)
    }

    fn reason(&self) -> Reason {
        self.instrument.state().reason().unwrap_or(Reason::Searching)
    }

    fn readings(&self) -> u32 {
        self.readings
    }

    fn first_us(&self) -> u64 {
        self.first_us.unwrap_or_default()
    }

    fn alarm(&self) -> bool {
        self.instrument.view().alarm.is_some()
    }

    fn statistics(&self) -> Option<Statistics> {
        self.instrument.collected().map(|collected| Statistics {
            max_rpm: collected.max_rpm,
            min_rpm: collected.min_rpm,
            mean_rpm: collected.mean_rpm,
            readings: collected.readings,
        })
    }

    fn revolutions(&self) -> Option<f32> {
        self.instrument.collected().map(|collected| collected.turns_tenths as f32 / 10.0)
    }

    fn clear_statistics(&mut self) {
        self.instrument.act(Action::Reset);
    }

    fn go_live(&mut self) {
        self.instrument.act(Action::Mode(Mode::Live));
    }

    fn select(&mut self, rotor: Option<u8>) {
        self.instrument.choose(rotor);
    }

    fn selected(&self) -> Option<u8> {
        self.instrument.chosen()
    }

    fn preferences(&self) -> Preferences {
        *self.instrument.preferences()
    }

    fn set_preferences(&mut self, preferences: Preferences) {
        let Preferences { unit, alarm, blades, clock_trim_ppm } = preferences;
        for action in [
            Action::Unit(unit),
            Action::Alarm(alarm),
            Action::Blades(blades),
            Action::ClockTrim(clock_trim_ppm),
        ] {
            self.instrument.act(action);
        }
    }

    fn geometry(&self) -> Option<Geometry> {
        self.shared.acquired().sensor.map(|hello| hello.geometry)
    }

    fn view(&self) -> View {
        self.view
    }

    fn set_view(&mut self, view: View) {
        self.view = view;
    }

    fn fault(&self) -> Option<(Fault, &str)> {
        self.fault_words()
    }

    fn acknowledge_fault(&mut self) {
        self.instrument.act(Action::Acknowledge);
    }

    fn screen(&self) -> &[u8] {
        self.panel.bytes()
    }

    fn recorder(&self) -> RecorderStatus {
        self.recording.status()
    }

    fn start_recording(&mut self, events: u32) -> Result<(), RecorderFailed> {
        let geometry = self.geometry().ok_or(RecorderFailed)?;
        self.recording.start(geometry, events);
        Ok(())
    }

    fn stop_recording(&mut self) {
        self.recording.stop();
    }

    fn read_recording(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), RecorderFailed> {
        self.recording.read(offset, bytes)
    }
}

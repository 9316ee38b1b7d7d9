//! The device as the link sees it.

use evtach_core::{Geometry, Reading, Reason, Status};

use super::front::{Front, Panel, Recording};
use crate::instrument::{Action, Fault, Mode, Preferences, Sensor, State};
use crate::scpi::{Device, Fate, Identity, RecorderFailed, RecorderStatus, Statistics, View};
use crate::sensor::usb::Trouble;

impl<R: Recording, P: Panel> Device for Front<R, P> {
    fn identity(&self) -> Identity<'_> {
        Identity { serial: self.serial, version: env!("CARGO_PKG_VERSION") }
    }

    fn sensor(&self) -> Sensor {
        if self.shared.standing().geometry.is_some() { Sensor::Present } else { Sensor::Absent }
    }

    fn trouble(&self) -> Option<Trouble> {
        self.instrument.trouble()
    }

    fn reading(&self) -> Option<&Reading> {
        let reading = self.instrument.reading()?;
        let shown = match self.instrument.state() {
            State::Locked | State::Coarse | State::Held => true,
            State::Fault(_) => false,
            State::Refused(
                Reason::NoSensor | Reason::NoEvents | Reason::Searching | Reason::Fault,
            ) => false,
            // Told of a reading, or because none has come while most events were lost.
            State::Refused(Reason::Saturated) => {
                reading.status == Status::Refused(Reason::Saturated)
            }
            State::Refused(_) => true,
        };
        shown.then_some(reading)
    }

    fn last_reading(&self) -> Option<&Reading> {
        self.instrument.reading()
    }

    fn reason(&self) -> Reason {
        self.instrument.state().reason().unwrap_or(Reason::Searching)
    }

    fn readings(&self) -> u32 {
        self.instrument.readings()
    }

    fn first_us(&self) -> u64 {
        self.instrument.first_us().unwrap_or_default()
    }

    fn alarm(&self) -> bool {
        self.instrument.alarm().is_some()
    }

    fn statistics(&self) -> Option<Statistics> {
        self.instrument.tally().map(|tally| Statistics {
            max_rpm: tally.max_rpm(),
            min_rpm: tally.min_rpm(),
            mean_rpm: tally.mean_rpm(),
            readings: tally.readings(),
        })
    }

    fn revolutions(&self) -> Option<f32> {
        self.instrument.tally().map(|tally| tally.micro_turns() as f32 * 1e-6)
    }

    fn clear_statistics(&mut self) {
        self.instrument.act(Action::Reset);
    }

    fn go_live(&mut self) {
        self.instrument.act(Action::Mode(Mode::Live));
    }

    fn select(&mut self, rotor: Option<u8>) {
        self.instrument.act(Action::Rotor(rotor));
    }

    fn selected(&self) -> Option<u8> {
        self.instrument.chosen()
    }

    fn preferences(&self) -> Preferences {
        *self.instrument.preferences()
    }

    fn set_preferences(&mut self, preferences: Preferences) {
        self.instrument.set_preferences(preferences);
    }

    fn geometry(&self) -> Option<Geometry> {
        self.shared.standing().geometry
    }

    fn fate(&self) -> Fate {
        self.shared.fate()
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

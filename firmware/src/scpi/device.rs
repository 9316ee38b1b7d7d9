//! What the link needs of the rest of the device.

use embedded_storage::Storage;
use evtach_core::{Geometry, Reading, Reason, Roi};

use crate::instrument::{Fault, Preferences, Sensor};
use crate::recorder::Recorder;
use crate::sensor::usb::Trouble;

/// What `*IDN?` answers, and nothing that a comma could split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity<'d> {
    /// Serial number of the board, "0" where it has none.
    pub serial: &'d str,
    /// Version of the firmware.
    pub version: &'d str,
}

/// What has been collected since it was last cleared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Fastest, in revolutions per minute.
    pub max_rpm: f32,
    /// Slowest, in revolutions per minute.
    pub min_rpm: f32,
    /// Mean, in revolutions per minute.
    pub mean_rpm: f32,
    /// Readings within.
    pub readings: u32,
}

/// What the measurement looks at: [`evtach_core::Settings`] without what preferences and sensor say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct View {
    /// Part of the sensor; `None`: all of it.
    pub roi: Option<Roi>,
    /// Length of the window in microseconds; `None`: as long as the rotor needs.
    pub window_us: Option<u32>,
}

/// What became of the events that the sensor sent since the start: each is counted once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fate {
    /// Handed to the measurement, and not late.
    pub used: u64,
    /// Left out evenly before, because more waited to be measured, or by the camera, because it was told to.
    pub thinned: u64,
    /// Handed to the measurement, and in no window that was measured: the stream or the settings broke off, or one took far too long.
    pub late: u64,
    /// Lost by the sensor or the link.
    pub lost_before: u64,
    /// Lost, because there was no room.
    pub overrun: u64,
}

/// What the recorder does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RecorderState {
    /// There is no memory for recordings.
    #[default]
    Absent,
    /// Nothing is recorded.
    Idle,
    /// Events are being recorded.
    Running,
    /// The recording has ended because it holds the events asked for, or all there is room for.
    Full,
}

/// The recorder at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecorderStatus {
    /// What it does.
    pub state: RecorderState,
    /// Events it holds.
    pub events: u32,
    /// Events it has room for.
    pub capacity: u32,
}

impl<M: Storage> From<&Recorder<M>> for RecorderStatus {
    fn from(recorder: &Recorder<M>) -> Self {
        let state = if recorder.is_running() {
            RecorderState::Running
        } else if recorder.is_full() {
            RecorderState::Full
        } else {
            RecorderState::Idle
        };
        Self { state, events: recorder.events(), capacity: recorder.capacity() }
    }
}

/// The memory of the recorder failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the memory for recordings failed: record again")]
pub struct RecorderFailed;

/// The rest of the device, as the link sees and changes it. Nothing here waits.
pub trait Device {
    /// Who answers.
    fn identity(&self) -> Identity<'_>;

    /// Whether a sensor answers.
    fn sensor(&self) -> Sensor;

    /// Why none does, where something is plugged in.
    fn trouble(&self) -> Option<Trouble> {
        None
    }

    /// The reading that the screen shows, held or live, its speeds corrected by the clock's trim; `None` while it
    /// shows none.
    fn reading(&self) -> Option<&Reading>;

    /// The last reading, whether the screen shows it or, by now, something else.
    fn last_reading(&self) -> Option<&Reading>;

    /// Why the screen shows no reading.
    fn reason(&self) -> Reason;

    /// Readings so far; wraps.
    fn readings(&self) -> u32;

    /// Middle of the first reading in sensor time, from which log lines count, in microseconds.
    fn first_us(&self) -> u64;

    /// Whether a speed lies outside of the limits.
    fn alarm(&self) -> bool;

    /// Fastest, slowest and mean since they were cleared; `None` before the first speed.
    fn statistics(&self) -> Option<Statistics>;

    /// Revolutions counted since they were cleared.
    fn revolutions(&self) -> Option<f32>;

    /// Forgets statistics and revolutions.
    fn clear_statistics(&mut self);

    /// Shows what is measured now: no hold, no statistics on the screen.
    fn go_live(&mut self);

    /// Shows one rotor (0 is A) as the big number; `None` lets the device choose.
    fn select(&mut self, rotor: Option<u8>);

    /// The rotor chosen, by a person or by the link.
    fn selected(&self) -> Option<u8>;

    /// What the person chose.
    fn preferences(&self) -> Preferences;

    /// Takes over what the link chose, and has it stored.
    fn set_preferences(&mut self, preferences: Preferences);

    /// Size of the sensor, where one is known.
    fn geometry(&self) -> Option<Geometry>;

    /// What became of the events so far.
    fn fate(&self) -> Fate;

    /// What the measurement looks at; not kept over power cycles.
    fn view(&self) -> View;

    /// Measures this from the next window on.
    fn set_view(&mut self, view: View);

    /// What happened to the device, and in its own words; kept until it is acknowledged.
    fn fault(&self) -> Option<(Fault, &str)>;

    /// The fault has been read.
    fn acknowledge_fault(&mut self);

    /// The pixels on the screen, row by row, each RGB565 in two bytes, little-endian; none without a screen.
    fn screen(&self) -> &[u8] {
        &[]
    }

    /// What the recorder does.
    fn recorder(&self) -> RecorderStatus;

    /// Records the next events, up to so many, over what was recorded before.
    ///
    /// # Errors
    /// When the memory fails.
    fn start_recording(&mut self, events: u32) -> Result<(), RecorderFailed>;

    /// Ends the recording.
    fn stop_recording(&mut self);

    /// Copies the recording, header included, from a byte on; bytes beyond its end are not touched.
    ///
    /// # Errors
    /// When the memory fails.
    fn read_recording(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), RecorderFailed>;
}

//! A device on the bench: everything the link sees, held in plain fields that a test may set.

use evtach_core::{Event, Geometry, PackedEvent, Reading, Reason};
use evtach_firmware::instrument::{Fault, Preferences, Sensor};
use evtach_firmware::recorder::Recorder;
use evtach_firmware::scpi::{
    Device, Fate, Identity, Link, RecorderFailed, RecorderStatus, Statistics, View,
};
use evtach_firmware::sensor::usb::Trouble;

/// Memory for recordings that fails when told to.
pub struct Ram {
    pub bytes: Vec<u8>,
    pub broken: bool,
}

impl embedded_storage::ReadStorage for Ram {
    type Error = ();

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), ()> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        if self.broken { Err(()) } else { Ok(()) }
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl embedded_storage::Storage for Ram {
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), ()> {
        self.bytes[offset as usize..][..bytes.len()].copy_from_slice(bytes);
        if self.broken { Err(()) } else { Ok(()) }
    }
}

/// The device.
pub struct Bench {
    pub sensor: Sensor,
    pub trouble: Option<Trouble>,
    pub geometry: Option<Geometry>,
    pub reading: Option<Reading>,
    /// The screen shows something else than the reading.
    pub stale: bool,
    pub reason: Reason,
    pub readings: u32,
    pub first_us: u64,
    pub alarm: bool,
    pub statistics: Option<Statistics>,
    pub live: bool,
    pub selected: Option<u8>,
    pub preferences: Preferences,
    /// Times that preferences were set.
    pub saves: u32,
    pub view: View,
    pub fault: Option<(Fault, String)>,
    pub recorder: Option<Recorder<Ram>>,
}

impl Bench {
    /// A device with room to record so many bytes.
    pub fn new(memory_bytes: usize) -> Self {
        let ram = Ram { bytes: vec![0; memory_bytes], broken: false };
        Self {
            sensor: Sensor::Present,
            trouble: None,
            geometry: Geometry::new(320, 240),
            reading: None,
            stale: false,
            reason: Reason::Searching,
            readings: 0,
            first_us: 0,
            alarm: false,
            statistics: None,
            live: true,
            selected: None,
            preferences: Preferences::default(),
            saves: 0,
            view: View::default(),
            fault: None,
            recorder: (memory_bytes > 0).then(|| Recorder::new(ram)),
        }
    }

    /// A new reading.
    pub fn show(&mut self, reading: Reading) {
        self.reading = Some(reading);
        self.readings = self.readings.wrapping_add(1);
    }

    /// Events from the sensor, to the recorder.
    pub fn record(&mut self, events: &[Event]) {
        let packed: Vec<PackedEvent> = events.iter().map(PackedEvent::pack).collect();
        if let (Some(recorder), Some(first)) = (&mut self.recorder, events.first()) {
            recorder.push(first.t_us, &packed).ok();
        }
    }
}

impl Device for Bench {
    fn identity(&self) -> Identity<'_> {
        Identity { serial: "0", version: "1.2.3" }
    }

    fn sensor(&self) -> Sensor {
        self.sensor
    }

    fn trouble(&self) -> Option<Trouble> {
        self.trouble
    }

    fn reading(&self) -> Option<&Reading> {
        self.reading.as_ref().filter(|_| !self.stale)
    }

    fn last_reading(&self) -> Option<&Reading> {
        self.reading.as_ref()
    }

    fn reason(&self) -> Reason {
        self.reason
    }

    fn readings(&self) -> u32 {
        self.readings
    }

    fn first_us(&self) -> u64 {
        self.first_us
    }

    fn alarm(&self) -> bool {
        self.alarm
    }

    fn statistics(&self) -> Option<Statistics> {
        self.statistics
    }

    fn fate(&self) -> Fate {
        Fate { used: 800, thinned: 150, late: 30, lost_before: 15, overrun: 5 }
    }

    fn revolutions(&self) -> Option<f32> {
        self.statistics.map(|_| 12.5)
    }

    fn clear_statistics(&mut self) {
        self.statistics = None;
    }

    fn go_live(&mut self) {
        self.live = true;
    }

    fn select(&mut self, rotor: Option<u8>) {
        self.selected = rotor;
    }

    fn selected(&self) -> Option<u8> {
        self.selected
    }

    fn preferences(&self) -> Preferences {
        self.preferences
    }

    fn set_preferences(&mut self, preferences: Preferences) {
        self.preferences = preferences;
        self.saves += 1;
    }

    fn geometry(&self) -> Option<Geometry> {
        self.geometry
    }

    fn view(&self) -> View {
        self.view
    }

    fn set_view(&mut self, view: View) {
        self.view = view;
    }

    fn fault(&self) -> Option<(Fault, &str)> {
        self.fault.as_ref().map(|(fault, words)| (*fault, words.as_str()))
    }

    fn acknowledge_fault(&mut self) {
        self.fault = None;
    }

    fn recorder(&self) -> RecorderStatus {
        self.recorder.as_ref().map(RecorderStatus::from).unwrap_or_default()
    }

    fn start_recording(&mut self, events: u32) -> Result<(), RecorderFailed> {
        match (&mut self.recorder, self.geometry) {
            (Some(recorder), Some(geometry)) => recorder.start(geometry, events),
            _ => return Err(RecorderFailed),
        }
        Ok(())
    }

    fn stop_recording(&mut self) {
        if let Some(recorder) = &mut self.recorder {
            recorder.stop();
        }
    }

    fn read_recording(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), RecorderFailed> {
        let recorder = self.recorder.as_mut().ok_or(RecorderFailed)?;
        recorder.read(offset, bytes).map_err(|_| RecorderFailed)
    }
}

/// Lets the link work and collects all that it has to say.
pub fn drain(link: &mut Link, bench: &mut Bench, now_us: u64) -> Vec<u8> {
    let mut out = Vec::new();
    loop {
        link.run(now_us, bench);
        let mut piece = [0; 61];
        match link.transmit(&mut piece, bench) {
            0 => return out,
            count => out.extend_from_slice(&piece[..count]),
        }
    }
}

/// Sends bytes and collects what comes back.
pub fn exchange(link: &mut Link, bench: &mut Bench, mut bytes: &[u8], now_us: u64) -> Vec<u8> {
    let mut out = Vec::new();
    loop {
        let taken = link.receive(bytes);
        bytes = &bytes[taken..];
        let piece = drain(link, bench, now_us);
        let stuck = taken == 0 && piece.is_empty();
        out.extend(piece);
        if bytes.is_empty() || stuck {
            return out;
        }
    }
}

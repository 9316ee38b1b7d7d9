//! Files that go away, and events to put into them.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use evtach_core::{Event, Geometry, Polarity};
use evtach_host::recording::{self, OpenOptions, Recording, RecordingError};

/// A folder that goes away with its value.
pub struct Scratch(PathBuf);

impl Scratch {
    /// An empty folder.
    pub fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let folder =
            std::env::temp_dir().join(format!("evtach-test-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("the temporary folder is writable");
        Self(folder)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// A file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// What a recording gave.
pub struct Read {
    /// All events up to the end or the damage.
    pub events: Vec<Event>,
    /// The recording after that.
    pub recording: Recording,
    /// The damage.
    pub error: Option<RecordingError>,
}

/// Reads a recording to its end.
pub fn read(path: &Path, geometry: Option<Geometry>) -> Result<Read, RecordingError> {
    let mut recording = recording::open(path, &OpenOptions { geometry, ..OpenOptions::default() })?;
    let mut events = Vec::new();
    let error = loop {
        match recording.read_chunk(&mut events) {
            Ok(true) => {}
            Ok(false) => break None,
            Err(error) => break Some(error),
        }
    };
    Ok(Read { events, recording, error })
}

/// Reads bytes as a recording.
pub fn read_bytes(
    name: &str,
    bytes: &[u8],
    geometry: Option<Geometry>,
) -> Result<Read, RecordingError> {
    let scratch = Scratch::new();
    let file = scratch.file(name);
    std::fs::write(&file, bytes).expect("the temporary folder is writable");
    read(&file, geometry)
}

/// An event.
pub fn event(t_us: u64, x: u16, y: u16, on: bool) -> Event {
    Event { t_us, x, y, polarity: if on { Polarity::On } else { Polarity::Off } }
}

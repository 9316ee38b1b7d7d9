//! What every target does with a recording.

use std::io::Cursor;
use std::path::PathBuf;

use evtach_core::{Event, Geometry};
use evtach_host::recording::{self, OpenOptions, Recording, RecordingError};

/// Reads bytes behind a prefix that makes them this format; once with the size told, once without.
pub fn read_behind(prefix: &[u8], data: &[u8]) {
    for geometry in [None, Geometry::new(640, 480)] {
        let bytes = [prefix, data].concat();
        drain(recording::open_reader(
            Box::new(Cursor::new(bytes)),
            &OpenOptions { geometry, ..OpenOptions::default() },
        ));
    }
}

/// Reads bytes as a file, for formats that need to seek and for the pass that looks for the size.
pub fn read_file(data: &[u8]) {
    let path = scratch();
    if std::fs::write(&path, data).is_ok() {
        drain(recording::open(&path, &OpenOptions::default()));
    }
}

fn scratch() -> PathBuf {
    let folder = if std::path::Path::new("/dev/shm").is_dir() {
        "/dev/shm".into()
    } else {
        std::env::temp_dir()
    };
    folder.join(format!("evtach-fuzz-{}", std::process::id()))
}

fn drain(opened: Result<Recording, RecordingError>) {
    let mut recording = match opened {
        Ok(recording) => recording,
        Err(error) => return check(&error),
    };
    let mut events: Vec<Event> = Vec::new();
    loop {
        events.clear();
        let more = recording.read_chunk(&mut events);
        let geometry = recording.geometry;
        assert!(events.iter().all(|event| geometry.contains(event.x, event.y)));
        let _ = recording.take_imu();
        match more {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                check(&error);
                // Behind damage there is nothing more.
                events.clear();
                assert!(
                    matches!(recording.read_chunk(&mut events), Ok(false)) && events.is_empty()
                );
                break;
            }
        }
    }
}

/// Every error says what to do.
fn check(error: &RecordingError) {
    assert!(error.to_string().contains("\nhelp: "), "{error}");
}

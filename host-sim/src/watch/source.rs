//! Where readings come from: a recording at its own pace, or a device at a serial port.

use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use evtach_core::Settings;
use serial2::SerialPort;

use super::Told;
use crate::measure::{Capacity, Parts, ReadingRow, drain, feed, with_tachometer};
use crate::recording::{Recording, SHUFFLED};

/// Readings on their way to the screen.
const WAITING: usize = 64;
/// How long the port is waited for before it is asked whether to go on.
const PATIENCE: Duration = Duration::from_millis(100);
/// Longest line that a device sends: eight rotors of 250 bytes each.
const LONGEST_LINE: usize = 8 * 1024;
/// Events are handed on in pieces of this many microseconds of the recording.
const PIECE_US: u64 = 20_000;

/// Why a port cannot be watched.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// It cannot be opened. The message tells the cause, which is no source beside it: it would be told twice.
    #[error("{}: {cause}; check the cable, and that no other program has the port open", .path.display())]
    Open {
        /// The port.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
}

/// A source at work in a thread of its own.
#[derive(Debug)]
pub struct Source {
    /// What it tells.
    pub told: Receiver<Told>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Source {
    fn start(work: impl FnOnce(&Teller) + Send + 'static) -> Self {
        let (sender, told) = mpsc::sync_channel(WAITING);
        let stop = Arc::new(AtomicBool::new(false));
        let teller = Teller { sender, stop: Arc::clone(&stop) };
        Self { told, stop, thread: Some(thread::spawn(move || work(&teller))) }
    }
}

impl Drop for Source {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A teller that waits for room would wait for ever.
        while self.told.try_recv().is_ok() {}
        if let Some(thread) = self.thread.take() {
            while !thread.is_finished() {
                self.told.recv_timeout(PATIENCE).ok();
            }
            thread.join().ok();
        }
    }
}

struct Teller {
    sender: SyncSender<Told>,
    stop: Arc<AtomicBool>,
}

impl Teller {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn tell(&self, told: Told) {
        // Nobody listens once the view is closed.
        self.sender.send(told).ok();
    }
}

/// Plays a recording with the device's memory, `speed` times as fast as it was recorded.
#[must_use]
pub fn file(mut recording: Recording, speed: f64) -> Source {
    Source::start(move |teller| {
        let settings = Settings::new(recording.geometry);
        with_tachometer(settings, Capacity::Device, |tachometer| {
            let start = Instant::now();
            let (mut first_us, mut part) = (None, Vec::new());
            let mut parts = Parts::of(&mut recording, Capacity::Device);
            while !parts.is_done() {
                let set_back_us = parts.next(&mut part);
                // Of what is out of order so far no reading is right.
                if parts.recording.is_shuffled() {
                    part.clear();
                }
                tachometer.lost(parts.newly_lost());
                for piece in part.chunk_by(|a, b| a.t_us / PIECE_US == b.t_us / PIECE_US) {
                    let Some(last) = piece.last() else { continue };
                    let first_us = *first_us.get_or_insert(piece[0].t_us);
                    let since_us = parts.timeline.at(last.t_us).saturating_sub(first_us);
                    let due_s = since_us as f64 * 1e-6 / speed;
                    wait(teller, start, due_s);
                    if teller.stopped() {
                        return;
                    }
                    feed(tachometer, piece, &mut &[][..], |reading| {
                        let laid = parts.timeline.laid(reading);
                        teller.tell(Told::Reading(ReadingRow::new(&laid, first_us)));
                    });
                }
                if set_back_us.is_some_and(|t_us| parts.set_back_to(t_us)) {
                    tachometer.configure(settings);
                }
            }
            let Parts { timeline, damage, .. } = parts;
            let set_back = timeline.is_set_back().then(|| timeline.note());
            let ignored = tachometer.ignored().out_of_order;
            let stepped = (ignored > 0)
                .then(|| format!("{ignored} events stepped back in time and were left out"));
            for remark in recording
                .notes()
                .into_iter()
                .chain(stepped)
                .chain(timeline.wrong_times())
                .chain(set_back)
            {
                teller.tell(Told::Remark(remark));
            }
            if recording.is_shuffled() {
                return teller.tell(Told::Refusal(SHUFFLED.to_owned()));
            }
            tachometer.finish();
            drain(tachometer, |reading| {
                let (laid, first_us) = (timeline.laid(reading), first_us.unwrap_or_default());
                teller.tell(Told::Reading(ReadingRow::new(&laid, first_us)));
            });
            teller.tell(damage.map_or(Told::End, |damage| Told::Failure(damage.to_string())));
        });
    })
}

/// Waits until so many seconds after the start, or until there is nobody to wait for.
fn wait(teller: &Teller, start: Instant, due_s: f64) {
    while !teller.stopped() {
        let left_s = due_s - start.elapsed().as_secs_f64();
        if left_s <= 0.0 {
            return;
        }
        thread::sleep(Duration::from_secs_f64(left_s.min(PATIENCE.as_secs_f64())));
    }
}

/// Asks the device at a serial port for its log, and for quiet in the end.
///
/// # Errors
///
/// When the port cannot be opened.
pub fn port(path: &Path, baud: u32) -> Result<Source, SourceError> {
    let opened = SerialPort::open(path, baud).and_then(|mut port| {
        port.set_read_timeout(PATIENCE)?;
        port.set_write_timeout(PATIENCE)?;
        Ok(port)
    });
    let port = opened.map_err(|cause| SourceError::Open { path: path.into(), cause })?;
    Ok(listen_to(port))
}

/// The same over any stream of bytes whose reads end after [`PATIENCE`].
fn listen_to(mut port: impl Read + Write + Send + 'static) -> Source {
    Source::start(move |teller| {
        if let Err(error) = listen(&mut port, teller) {
            teller.tell(Told::Failure(format!("the port failed: {error}; check the cable")));
        }
        port.write_all(b"SYST:LOG OFF\n").ok();
    })
}

fn listen(port: &mut (impl Read + Write), teller: &Teller) -> io::Result<()> {
    port.write_all(b"SYST:LOG ON\n")?;
    let mut line: Vec<u8> = Vec::new();
    let mut bytes = [0; 512];
    while !teller.stopped() {
        let count = match port.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => count,
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                continue;
            }
            Err(error) => return Err(error),
        };
        for byte in &bytes[..count] {
            match byte {
                b'\n' => {
                    if let Some(told) = parse(&line) {
                        teller.tell(told);
                    }
                    line.clear();
                }
                _ if line.len() == LONGEST_LINE => line.clear(),
                byte => line.push(*byte),
            }
        }
    }
    Ok(())
}

/// A reading, or what else the device says; nothing for an empty line.
fn parse(line: &[u8]) -> Option<Told> {
    let text = String::from_utf8_lossy(line);
    let text = text.trim();
    if text.is_empty() {
        return None;
    }
    Some(match serde_json::from_str(text) {
        Ok(reading) => Told::Reading(reading),
        Err(error) => {
            let shown: String = text.chars().take(40).collect();
            Told::Note(format!("no reading: \"{shown}\" ({error})"))
        }
    })
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::net::UnixStream;

    use super::*;
    use crate::recording::write::{WriteFormat, create};
    use crate::recording::{self, OpenOptions, RecordingError};

    fn demo() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../demo/fan.raw")
    }

    const LINE: &str = r#"{"t_s":1.25,"window_s":0.15,"status":"locked","reason":null,"rotors":[{"id":"A","x_px":167.5,"y_px":146.0,"radius_px":55.0,"rpm":1180.3,"rpm_sigma":0.63,"direction":"cw","blades":5,"accel_rpm_per_s":null,"frame":"camera","status":"locked","reason":null}]}"#;

    #[test]
    fn a_device_is_asked_for_its_log_heard_and_left_in_quiet() -> io::Result<()> {
        let (ours, mut device) = UnixStream::pair()?;
        device.set_read_timeout(Some(Duration::from_secs(5)))?;
        ours.set_read_timeout(Some(PATIENCE))?;
        let source = listen_to(ours);
        let mut asked = [0; 12];
        device.read_exact(&mut asked)?;
        assert_eq!(&asked, b"SYST:LOG ON\n");
        // The rest of a line that was under way, a line in two pieces, and something that is no reading.
        device.write_all(b"\":null}]}\r\n")?;
        device.write_all(&LINE.as_bytes()[..40])?;
        thread::sleep(Duration::from_millis(20));
        device.write_all(&LINE.as_bytes()[40..])?;
        device.write_all(b"\r\n\r\n")?;
        let patience = Duration::from_secs(5);
        let first = source.told.recv_timeout(patience).map_err(io::Error::other)?;
        assert!(matches!(first, Told::Note(note) if note.contains(":null}]}")));
        let second = source.told.recv_timeout(patience).map_err(io::Error::other)?;
        let Told::Reading(reading) = second else { return Err(io::Error::other("no reading")) };
        assert_eq!((reading.t_s, reading.rotors[0].rpm), (1.25, Some(1180.3)));
        drop(source);
        let mut asked = [0; 13];
        device.read_exact(&mut asked)?;
        assert_eq!(&asked, b"SYST:LOG OFF\n");
        Ok(())
    }

    #[test]
    fn the_cause_of_a_port_that_does_not_open_is_told_once() {
        let error = port(Path::new("/dev/null"), 115_200).expect_err("no port");
        assert!(std::error::Error::source(&error).is_none(), "{error}");
    }

    #[test]
    fn the_line_is_the_object_that_measure_prints() -> serde_json::Result<()> {
        let reading: ReadingRow = serde_json::from_str(LINE)?;
        assert_eq!(serde_json::to_string(&reading)?, LINE);
        Ok(())
    }

    #[test]
    fn a_recording_tells_its_readings_then_that_it_has_ended() -> Result<(), RecordingError> {
        let source = file(recording::open(&demo(), &OpenOptions::default())?, 1e6);
        let told: Vec<Told> = source.told.iter().collect();
        let (last, readings) = told.split_last().expect("something was told");
        assert_eq!(last, &Told::End);
        assert!(
            readings
                .iter()
                .all(|told| matches!(told, Told::Reading(row) if row.rotors[0].rpm.is_some()))
        );
        assert!(!readings.is_empty());
        Ok(())
    }

    #[test]
    fn a_shuffled_recording_tells_no_reading() -> Result<(), RecordingError> {
        let mut events = Vec::new();
        let mut demo = recording::open(&demo(), &OpenOptions::default())?;
        while demo.read_chunk(&mut events)? {}
        for block in events.chunk_by_mut(|a, b| a.t_us / 4_000 == b.t_us / 4_000) {
            block.sort_by_key(|event| (event.y, event.x, event.t_us));
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("shuffled.csv");
        let mut writer = create(&path, WriteFormat::Csv, demo.geometry)?;
        writer.write(&events)?;
        writer.finish()?;
        let source = file(recording::open(&path, &OpenOptions::default())?, 1e6);
        let told: Vec<Told> = source.told.iter().collect();
        assert_eq!(told, [Told::Refusal(SHUFFLED.to_owned())]);
        Ok(())
    }

    #[test]
    fn what_is_to_be_known_of_a_recording_is_told_before_its_end() -> Result<(), RecordingError> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("wild.csv");
        // Outside the sensor; by a clock that is set back.
        let first: String = (0..20).map(|i| format!("50000{i:02},1,2,1\n")).collect();
        let text = format!("%geometry:64,48\nt,x,y,p\n{first}5000020,99,2,1\n7,1,2,0\n");
        std::fs::write(&path, text).expect("room on the disk");
        let source = file(recording::open(&path, &OpenOptions::default())?, 1e6);
        let told: Vec<Told> = source.told.iter().collect();
        let remarks = told.iter().filter_map(|told| match told {
            Told::Remark(remark) => Some(remark.split_whitespace().take(4).collect::<Vec<_>>()),
            _ => None,
        });
        let expected = [["1", "events", "outside", "the"], ["behind", "event", "20", "the"]];
        assert_eq!(remarks.collect::<Vec<_>>(), expected);
        assert_eq!(told.last(), Some(&Told::End));
        Ok(())
    }

    #[test]
    fn a_view_that_is_closed_early_stops_its_source() -> Result<(), RecordingError> {
        let start = Instant::now();
        // Two minutes long at this speed.
        drop(file(recording::open(&demo(), &OpenOptions::default())?, 0.001));
        assert!(start.elapsed() < Duration::from_secs(30));
        Ok(())
    }
}

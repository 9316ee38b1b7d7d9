//! Finds out what a file is by looking inside, and opens it.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use evtach_core::{Event, Geometry};
use flate2::read::MultiGzDecoder;

use super::error::RecordingError;
use super::geometry::{self, KnownSize};
use super::input::Input;
use super::prophesee_header::Header;
use super::{
    OpenOptions, Opened, Recording, Side, TimeUnit, aedat2, aedat3, aedat4, csv, dat, es, ev8, npy,
    raw, ros2, spi,
};

/// Bytes looked at to tell text from binary.
const SNIFF_BYTES: usize = 4096;

/// Opens a recording; "-" reads stdin.
///
/// # Errors
/// When the file cannot be read, is no known recording, or its sensor size is neither told nor inferable.
pub fn open(path: &Path, options: &OpenOptions) -> Result<Recording, RecordingError> {
    let progress = Progress::default();
    let mut opened = recognise(input(path, &progress)?, path, options)?;
    let geometry = if let Some(geometry) = settled(&mut opened, options) {
        geometry
    } else {
        if is_pipe(path) {
            return Err(RecordingError::NoGeometry { format: opened.format });
        }
        let geometry = scan(&mut opened)?;
        let options = OpenOptions { geometry: Some(geometry.size), ..*options };
        opened = recognise(input(path, &progress)?, path, &options)?;
        geometry
    };
    Ok(Recording::new(opened, &geometry, progress))
}

/// Whether a recording cannot be read twice: stdin, and what is no file by another name, as `<(...)` of a shell.
fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-" || std::fs::metadata(path).is_ok_and(|found| !found.is_file())
}

/// The size that the person stated, else what the recording told.
fn settled(opened: &mut Opened, options: &OpenOptions) -> Option<KnownSize> {
    let stated = options.geometry.map(|size| KnownSize::new(size, "as given by --geometry"));
    stated.or(opened.geometry.take())
}

/// Opens a recording from any source of bytes, as a pipe is read: the size of the sensor must be told by the recording
/// or by `options`, and .npz and .db3 are refused.
///
/// # Errors
/// When the source cannot be read, is no known recording, or its sensor size is not told.
pub fn open_reader(
    reader: Box<dyn Read + Send>,
    options: &OpenOptions,
) -> Result<Recording, RecordingError> {
    let progress = Progress::default();
    let read = Arc::clone(&progress.read);
    let input = Input::new(Box::new(Counted { reader, read }));
    let mut opened = recognise(input, Path::new("-"), options)?;
    let geometry = settled(&mut opened, options)
        .ok_or(RecordingError::NoGeometry { format: opened.format })?;
    Ok(Recording::new(opened, &geometry, progress))
}

fn input(path: &Path, progress: &Progress) -> Result<Input, RecordingError> {
    let read = Arc::clone(&progress.read);
    if path.as_os_str() == "-" {
        return Ok(Input::new(Box::new(Counted { reader: std::io::stdin(), read })));
    }
    if std::fs::metadata(path).map_err(RecordingError::Open)?.is_dir() {
        return Err(RecordingError::Unsupported {
            what: "this is a folder".to_owned(),
            advice: "give the recording in it; of a ROS 2 bag the .db3 or .mcap file".to_owned(),
        });
    }
    read.store(0, Ordering::Relaxed);
    let file = File::open(path).map_err(RecordingError::Open)?;
    Ok(Input::new(Box::new(Counted { reader: file, read })))
}

/// How far reading got, in bytes of the file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Progress {
    read: Arc<AtomicU64>,
}

impl Progress {
    pub fn bytes(&self) -> u64 {
        self.read.load(Ordering::Relaxed)
    }
}

/// Counts what is read, below any decompressor.
struct Counted<R> {
    reader: R,
    read: Arc<AtomicU64>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let count = self.reader.read(out)?;
        self.read.fetch_add(count as u64, Ordering::Relaxed);
        Ok(count)
    }
}

/// Reads through a recording to see where its events lie.
fn scan(opened: &mut Opened) -> Result<KnownSize, RecordingError> {
    let mut events: Vec<Event> = Vec::new();
    let (mut x_max, mut y_max) = (0, 0);
    let (mut any, mut any_on_sensor, mut damage) = (false, false, None);
    loop {
        events.clear();
        let more = opened.source.read(&mut events, &mut Side::default()).unwrap_or_else(|error| {
            damage = Some(error);
            false
        });
        // Others lie outside of any sensor, and are counted when the recording is read for good.
        let on_sensor = |e: &&Event| e.x < Geometry::MAX_PX && e.y < Geometry::MAX_PX;
        any |= !events.is_empty();
        for event in events.iter().filter(on_sensor) {
            any_on_sensor = true;
            x_max = x_max.max(event.x);
            y_max = y_max.max(event.y);
        }
        if !more {
            break;
        }
    }
    // Damage behind an event will be told when the recording is read for good.
    if let Some(error) = damage.filter(|_| !any_on_sensor) {
        return Err(error);
    }
    if !any {
        return Err(RecordingError::NoEvents { format: opened.format });
    }
    let found = any_on_sensor
        .then(|| geometry::of_extent(x_max.saturating_add(1), y_max.saturating_add(1)))
        .flatten();
    let size = found.ok_or(RecordingError::NoGeometry { format: opened.format })?;
    let how = format!(
        "because events lie in columns 0 to {x_max} and rows 0 to {y_max} (the file does not say its size; --geometry overrides)"
    );
    Ok(KnownSize::new(size, how))
}

/// Formats whose times are bare numbers.
const WITHOUT_UNIT: [&str; 3] = ["CSV", "NPY", "NPZ"];

/// Recognises the format, and refuses what is stated in vain.
fn recognise(input: Input, path: &Path, options: &OpenOptions) -> Result<Opened, RecordingError> {
    let opened = sniff(input, path, options, true)?;
    if options.time_unit.is_some() && !WITHOUT_UNIT.contains(&opened.format) {
        return Err(RecordingError::Unsupported {
            what: format!("the times of {} are in a unit of their own", opened.format),
            advice: "leave out --time-unit".to_owned(),
        });
    }
    Ok(opened)
}

/// Recognises the format by its first bytes. Some formats count rows or columns from the other end: they need the
/// size to turn them round, stated where the file does not tell it.
fn sniff(
    mut input: Input,
    path: &Path,
    options: &OpenOptions,
    unpack: bool,
) -> Result<Opened, RecordingError> {
    let OpenOptions { geometry: known, time_unit } = *options;
    let head = input.peek(SNIFF_BYTES)?;
    if head.is_empty() {
        return Err(RecordingError::Empty);
    }
    if head.starts_with(&[0x1f, 0x8b]) && unpack {
        let mut opened =
            sniff(Input::new(Box::new(MultiGzDecoder::new(input))), path, options, false)?;
        opened.about.push(("compression".to_owned(), "gzip".to_owned()));
        return Ok(opened);
    }
    if head.starts_with(aedat4::MAGIC) {
        return aedat4::open(input);
    }
    if head.starts_with(aedat2::MAGIC_2) {
        return aedat2::open(input, "AEDAT2", 4, known);
    }
    if head.starts_with(aedat2::MAGIC_1) {
        return aedat2::open(input, "AEDAT1", 2, known);
    }
    if head.starts_with(aedat3::MAGIC) {
        return aedat3::open(input, known);
    }
    if head.starts_with(es::MAGIC) {
        return es::open(input);
    }
    if head.starts_with(spi::MAGIC) {
        return spi::open(input);
    }
    if head.starts_with(ev8::MAGIC) {
        return ev8::open(input);
    }
    if head.starts_with(npy::MAGIC) {
        return npy::open(input, time_unit);
    }
    if head.starts_with(npy::ZIP_MAGIC) {
        return if is_pipe(path) || !unpack {
            Err(needs_file("an .npz archive"))
        } else {
            npy::open_npz(path, time_unit)
        };
    }
    if head.starts_with(ros2::MCAP_MAGIC) {
        return ros2::open_mcap(input);
    }
    if head.starts_with(ros2::SQLITE_MAGIC) {
        return if is_pipe(path) || !unpack {
            Err(needs_file("a .db3 bag"))
        } else {
            ros2::open_sqlite(path)
        };
    }
    if head.starts_with(b"\x89HDF\r\n\x1a\n") {
        return Err(hdf5());
    }
    if head.starts_with(b"#ROSBAG V") {
        return Err(RecordingError::Unsupported {
            what: "this is a ROS 1 bag".to_owned(),
            advice: "convert it to ROS 2: pip install rosbags, then rosbags-convert --src FILE.bag --dst FOLDER".to_owned(),
        });
    }
    if head.starts_with(b"%") {
        return prophesee(input, time_unit);
    }
    if csv::is_text(head) {
        return csv::open(input, time_unit);
    }
    Err(RecordingError::Unknown {
        found: format!("binary data that begins with {:02x?}", &head[..head.len().min(8)]),
        advice: "see the table of formats; RAW without its header needs the lines \"% evt 3.0\" and \"% geometry WxH\" in front",
    })
}

fn needs_file(what: &str) -> RecordingError {
    RecordingError::Unsupported {
        what: format!("{what} cannot be read from a pipe or inside another archive"),
        advice: "save it to a file and give its name".to_owned(),
    }
}

/// HDF5 event files are packed by Prophesee's own ECF codec, which no kept crate reads.
fn hdf5() -> RecordingError {
    RecordingError::Unsupported {
        what: "this is an HDF5 file; its events are packed by Prophesee's ECF codec, which is not read here".to_owned(),
        advice: "convert it with OpenEB: metavision_file_to_csv -i FILE.hdf5 -o FILE.csv, then give the CSV".to_owned(),
    }
}

fn prophesee(mut input: Input, time_unit: Option<TimeUnit>) -> Result<Opened, RecordingError> {
    let header = Header::peek(&mut input)?;
    if header.get("evt").is_some() || header.get("format").is_some() {
        return raw::open(input, header);
    }
    let start = header.length;
    let bytes = input.peek(start + SNIFF_BYTES)?;
    let data = bytes.get(start..).unwrap_or_default();
    if dat::is_dat(data) {
        return Ok(dat::open(input, header));
    }
    // A text may end behind its size: then it has no events.
    let size_only = data.is_empty() && bytes.starts_with(b"%geometry:");
    if csv::is_text(data) || size_only {
        return csv::open(input, time_unit);
    }
    Err(RecordingError::Unknown {
        found: "a Prophesee header without an \"evt\" or \"format\" line".to_owned(),
        advice: "add the line \"% evt 2.0\" or \"% evt 3.0\" to its header, whichever the camera wrote",
    })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test")]
mod tests {
    use super::*;

    fn recognised(text: &'static str) -> Opened {
        let input = Input::new(Box::new(text.as_bytes()));
        recognise(input, Path::new("-"), &OpenOptions::default()).unwrap()
    }

    fn scanned(text: &'static str) -> Result<KnownSize, RecordingError> {
        scan(&mut recognised(text))
    }

    #[test]
    fn damage_before_any_event_is_told_instead_of_the_missing_size() {
        let error = scanned("t,x,y,p\n-5,1,2,1\n6,1,2,0\n").unwrap_err();
        assert!(error.to_string().starts_with("CSV, line 2: the time is \"-5\""), "{error}");
        // Behind an event it is told when that has been read.
        assert!(scanned("t,x,y,p\n5,1,2,1\n-6,1,2,0\n").is_ok());
    }

    #[test]
    fn where_there_are_no_events_no_size_is_asked_for() {
        let error = scanned("t,x,y,p\n").unwrap_err();
        assert!(error.to_string().starts_with("CSV without events"), "{error}");
        // No sensor is as large.
        let error = scanned("t,x,y,p\n5,5000,7,1\n").unwrap_err();
        assert!(matches!(error, RecordingError::NoGeometry { .. }), "{error}");
    }

    #[test]
    fn a_coordinate_that_no_sensor_has_does_not_count_for_the_size() {
        let text = "t,x,y,p\n5,300,200,1\n6,-1,3,0\n7,3,2048,0\n8,5,100,0\n";
        let size = scanned(text).unwrap();
        assert_eq!(Some(size.size), Geometry::new(304, 240));
        let mut recording = Recording::new(recognised(text), &size, Progress::default());
        let mut events = Vec::new();
        while recording.read_chunk(&mut events).unwrap() {}
        assert_eq!((events.len(), recording.out_of_bounds()), (2, 2));
    }

    #[test]
    fn a_text_with_its_size_only_has_no_events() {
        let mut opened = recognised("%geometry:640,480\n");
        assert_eq!(opened.geometry.take().map(|known| known.size), Geometry::new(640, 480));
        assert!(matches!(scan(&mut opened), Err(RecordingError::NoEvents { .. })));
    }
}

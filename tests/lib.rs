//! Helpers shared by the tests that cross crates.

pub mod visa;

use std::cell::RefCell;
use std::env;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use evtach_core::{Event, Geometry, Reading, RotorReading, Settings};
use evtach_host::measure::{Capacity, Summary, measure_events, summarise};
use evtach_host::recording::{self, OpenOptions, RecordingError};
use evtach_host::synth::{RotorTruth, Scene, Synthetic, generate};

/// Writes a table to the test's output, past libtest, which shows what `println!` writes for failed tests only.
pub fn show(text: &str) {
    // Nobody reads it where stdout is closed: no reason to fail.
    let _ = io::stdout().lock().write_all(format!("{text}\n").as_bytes());
}

/// Folder of the recordings that are not part of the project, where it is present: `EVTACH_RECORDINGS`, else
/// `../shared/recordings` beside the project. Without it prints "skipped".
#[must_use]
pub fn recordings(sub: &str) -> Option<PathBuf> {
    let folder = env::var_os("EVTACH_RECORDINGS").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recordings"),
        PathBuf::from,
    );
    let folder = folder.join(sub);
    if !folder.is_dir() {
        show(&format!("skipped: no recordings ({})", folder.display()));
        return None;
    }
    Some(folder)
}

/// Scenes of a thread that are kept.
const KEPT: usize = 2;

thread_local! {
    /// The last ones, and what was made of them.
    static MADE: RefCell<Vec<(Scene, Rc<Synthetic>)>> = const { RefCell::new(Vec::new()) };
}

/// What a scene in range looks like to a camera. Making it takes several times as long as measuring it, so the last ones of each test
/// are kept: most are measured with both memories.
///
/// # Panics
/// When the scene is out of range.
#[must_use]
pub fn made(scene: &Scene) -> Rc<Synthetic> {
    MADE.with_borrow_mut(|kept| {
        if let Some((_, made)) = kept.iter().find(|(known, _)| known == scene) {
            return Rc::clone(made);
        }
        let made = Rc::new(generate(scene).expect("a scene in range"));
        kept.truncate(KEPT - 1);
        kept.insert(0, (scene.clone(), Rc::clone(&made)));
        made
    })
}

/// A recording in memory.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Size of the sensor.
    pub geometry: Geometry,
    /// Its events.
    pub events: Vec<Event>,
}

/// Reads a recording as `evtach measure` opens it: nothing given by hand.
///
/// # Errors
/// When it is no recording, or damaged.
pub fn load(path: &Path) -> Result<Loaded, RecordingError> {
    let mut recording = recording::open(path, &OpenOptions::default())?;
    let mut events = Vec::new();
    while recording.read_chunk(&mut events)? {}
    Ok(Loaded { geometry: recording.geometry, events })
}

/// Measures as `evtach measure` does: the series, and the reading over all of it.
#[must_use]
pub fn measure(loaded: &Loaded, capacity: Capacity) -> (Vec<Reading>, Summary) {
    let settings = Settings::new(loaded.geometry);
    let (readings, _) = measure_events(&loaded.events, &[], settings, capacity);
    let first_us = loaded.events.first().map_or(0, |event| event.t_us);
    let last_us = loaded.events.last().map_or(0, |event| event.t_us);
    let summary = summarise(&readings, &(first_us..last_us), settings.clock_sigma_ppm);
    (readings, summary)
}

/// What is true of a rotor.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
pub struct Truth {
    /// Mean place of the centre in pixels.
    pub centre_px: [f64; 2],
    /// Radius of the tips in pixels.
    pub radius_px: f64,
    /// Tilt of the axis against the line of sight in degrees: the tips go round an ellipse.
    pub tilt_deg: f64,
    /// Blades.
    pub blades: u8,
    /// Mean speed as the camera sees it in rpm, positive clockwise on the screen.
    #[serde(rename = "rpm_camera_mean_signed")]
    pub rpm_camera: f64,
    /// Mean speed relative to the room in rpm, same sign.
    #[serde(rename = "rpm_room_mean_signed")]
    pub rpm_room: f64,
}

/// Farthest that a centre may be from its place, and a radius from its length, over the radius.
const LARGEST_MISPLACEMENT: f64 = 0.15;

impl Truth {
    /// How far the rotor's centre was told from where it is in pixels.
    #[must_use]
    pub fn centre_off_px(&self, rotor: &RotorReading) -> f64 {
        let [x_px, y_px] = self.centre_px;
        (f64::from(rotor.x_px) - x_px).hypot(f64::from(rotor.y_px) - y_px)
    }

    /// What is wrong with the circle that was told for the rotor.
    #[must_use]
    pub fn misplaced(&self, rotor: &RotorReading) -> Option<String> {
        let most_px = LARGEST_MISPLACEMENT * self.radius_px;
        let radius_px = f64::from(rotor.radius_px);
        let least_px = self.radius_px * self.tilt_deg.to_radians().cos();
        let right = self.centre_off_px(rotor) <= most_px
            && (least_px - most_px..=self.radius_px + most_px).contains(&radius_px);
        let Self { centre_px: [x_px, y_px], radius_px: right_px, .. } = *self;
        let RotorReading { x_px: x, y_px: y, .. } = rotor;
        (!right).then(|| {
            format!(
                "at ({x:.0}, {y:.0}) r {radius_px:.0} px instead of ({x_px:.0}, {y_px:.0}) r {right_px:.0} px"
            )
        })
    }
}

impl From<&RotorTruth> for Truth {
    fn from(rotor: &RotorTruth) -> Self {
        Self {
            centre_px: rotor.centre_px,
            radius_px: rotor.radius_px,
            tilt_deg: rotor.tilt_deg,
            blades: rotor.blades,
            rpm_camera: rotor.rpm_camera_mean_signed,
            rpm_room: rotor.rpm_room_mean_signed,
        }
    }
}

/// Pairs every true rotor with the measured one nearest to its centre, not farther than half its radius.
/// Measured rotors that are left over stand in the second list: ghosts.
#[must_use]
pub fn pair<'r>(
    truths: &[Truth],
    summary: &'r Summary,
) -> (Vec<Option<&'r RotorReading>>, Vec<&'r RotorReading>) {
    let mut left: Vec<&RotorReading> =
        summary.rotors.iter().filter(|rotor| rotor.speed.is_some()).collect();
    let paired = truths
        .iter()
        .map(|truth| {
            let distance = |rotor: &RotorReading| {
                let (dx, dy) = (
                    f64::from(rotor.x_px) - truth.centre_px[0],
                    f64::from(rotor.y_px) - truth.centre_px[1],
                );
                dx.hypot(dy)
            };
            let nearest = (0..left.len())
                .filter(|i| distance(left[*i]) < truth.radius_px / 2.0)
                .min_by(|a, b| distance(left[*a]).total_cmp(&distance(left[*b])))?;
            Some(left.swap_remove(nearest))
        })
        .collect();
    (paired, left)
}

//! What is exactly true of a synthetic recording.

use evtach_core::Direction;
use serde::{Deserialize, Serialize};

use super::motion::Motion;
use super::scene::Scene;

/// What a tachometer should do with the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Something turns.
    Reading,
    /// Nothing turns.
    Refuse,
}

/// The truth about one rotor. Times are seconds of true time from the start of the recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotorTruth {
    /// Mean place of the centre on the sensor, in pixels.
    pub centre_px: [f64; 2],
    /// Path of the centre: time in seconds, column and row in pixels, every 10 ms.
    pub centre_path_px: Vec<[f64; 3]>,
    /// Radius of the blade tips in pixels.
    pub radius_px: f64,
    /// Blades.
    pub blades: u8,
    /// `cw` or `ccw` on the screen.
    pub direction: String,
    /// Mean speed relative to the room in rpm, positive clockwise on the screen.
    pub rpm_room_mean_signed: f64,
    /// Mean speed relative to the camera in rpm: the room's plus the image's mean roll.
    pub rpm_camera_mean_signed: f64,
    /// Speed relative to the room at the start, in rpm.
    pub rpm_room_start_signed: f64,
    /// Speed relative to the room at the end, in rpm.
    pub rpm_room_end_signed: f64,
    /// Angle of the first blade at the start in radians.
    pub phase0_rad: f64,
    /// Tilt of the axis against the line of sight in degrees.
    pub tilt_deg: f64,
    /// Events that this rotor caused and that are in the recording: those lost in the readout are not.
    pub events: u64,
}

/// The truth about a recording; written beside it as `truth.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// What a tachometer should do.
    pub verdict: Verdict,
    /// Columns and rows of the sensor.
    pub sensor_size: [u16; 2],
    /// Length of the recording in seconds of true time.
    pub duration_s: f64,
    /// Rotors in the order of the scene.
    pub rotors: Vec<RotorTruth>,
    /// Mean roll rate of the image in rad/s, positive clockwise on the screen.
    pub roll_mean_rad_s: f64,
    /// Error of the sensor's clock in ppm, positive: fast, so that speeds appear lower.
    pub clock_error_ppm: f64,
    /// Events in the recording.
    pub events: u64,
    /// Events lost because the readout's queue was full.
    pub dropped: u64,
    /// What the recording was made from.
    pub scene: Scene,
}

impl Truth {
    /// The truth of a scene, given how many events it made.
    #[must_use]
    pub fn new(
        scene: &Scene,
        motion: &Motion,
        of_rotor: &[u64],
        events: u64,
        dropped: u64,
    ) -> Self {
        let duration_s = scene.duration_s();
        let rotors: Vec<_> = (0..scene.rotors.len())
            .filter_map(|i| rotor_truth(scene, motion, i, of_rotor.get(i).copied().unwrap_or(0)))
            .collect();
        let seen = scene.rotors.iter().any(|r| r.contrast != 0.0);
        Self {
            verdict: if seen { Verdict::Reading } else { Verdict::Refuse },
            sensor_size: [scene.width_px, scene.height_px],
            duration_s,
            rotors,
            roll_mean_rad_s: (motion.roll(duration_s) - motion.roll(0.0)) / duration_s,
            clock_error_ppm: motion.clock_error_ppm(),
            events,
            dropped,
            scene: scene.clone(),
        }
    }
}

fn rotor_truth(scene: &Scene, motion: &Motion, number: usize, events: u64) -> Option<RotorTruth> {
    let rotor = scene.rotors.get(number)?;
    let spin = motion.spins().get(number)?;
    let duration_s = scene.duration_s();
    let steps = (duration_s / 0.01).ceil().max(1.0) as u32;
    let path: Vec<[f64; 3]> = (0..=steps)
        .map(|i| {
            let t_s = (f64::from(i) * 0.01).min(duration_s);
            let [x, y] = motion.centre(rotor, t_s);
            [t_s, x, y]
        })
        .collect();
    let mean = |k: usize| path.iter().map(|p| p[k]).sum::<f64>() / path.len() as f64;
    let direction = if rotor.rpm < 0.0 { Direction::Ccw } else { Direction::Cw };
    let rpm = 60.0 / std::f64::consts::TAU;
    Some(RotorTruth {
        centre_px: [mean(1), mean(2)],
        radius_px: rotor.radius_px,
        blades: rotor.blades,
        direction: direction.as_str().to_owned(),
        rpm_room_mean_signed: motion.rpm_room(number, 0.0, duration_s)?,
        rpm_camera_mean_signed: motion.rpm_camera(number, 0.0, duration_s)?,
        rpm_room_start_signed: spin.rate(0.0) * rpm,
        rpm_room_end_signed: spin.rate(duration_s) * rpm,
        phase0_rad: spin.angle(0.0),
        tilt_deg: rotor.tilt_deg,
        events,
        centre_path_px: path,
    })
}

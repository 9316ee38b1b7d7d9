//! Sums over the seeds.

use std::collections::BTreeMap;

use evtach_host::synth::{Model, Motion, Scene};
use serde_json::{Map, Value};

use super::super::drive::Capacity;
use super::super::score::Score;
use super::super::spec::{Mount, bound};

/// What is in front of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// One rotor.
    One {
        /// Nominal speed in rpm.
        rpm: u32,
        /// Blades.
        blades: u8,
        /// Distance in cm; the radius follows.
        distance_cm: u32,
        /// How the camera is held.
        mount: Mount,
    },
    /// Four rotors.
    Quad,
}

impl Place {
    /// How the camera is held.
    pub const fn mount(&self) -> Mount {
        match self {
            Self::One { mount, .. } => *mount,
            Self::Quad => Mount::Fixed,
        }
    }
}

/// Which part of the recording is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Window {
    /// The paper's 150 ms.
    Paper,
    /// As long as the tachometer thinks fit.
    Adaptive,
}

/// An event model that can be ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ModelKey {
    /// [`Model::Threshold`].
    Threshold,
    /// [`Model::Edge`].
    Edge,
}

impl From<Model> for ModelKey {
    fn from(model: Model) -> Self {
        match model {
            Model::Threshold => Self::Threshold,
            Model::Edge => Self::Edge,
        }
    }
}

impl ModelKey {
    /// The name used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Threshold => "threshold",
            Self::Edge => "edge",
        }
    }
}

/// One cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    /// Conditions.
    pub place: Place,
    /// Event model.
    pub model: ModelKey,
    /// Memory.
    pub capacity: Capacity,
    /// Part of the recording.
    pub window: Window,
    /// Whether gyro samples were given.
    pub gyro: bool,
}

/// What is averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Initial alignment.
    Initial,
    /// Refinement.
    Refined,
    /// Further refinement.
    Further,
    /// Long-baseline registration.
    Lock,
    /// The reading relative to the camera.
    Reading,
    /// The reading relative to the room.
    Room,
    /// The reading relative to the camera with the clock's known error taken out.
    Own,
    /// The bound for all of the rotor's events.
    Bound,
    /// The camera's mean roll rate over the rotor's speed: no method that only sees the rotor can know it.
    Roll,
}

impl Stage {
    /// All of them, in the order of [`Sample::values`].
    pub const ALL: [Self; 9] = [
        Self::Initial,
        Self::Refined,
        Self::Further,
        Self::Lock,
        Self::Reading,
        Self::Room,
        Self::Own,
        Self::Bound,
        Self::Roll,
    ];

    /// The name used in tables and records.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Initial => "initial",
            Self::Refined => "refined",
            Self::Further => "further",
            Self::Lock => "lock",
            Self::Reading => "reading",
            Self::Room => "room",
            Self::Own => "own",
            Self::Bound => "bound",
            Self::Roll => "roll",
        }
    }
}

/// One rotor of one recording: magnitudes in permille.
#[derive(Clone, Debug)]
pub struct Sample {
    values: [Option<f64>; Stage::ALL.len()],
}

impl Sample {
    /// The sample of a score; `events_per_s` counts the rotor's events.
    pub fn new(score: Score, scene: &Scene, motion: &Motion, events_per_s: f64) -> Self {
        let seen = score.camera.is_some();
        let window_s = score.window_s;
        let bound = bound(scene.sensor.jitter_us, window_s, events_per_s * window_s);
        // The difference between the two truths is the roll.
        let roll =
            score.room.zip(score.camera).map(|(room, camera)| (1.0 + room) / (1.0 + camera) - 1.0);
        let clock = motion.clock_error_ppm() * 1e-6;
        let own = score.camera.map(|error| (1.0 + error) * (1.0 + clock) - 1.0);
        let values = [
            score.initial,
            score.refined,
            score.further,
            score.lock,
            score.camera,
            score.room,
            own,
            seen.then_some(bound),
            roll,
        ];
        Self { values: values.map(|v| v.map(|v| v.abs() * 1e3)) }
    }
}

/// Sum of one stage over the seeds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    sum: f64,
    worst: f64,
    count: u32,
    missing: u32,
}

impl Sum {
    /// Mean over the seeds that gave a value.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }

    /// Seeds without a value.
    pub fn missing(&self) -> u32 {
        self.missing
    }
}

/// All cells.
#[derive(Debug, Default)]
pub struct Cells(BTreeMap<Key, [Sum; Stage::ALL.len()]>);

impl Cells {
    /// Adds a sample.
    pub fn add(&mut self, key: Key, sample: &Sample) {
        for (sum, value) in self.0.entry(key).or_default().iter_mut().zip(sample.values) {
            match value {
                Some(value) => {
                    sum.sum += value;
                    sum.worst = sum.worst.max(value);
                    sum.count += 1;
                }
                None => sum.missing += 1,
            }
        }
    }

    /// The sum of a stage in a cell.
    pub fn get(&self, key: &Key, stage: Stage) -> Option<&Sum> {
        let index = Stage::ALL.iter().position(|s| *s == stage)?;
        self.0.get(key)?.get(index)
    }

    /// Mean of a stage over cells that count alike; `None` where any of them has no value.
    pub fn mean(&self, keys: &[Key], stage: Stage) -> Option<f64> {
        let mean = |key| self.get(key, stage)?.mean();
        let means = keys.iter().map(mean).collect::<Option<Vec<f64>>>()?;
        (!means.is_empty()).then(|| means.iter().sum::<f64>() / means.len() as f64)
    }

    /// Places that were measured.
    pub fn places(&self) -> Vec<Place> {
        let mut places: Vec<Place> = self.0.keys().map(|k| k.place).collect();
        places.dedup();
        places
    }

    /// One record for each cell.
    pub fn records(&self) -> Vec<Map<String, Value>> {
        self.0.iter().map(|(key, sums)| record(key, sums)).collect()
    }
}

fn record(key: &Key, sums: &[Sum; Stage::ALL.len()]) -> Map<String, Value> {
    let mut record = Map::new();
    let mut put = |name: &str, value: Value| record.insert(name.to_owned(), value);
    let (rotors, rpm, blades, distance_cm, mount) = match key.place {
        Place::Quad => (4, None, 2, None, Mount::Fixed),
        Place::One { rpm, blades, distance_cm, mount } => {
            (1, Some(rpm), blades, Some(distance_cm), mount)
        }
    };
    put("rotors", rotors.into());
    put("rpm", rpm.into());
    put("blades", blades.into());
    put("distance_cm", distance_cm.into());
    put("mount", mount.as_str().into());
    put("model", key.model.as_str().into());
    put("capacity", key.capacity.as_str().into());
    put("window", if key.window == Window::Paper { "150ms" } else { "adaptive" }.into());
    put("gyro", key.gyro.into());
    for (stage, sum) in Stage::ALL.iter().zip(sums) {
        put(&format!("{}_permille", stage.as_str()), sum.mean().into());
    }
    let reading = &sums[4];
    put("worst_permille", reading.worst.into());
    put("readings", reading.count.into());
    put("missing", reading.missing.into());
    record
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_takes_the_clock_and_the_roll_apart() {
        let mut scene = Scene::default();
        scene.clock.error_ppm = Some(100.0);
        let motion = Motion::new(&scene);
        let score =
            Score { camera: Some(-100e-6), room: Some(200e-6), window_s: 0.15, ..Score::default() };
        let sample = Sample::new(score, &scene, &motion, 1e6);
        let value = |stage: Stage| {
            let i = Stage::ALL.iter().position(|s| *s == stage);
            i.and_then(|i| sample.values[i]).unwrap_or(f64::NAN)
        };
        assert!((value(Stage::Reading) - 0.1).abs() < 1e-9);
        assert!(value(Stage::Own) < 1e-4);
        assert!((value(Stage::Roll) - 0.3).abs() < 1e-3);
        assert!(value(Stage::Initial).is_nan());
    }
}

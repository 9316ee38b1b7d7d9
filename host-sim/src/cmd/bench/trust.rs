//! `evtach bench trust`: can a reading be relied on?
//!
//! Random scenes, a fifth of them without any rotor ([`scenes`] says which), over both event models. Every reading of every
//! recording is compared with the room's truth of its own window. How often the stated error holds is asked of the last
//! speed of each rotor, as readings of one recording are much alike; of all speeds is told how many are more than six of
//! it off. Results go to a file line by line, so that a long run may be stopped and taken up again by the same build. A wrong reading
//! makes the exit code 1, and so does what falls short of what is asked in a thousand scenes or more.

mod scenes;
mod tally;

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::hash::{DefaultHasher, Hasher as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::{Context as _, bail};
use evtach_core::{Geometry, Reading, Settings};
use evtach_host::synth::{Model, Motion, Scene, generate};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::drive::{Capacity, readings};
use super::report::{Report, progress};
use super::score::{Score, Scores, is_wrong, score};
use super::spec;
use super::{Common, say_line};
use crate::cmd::tell;

/// Counts the changes of [`scenes`]: results of different scenes must not be mixed in one file.
const SCENES_VERSION: u32 = 3;

/// Arguments of `evtach bench trust`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Number of scenes.
    #[arg(long)]
    trials: Option<u64>,
    /// Seed of the first scene, for scenes that nobody has seen [default: 1000, the first scored one].
    #[arg(long, value_name = "SEED", conflicts_with = "tuning", value_parser = clap::value_parser!(u64).range(spec::SCORED_FROM..))]
    first: Option<u64>,
    /// Results so far; scenes that are in it are not run again.
    #[arg(long, default_value = "evtach-trust.jsonl")]
    file: PathBuf,
    /// Print the scene of one trial as JSON and run nothing.
    #[arg(long, value_name = "TRIAL")]
    show: Option<u64>,
}

/// First line of the file.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    scenes_version: u32,
    version: String,
    /// Hash of the program: another build may read the same scene otherwise.
    build: u64,
}

impl Head {
    fn of_this_build() -> anyhow::Result<Self> {
        let program = std::env::current_exe().and_then(std::fs::read);
        let mut build = DefaultHasher::new();
        build.write(&program.context("this program cannot be read")?);
        let build = build.finish();
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Self { scenes_version: SCENES_VERSION, version, build })
    }
}

/// What became of one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Trial {
    /// Seed of the scene.
    trial: u64,
    /// Event model of the scene.
    model: Model,
    /// Rotors in the scene.
    rotors: usize,
    /// Events in a second.
    events_per_s: f64,
    /// One for each capacity.
    results: Vec<Outcome>,
}

/// What one capacity made of a scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Outcome {
    capacity: String,
    /// Speeds given where no rotor is, over all readings.
    ghosts: usize,
    /// Speeds given for rotors, over all readings.
    speeds: usize,
    /// Of these, more than 1 % off.
    wrong: usize,
    /// Of the speeds, those with a standard error.
    with_sigma: usize,
    /// Of these, more than six standard errors off.
    beyond_6: usize,
    /// Why the last reading gave no speed at all.
    reason: Option<String>,
    /// The conclusive reading of each rotor: its own last one with a speed, else the last.
    rotors: Vec<Spoken>,
}

/// The conclusive reading of one rotor.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Spoken {
    /// Whether a reading is owed: three periods, two turns, 20 px, 2000 events a turn.
    owed: bool,
    /// Relative error against the room; `None`: no speed.
    error: Option<f64>,
    /// Stated relative standard error.
    sigma: Option<f64>,
    /// Whether it is locked.
    locked: bool,
    /// Why there is no speed, where the rotor was found.
    reason: Option<String>,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> anyhow::Result<Report> {
    if let Some(trial) = args.show {
        say_line(serde_json::to_string_pretty(&scenes::scene(trial))?)?;
        return Ok(Report { name: "trust", ..Report::default() });
    }
    let count = args.trials.unwrap_or(if args.common.quick { 40 } else { 3000 });
    if args.common.tuning && count > spec::SCORED_FROM {
        bail!("there are only {} tuning seeds: give --trials {0} or fewer", spec::SCORED_FROM);
    }
    let first = args.first.unwrap_or_else(|| spec::first_seed(args.common.tuning));
    let wanted = first..first.saturating_add(count);
    let known = if args.common.quick { Vec::new() } else { resume(&args.file)? };
    let done: BTreeSet<u64> = known.iter().map(|t| t.trial).collect();
    let todo: Vec<u64> = wanted.clone().filter(|t| !done.contains(t)).collect();
    if !done.is_empty() {
        tell(format!("{}: {} scenes done, {} to go", args.file.display(), done.len(), todo.len()));
    }
    let sink = if args.common.quick {
        None
    } else {
        let file = OpenOptions::new().append(true).open(&args.file);
        Some(Mutex::new(file.with_context(|| {
            format!("{}: cannot be written; choose another --file", args.file.display())
        })?))
    };
    let bar = progress(todo.len(), "trust");
    let fresh = todo
        .par_iter()
        .map(|&number| {
            let trial = measure(number)?;
            if let Some(sink) = &sink {
                let line = serde_json::to_string(&trial)? + "\n";
                let mut file = sink.lock().map_err(|_| anyhow::anyhow!("another trial failed"))?;
                file.write_all(line.as_bytes())?;
            }
            bar.inc(1);
            Ok(trial)
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    bar.finish_and_clear();
    let mut trials: Vec<Trial> =
        known.into_iter().filter(|t| wanted.contains(&t.trial)).chain(fresh).collect();
    trials.sort_by_key(|t| t.trial);
    Ok(tally::report(&trials))
}

/// Reads what a run before left, and starts the file where there is none.
fn resume(path: &Path) -> anyhow::Result<Vec<Trial>> {
    let head = Head::of_this_build()?;
    if !path.exists() {
        let mut file = std::fs::File::create(path).with_context(|| {
            format!("{}: cannot be created; choose another --file", path.display())
        })?;
        writeln!(file, "{}", serde_json::to_string(&head)?)?;
        return Ok(Vec::new());
    }
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{}: cannot be read; choose another --file", path.display()))?;
    let mut lines = text.lines();
    let first = lines.next().unwrap_or_default();
    if serde_json::from_str::<Head>(first).ok().as_ref() != Some(&head) {
        bail!("{}: made by another build; delete it or choose another --file", path.display());
    }
    // A run that was stopped may have left half a line: it is ended, and its scene is run again.
    if !text.ends_with('\n') {
        let file = OpenOptions::new().append(true).open(path);
        file.and_then(|mut file| writeln!(file)).with_context(|| {
            format!("{}: cannot be written; choose another --file", path.display())
        })?;
    }
    Ok(lines.filter_map(|line| serde_json::from_str(line).ok()).collect())
}

fn measure(number: u64) -> anyhow::Result<Trial> {
    let scene = scenes::scene(number);
    let made = generate(&scene).with_context(|| format!("trial {number}"))?;
    let motion = Motion::new(&scene);
    let Some(geometry) = Geometry::new(scene.width_px, scene.height_px) else {
        bail!("the scene's sensor is larger than the tachometer's");
    };
    let owed: Vec<bool> =
        (0..scene.rotors.len()).map(|i| owed(&scene, made.truth.rotors[i].events, i)).collect();
    let settings = Settings { gyro_sigma_rad_s: spec::GYRO_SIGMA_RAD_S, ..Settings::new(geometry) };
    let results = Capacity::ALL.iter().map(|&capacity| {
        let series = readings(&made.events, &made.gyro, settings, capacity);
        outcome(&scene, &motion, &series, &owed, capacity)
    });
    Ok(Trial {
        trial: number,
        model: scene.model,
        rotors: scene.rotors.len(),
        events_per_s: made.events.len() as f64 / scene.duration_s(),
        results: results.collect(),
    })
}

/// Whether a reading of this rotor may be expected.
fn owed(scene: &Scene, events: u64, number: usize) -> bool {
    let rotor = &scene.rotors[number];
    let turns = scene.duration_s().min(2.0) * rotor.rpm.abs() / 60.0;
    let per_turn = events as f64 / (scene.duration_s() * rotor.rpm.abs() / 60.0);
    let periods = turns * f64::from(rotor.blades);
    turns >= 2.0 && periods >= 3.0 && rotor.radius_px >= 20.0 && per_turn >= 2000.0
}

/// By how many stated standard errors a speed is off; `None` where none is stated.
fn off_sigmas(error: f64, sigma: Option<f64>) -> Option<f64> {
    sigma.filter(|sigma| *sigma > 0.0).map(|sigma| (error / sigma).abs())
}

fn outcome(
    scene: &Scene,
    motion: &Motion,
    series: &[Reading],
    owed: &[bool],
    capacity: Capacity,
) -> Outcome {
    let scored: Vec<_> = series.iter().map(|reading| score(scene, motion, reading)).collect();
    let told = scored.iter().flat_map(|s| &s.rotors).flatten();
    let errors = told.clone().filter_map(|s| s.room);
    let off_sigmas = told.filter_map(|s| off_sigmas(s.room?, s.sigma));
    let wrong = errors.clone().filter(|e| is_wrong(*e)).count();
    // The last reading with this rotor's own speed: one that refuses it while it tells another takes nothing back.
    let found = |number: usize| -> Score {
        let of_rotor = |s: &Scores| s.rotors.get(number).cloned().flatten();
        let told = scored.iter().rev().filter_map(of_rotor).find(|s| s.room.is_some());
        told.or_else(|| scored.last().and_then(of_rotor)).unwrap_or_default()
    };
    let spoken = owed.iter().enumerate().map(|(number, &owed)| {
        let s = found(number);
        let reason = s.reason.map(str::to_owned);
        Spoken { owed, error: s.room, sigma: s.sigma, locked: s.locked, reason }
    });
    Outcome {
        capacity: capacity.as_str().to_owned(),
        ghosts: scored.iter().map(|s| s.ghosts).sum(),
        speeds: errors.count(),
        wrong,
        with_sigma: off_sigmas.clone().count(),
        beyond_6: off_sigmas.filter(|z| *z > 6.0).count(),
        reason: series.last().and_then(|r| r.status.reason()).map(|r| r.as_str().to_owned()),
        rotors: spoken.collect(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::report::tests::assert_readable;
    use super::*;

    fn args(file: PathBuf, trials: u64) -> Args {
        let common = Common { quick: false, json: false, csv: false, jobs: None, tuning: true };
        Args { common, trials: Some(trials), first: None, file, show: None }
    }

    #[test]
    fn a_run_is_taken_up_where_it_was_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trust.jsonl");
        let first = run(&args(path.clone(), 1)).unwrap();
        assert_readable(&first);
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 2, "{text}");
        // A change shows that the line is read, not made again; and the next one is half written.
        let marked = text.replace("\"rotors\":1,", "\"rotors\":7,");
        assert_ne!(marked, text);
        std::fs::write(&path, marked.clone() + "{\"trial\":1,\"rot").unwrap();
        let both = run(&args(path.clone(), 2)).unwrap();
        assert_readable(&both);
        assert_eq!(both.records[0]["scenes"], 2);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with(&marked) && text.lines().count() == 4, "{text}");
        let again = run(&args(path.clone(), 2)).unwrap();
        assert_eq!(again.records, both.records);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }

    #[test]
    fn a_file_of_other_scenes_or_of_another_build_is_not_gone_on_with() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trust.jsonl");
        assert!(resume(&path).unwrap().is_empty());
        let head = std::fs::read_to_string(&path).unwrap();
        for (key, other) in [("\"scenes_version\":", "9"), ("\"build\":", "0,\"was\":")] {
            std::fs::write(&path, head.replace(key, &format!("{key}{other}"))).unwrap();
            assert!(resume(&path).unwrap_err().to_string().contains("made by another build"));
        }
    }
}

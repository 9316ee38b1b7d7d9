//! `evtach bench accuracy`: the paper's five evaluations, and four rotors at once.
//!
//! RMAE is the relative mean absolute error of the paper: |measured - true| / true in permille, averaged over the seeds.
//! "initial", "refined" and "further" are the paper's stages within its window of 150 ms; "lock" is the long-baseline
//! registration in the same window; "reading" is the speed that is shown, at 150 ms and with the window that adapts to
//! the rotor. Truth is the mean over the very window, relative to the camera unless a column says room. All figures
//! but "own" contain the clock's error.

mod asked;
mod cells;
mod tables;

use evtach_core::{Event, Geometry, Reading, Settings};
use evtach_host::synth::{Model, Motion, Scene, generate};
use rayon::prelude::*;

use super::Common;
use super::drive::{Capacity, conclusive, readings};
use super::report::{Report, progress};
use super::score::score;
use super::spec::{self, Condition, Mount};
use cells::{Cells, Key, Place, Sample, Window};

/// Arguments of `evtach bench accuracy`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Seeds a cell.
    #[arg(long)]
    seeds: Option<u64>,
    /// Only this event model.
    #[arg(long, value_enum)]
    model: Option<Model>,
    /// Only these evaluations: all of them take hours.
    #[arg(long, value_enum)]
    only: Vec<Evaluation>,
    /// Only cameras held like this.
    #[arg(long, value_enum)]
    mount: Vec<Mount>,
}

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Evaluation {
    /// Speeds, before a fixed and a handheld camera and on a vibrating host.
    Speeds,
    /// Distances, before a fixed and a handheld camera.
    Distances,
    /// Blade counts.
    Blades,
    /// A drone's four rotors.
    Drone,
}

/// One recording to be made and measured.
struct Job {
    place: Place,
    model: Model,
    seed: u64,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> anyhow::Result<Report> {
    let quick = args.common.quick;
    let seeds = args.seeds.unwrap_or(if quick { 2 } else { spec::SEEDS });
    let first = spec::first_seed(args.common.tuning);
    let models = spec::models(args.model);
    let mut places = places(quick, &args.only);
    if !args.mount.is_empty() {
        places.retain(|place| args.mount.contains(&place.mount()));
    }
    let jobs: Vec<Job> = (first..first + seeds)
        .flat_map(|seed| models.iter().map(move |model| (seed, *model)))
        .flat_map(|(seed, model)| {
            places.iter().map(move |place| Job { place: *place, model, seed })
        })
        .collect();
    let bar = progress(jobs.len(), "accuracy");
    let samples = jobs
        .par_iter()
        .map(|job| {
            let samples = measure(job);
            bar.inc(1);
            samples
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    bar.finish_and_clear();
    let mut cells = Cells::default();
    samples.into_iter().flatten().for_each(|(key, sample)| cells.add(key, &sample));
    Ok(Report {
        name: "accuracy",
        tables: tables::tables(&cells, &models, seeds),
        records: cells.records(),
        short: asked::short(&cells, &models, seeds),
    })
}

/// The conditions of the tables that are wanted, or else of all, each once.
fn places(quick: bool, only: &[Evaluation]) -> Vec<Place> {
    let wanted = |evaluation| only.is_empty() && !quick || only.contains(&evaluation);
    let shown = |evaluation| only.is_empty() || only.contains(&evaluation);
    let one = |rpm, blades, distance_cm: f64, mount| Place::One {
        rpm: rpm as u32,
        blades,
        distance_cm: distance_cm as u32,
        mount,
    };
    let speeds: &[f64] = if quick { &[600.0, 3000.0] } else { &spec::SPEEDS_RPM };
    let mut places = Vec::new();
    for &rpm in speeds {
        for mount in [Mount::Fixed, Mount::Handheld, Mount::Vibrating] {
            if shown(Evaluation::Speeds) {
                places.push(one(rpm, 3, 40.0, mount));
            }
        }
        for distance_cm in spec::DISTANCES_CM {
            for mount in [Mount::Fixed, Mount::Handheld] {
                if wanted(Evaluation::Distances) {
                    places.push(one(rpm, 3, distance_cm, mount));
                }
            }
        }
        for blades in spec::BLADES {
            if wanted(Evaluation::Blades) {
                places.push(one(rpm, blades, 40.0, Mount::Fixed));
            }
        }
    }
    if shown(Evaluation::Drone) {
        places.push(Place::Quad);
    }
    places.sort_unstable();
    places.dedup();
    places
}

fn scene(job: &Job) -> Scene {
    match job.place {
        Place::Quad => spec::quad(job.model, job.seed),
        Place::One { rpm, blades, distance_cm, mount } => {
            let condition = Condition {
                rpm: f64::from(rpm),
                blades,
                radius_px: spec::RADIUS_PX_CM / f64::from(distance_cm),
                mount,
                model: job.model,
            };
            spec::scene(&condition, job.seed)
        }
    }
}

/// Makes one recording and measures it at each capacity, with either window, with and without gyro.
fn measure(job: &Job) -> anyhow::Result<Vec<(Key, Sample)>> {
    let scene = scene(job);
    let made = generate(&scene)?;
    let motion = Motion::new(&scene);
    let Some(geometry) = Geometry::new(scene.width_px, scene.height_px) else {
        anyhow::bail!("the scene's sensor is larger than the tachometer's");
    };
    let paper_us = (spec::PAPER_WINDOW_MS * 1e3) as u64;
    let in_paper_window = made.events.partition_point(|e| e.t_us < paper_us);
    let handheld = matches!(job.place, Place::One { mount: Mount::Handheld, .. });
    let mut samples = Vec::new();
    for capacity in Capacity::ALL {
        for window in [Window::Paper, Window::Adaptive] {
            for gyro in [false, true] {
                if gyro && !handheld {
                    continue;
                }
                let mut settings = Settings::new(geometry);
                settings.gyro_sigma_rad_s = spec::GYRO_SIGMA_RAD_S;
                settings.all_stages = true;
                let events: &[Event] = match window {
                    Window::Adaptive => &made.events,
                    Window::Paper => {
                        settings.window_us = Some(paper_us as u32);
                        &made.events[..in_paper_window]
                    }
                };
                let series =
                    readings(events, if gyro { &made.gyro } else { &[] }, settings, capacity);
                let key = Key { place: job.place, model: job.model.into(), capacity, window, gyro };
                let reading = conclusive(&series);
                let made_of = |number: usize| made.truth.rotors[number].events as f64;
                samples.extend(score_all(&scene, &motion, reading, made_of).map(|s| (key, s)));
            }
        }
    }
    Ok(samples)
}

/// One sample for each true rotor, found or not.
fn score_all(
    scene: &Scene,
    motion: &Motion,
    reading: Option<&Reading>,
    events: impl Fn(usize) -> f64,
) -> impl Iterator<Item = Sample> {
    let scores = reading.map(|r| score(scene, motion, r)).unwrap_or_default();
    let samples: Vec<Sample> = (0..scene.rotors.len())
        .map(|number| {
            let score = scores.rotors.get(number).cloned().flatten().unwrap_or_default();
            let rate = events(number) / scene.duration_s();
            Sample::new(score, scene, motion, rate)
        })
        .collect();
    samples.into_iter()
}

//! `evtach bench blind`: does it find the speed with nothing typed in?
//!
//! Right: within 1 % and with the right direction. A reading is owed where the window holds three symmetry periods and two
//! turns (2 s at most), the rotor makes 2000 events a turn, and the blades pass at most 150 000 times a minute; elsewhere
//! a refusal is as good as a reading. A wrong reading is wrong everywhere, and makes the exit code 1.

use evtach_core::{Geometry, Settings};
use evtach_host::synth::{Model, Motion, generate};
use rayon::prelude::*;
use serde_json::{Map, Value};

use super::Common;
use super::drive::{Capacity, conclusive, readings};
use super::report::{Report, Table, progress};
use super::score::score;
use super::spec::{self, Condition, Mount};

/// Speeds of the map in rpm.
const SPEEDS_RPM: [f64; 13] = [
    60.0, 90.0, 150.0, 300.0, 600.0, 1200.0, 3000.0, 6000.0, 12_000.0, 20_000.0, 30_000.0,
    45_000.0, 60_000.0,
];
/// Blade passages per minute beyond which `too_fast` is the right answer.
const MAX_PASSAGES: f64 = 150_000.0;
/// Events a turn from which a reading is owed.
const OWED_EVENTS_PER_TURN: f64 = 2000.0;

/// Arguments of `evtach bench blind`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Seeds a cell and model.
    #[arg(long)]
    seeds: Option<u64>,
    /// From the hand instead of from a tripod.
    #[arg(long)]
    handheld: bool,
}

/// What became of one recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Right,
    Wrong,
    Refused,
}

#[derive(Clone, Copy, Debug)]
struct Outcome {
    rpm: f64,
    blades: u8,
    model: Model,
    seed: u64,
    capacity: Capacity,
    owed: bool,
    verdict: Verdict,
    blades_right: bool,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> anyhow::Result<Report> {
    let quick = args.common.quick;
    let seeds = args.seeds.unwrap_or(if quick { 1 } else { 5 });
    let first = spec::first_seed(args.common.tuning);
    let speeds: &[f64] = if quick { &[150.0, 1200.0, 12_000.0] } else { &SPEEDS_RPM };
    let counts: &[u8] = if quick { &[1, 3, 6] } else { &[1, 2, 3, 4, 5, 6, 7, 8] };
    let mount = if args.handheld { Mount::Handheld } else { Mount::Fixed };
    let mut jobs = Vec::new();
    for seed in first..first + seeds {
        for model in spec::MODELS {
            for &rpm in speeds {
                for &blades in counts {
                    // Small enough that a pixel has recovered before the next edge.
                    let radius_px = if rpm > 10_000.0 { 32.0 } else { 50.0 };
                    jobs.push((Condition { rpm, blades, radius_px, mount, model }, seed));
                }
            }
        }
    }
    let bar = progress(jobs.len(), "blind");
    let outcomes = jobs
        .par_iter()
        .map(|(condition, seed)| {
            let outcomes = measure(condition, *seed);
            bar.inc(1);
            outcomes
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    bar.finish_and_clear();
    let outcomes: Vec<Outcome> = outcomes.into_iter().flatten().collect();
    let tables = Capacity::ALL.map(|capacity| table(&outcomes, speeds, counts, capacity, mount));
    Ok(Report {
        name: "blind",
        tables: tables.into(),
        records: outcomes.iter().map(record).collect(),
        wrong: outcomes.iter().filter_map(wrong).collect(),
    })
}

fn measure(condition: &Condition, seed: u64) -> anyhow::Result<[Outcome; 2]> {
    let scene = spec::scene(condition, seed);
    let made = generate(&scene)?;
    let motion = Motion::new(&scene);
    let rpm = scene.rotors[0].rpm.abs();
    let turns = scene.duration_s() * rpm / 60.0;
    let periods = turns * f64::from(condition.blades);
    let per_turn = made.truth.rotors[0].events as f64 / turns;
    let owed = turns >= 2.0
        && periods >= 3.0
        && per_turn >= OWED_EVENTS_PER_TURN
        && rpm * f64::from(condition.blades) <= MAX_PASSAGES;
    let Some(geometry) = Geometry::new(scene.width_px, scene.height_px) else {
        anyhow::bail!("the scene's sensor is larger than the tachometer's");
    };
    Ok(Capacity::ALL.map(|capacity| {
        let series = readings(&made.events, &[], Settings::new(geometry), capacity);
        let (mut verdict, mut blades_right) = (Verdict::Refused, false);
        if let Some(reading) = conclusive(&series) {
            let scores = score(&scene, &motion, reading);
            let found = scores.rotors.first().cloned().flatten();
            if let Some(error) = found.as_ref().and_then(|s| s.camera) {
                verdict = if error.abs() <= 0.01 { Verdict::Right } else { Verdict::Wrong };
            }
            if scores.ghosts > 0 {
                verdict = Verdict::Wrong;
            }
            blades_right = found.is_some_and(|s| s.blades == Some(condition.blades));
        }
        let Condition { rpm, blades, model, .. } = *condition;
        Outcome { rpm, blades, model, seed, capacity, owed, verdict, blades_right }
    }))
}

fn table(
    all: &[Outcome],
    speeds: &[f64],
    counts: &[u8],
    capacity: Capacity,
    mount: Mount,
) -> Table {
    let all: Vec<&Outcome> = all.iter().filter(|o| o.capacity == capacity).collect();
    let count = |f: &dyn Fn(&Outcome) -> bool| all.iter().filter(|o| f(o)).count();
    let owed = count(&|o| o.owed);
    let right = count(&|o| o.owed && o.verdict == Verdict::Right);
    let wrong = count(&|o| o.verdict == Verdict::Wrong);
    let named = count(&|o| o.verdict == Verdict::Right && o.blades_right);
    let any_right = count(&|o| o.verdict == Verdict::Right);
    let share = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
    let notes = vec![
        "right/recordings; !n: wrong readings; brackets: no reading is owed".to_owned(),
        format!("right where owed: {right} of {owed} ({:.1} %)", share(right, owed)),
        format!("wrong anywhere: {wrong} of {}", all.len()),
        format!("blade count right among right speeds: {:.1} %", share(named, any_right)),
    ];
    let mut columns = vec!["rpm".to_owned()];
    columns.extend(counts.iter().map(|n| format!("{n} blades")));
    let cell = |rpm: f64, blades: u8| {
        let here: Vec<_> = all.iter().filter(|o| o.rpm == rpm && o.blades == blades).collect();
        let of = |v: Verdict| here.iter().filter(|o| o.verdict == v).count();
        let wrong = of(Verdict::Wrong);
        let mark = if wrong > 0 { format!("!{wrong}") } else { String::new() };
        let text = format!("{}/{}{mark}", of(Verdict::Right), here.len());
        if here.iter().any(|o| o.owed) { text } else { format!("({text})") }
    };
    let rows = speeds
        .iter()
        .map(|&rpm| {
            let mut row = vec![format!("{rpm}")];
            row.extend(counts.iter().map(|&n| cell(rpm, n)));
            row
        })
        .collect();
    let title =
        format!("blind start, {}, both models [{} memory]", mount.as_str(), capacity.as_str());
    Table { title, notes, columns, rows }
}

/// Names the recording that was read wrongly.
fn wrong(o: &Outcome) -> Option<String> {
    (o.verdict == Verdict::Wrong).then(|| {
        let Outcome { rpm, blades, seed, .. } = o;
        let (model, capacity) = (model_name(o.model), o.capacity.as_str());
        format!(
            "wrong reading: {rpm} rpm, {blades} blades, seed {seed}, {model} model, {capacity} memory"
        )
    })
}

fn model_name(model: Model) -> &'static str {
    if model == Model::Edge { "edge" } else { "threshold" }
}

fn record(o: &Outcome) -> Map<String, Value> {
    let verdict = match o.verdict {
        Verdict::Right => "right",
        Verdict::Wrong => "wrong",
        Verdict::Refused => "refused",
    };
    let pairs: [(&str, Value); 7] = [
        ("rpm", o.rpm.into()),
        ("blades", o.blades.into()),
        ("model", model_name(o.model).into()),
        ("capacity", o.capacity.as_str().into()),
        ("owed", o.owed.into()),
        ("verdict", verdict.into()),
        ("blades_right", o.blades_right.into()),
    ];
    pairs.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}

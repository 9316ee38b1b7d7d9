//! `evtach bench blind`: does it find the speed with nothing typed in?
//!
//! Right: the conclusive reading is within 1 % and has the right direction. Wrong: any reading of the recording is not, or
//! tells a speed where no rotor is; that makes the exit code 1, and so does a wrong blade count beside a right speed, and less than
//! [`ASKED_SHARE`] right of where a reading is owed, unless it is a quick run. A reading is owed where the window holds three
//! symmetry periods and two turns (2 s at most), the rotor makes 2000 events a turn, it turns at most 60 000 times a minute and
//! its blades pass at most 150 000 times; elsewhere a refusal is as good as a reading.

mod tables;

use evtach_core::{Geometry, Reason, Settings};
use evtach_host::synth::{Model, Motion, generate};
use rayon::prelude::*;

use super::Common;
use super::drive::{Capacity, conclusive, readings};
use super::report::{Report, progress};
use super::score::{Scores, is_wrong, score};
use super::spec::{self, Condition, Mount};

/// Speeds of the map in rpm.
const SPEEDS_RPM: [f64; 13] = [
    60.0, 90.0, 150.0, 300.0, 600.0, 1200.0, 3000.0, 6000.0, 12_000.0, 20_000.0, 30_000.0,
    45_000.0, 60_000.0,
];
/// Blade passages and turns a minute beyond which `too_fast` is the right answer: seeds turn up to 3 % faster than their row says.
const MAX_PASSAGES: f64 = 150_000.0;
const MAX_RPM: f64 = 60_000.0;
/// Share of right ones among those that are owed a reading, at least.
const ASKED_SHARE: f64 = 0.99;
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
    /// Whether it turns, or its blades pass, so fast that `too_fast` is the right answer.
    too_fast: bool,
    found: Found,
}

/// What the readings of one recording say.
#[derive(Clone, Copy, Debug)]
struct Found {
    verdict: Verdict,
    readings: usize,
    wrong_readings: usize,
    /// Blades that were told with the speed, where they were counted.
    blades: Option<u8>,
    /// Why there is no speed, where it was refused.
    reason: Option<&'static str>,
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
    let mut short: Vec<String> = outcomes.iter().filter_map(tables::wrong).collect();
    short.extend(outcomes.iter().filter_map(tables::miscounted));
    if !quick {
        short.extend(
            Capacity::ALL.into_iter().filter_map(|memory| tables::refused(&outcomes, memory)),
        );
    }
    let mut shown = Vec::new();
    for model in spec::MODELS {
        for capacity in Capacity::ALL {
            let of = |o: &&Outcome| o.model == model && o.capacity == capacity;
            let these: Vec<&Outcome> = outcomes.iter().filter(of).collect();
            let (mount, model, memory) =
                (mount.as_str(), spec::model_name(model), capacity.as_str());
            let title = format!("blind start, {mount} [{model} model, {memory} memory]");
            shown.push(tables::table(title, &these, speeds, counts));
        }
    }
    Ok(Report {
        name: "blind",
        tables: shown,
        records: outcomes.iter().map(tables::record).collect(),
        short,
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
    let too_fast = rpm > MAX_RPM || rpm * f64::from(condition.blades) > MAX_PASSAGES;
    let owed = turns >= 2.0 && periods >= 3.0 && per_turn >= OWED_EVENTS_PER_TURN && !too_fast;
    let Some(geometry) = Geometry::new(scene.width_px, scene.height_px) else {
        anyhow::bail!("the scene's sensor is larger than the tachometer's");
    };
    Ok(Capacity::ALL.map(|capacity| {
        let series = readings(&made.events, &[], Settings::new(geometry), capacity);
        let score = |reading| score(&scene, &motion, reading);
        let scored: Vec<Scores> = series.iter().map(score).collect();
        let last = conclusive(&series).map(score).unwrap_or_default();
        let silent = series.last().and_then(|r| r.status.reason()).map(Reason::as_str);
        let Condition { rpm, blades, model, .. } = *condition;
        let found = judge(&scored, &last, silent);
        Outcome { rpm, blades, model, seed, capacity, owed, too_fast, found }
    }))
}

/// Judges all readings of a recording, the conclusive one, and why there was no speed in the last of them.
fn judge(scored: &[Scores], conclusive: &Scores, silent: Option<&'static str>) -> Found {
    let wrong = |s: &&Scores| {
        s.ghosts > 0 || s.rotors.iter().flatten().filter_map(|r| r.camera).any(is_wrong)
    };
    let wrong_readings = scored.iter().filter(wrong).count();
    let rotor = conclusive.rotors.first().and_then(Option::as_ref);
    let verdict = match rotor.and_then(|r| r.camera) {
        _ if wrong_readings > 0 => Verdict::Wrong,
        Some(_) => Verdict::Right,
        None => Verdict::Refused,
    };
    let reason = rotor.and_then(|r| r.reason).or(silent);
    Found {
        verdict,
        readings: scored.len(),
        wrong_readings,
        blades: rotor.and_then(|r| r.blades),
        reason: reason.filter(|_| verdict == Verdict::Refused),
    }
}

#[cfg(test)]
pub mod tests {
    use super::super::score::Score;
    use super::*;

    /// A reading of the one rotor with this error.
    pub fn told(error: f64) -> Scores {
        let score = Score { camera: Some(error), blades: Some(3), ..Score::default() };
        Scores { rotors: vec![Some(score)], ghosts: 0 }
    }

    /// A reading that found the rotor and refused it.
    pub fn refused(reason: &'static str) -> Scores {
        let score = Score { reason: Some(reason), ..Score::default() };
        Scores { rotors: vec![Some(score)], ghosts: 0 }
    }

    fn verdict(scored: &[Scores]) -> (Verdict, usize) {
        let found = judge(scored, &scored[scored.len() - 1], None);
        (found.verdict, found.wrong_readings)
    }

    #[test]
    fn one_wrong_reading_among_right_ones_makes_the_recording_wrong() {
        assert_eq!(verdict(&[told(0.001), told(-0.002)]), (Verdict::Right, 0));
        assert_eq!(verdict(&[told(0.02), told(0.001)]), (Verdict::Wrong, 1));
        assert_eq!(verdict(&[told(0.001), told(-2.0), told(0.001)]), (Verdict::Wrong, 1));
        assert_eq!(verdict(&[told(0.5), refused("ambiguous")]), (Verdict::Wrong, 1));
        let ghost = Scores { ghosts: 1, ..refused("ambiguous") };
        assert_eq!(verdict(&[ghost, told(0.001)]), (Verdict::Wrong, 1));
        assert_eq!(verdict(&[refused("ambiguous"), told(0.001)]), (Verdict::Right, 0));
    }

    #[test]
    fn a_refusal_is_named_by_the_rotor_and_else_by_the_reading() {
        let reason = |last: &Scores, silent| judge(&[], last, silent).reason;
        assert_eq!(reason(&refused("too_fast"), Some("ambiguous")), Some("too_fast"));
        assert_eq!(reason(&Scores::default(), Some("no_rotation")), Some("no_rotation"));
        assert_eq!(reason(&told(0.001), Some("no_rotation")), None);
    }
}

//! `evtach info`.

mod spectrum;
mod statistics;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use evtach_core::{Event, Polarity};
use evtach_host::measure;
use evtach_host::recording::{self, ImuSample, Recording};

use super::stated::Stated;
use super::{Outcome, say, tell};
use statistics::{Count, Statistics, Timeline};

/// Arguments of `evtach info`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings; "-" reads stdin.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    stated: Stated,
}

/// Columns of the picture of the rate over time.
const COLUMNS: u64 = 60;
/// Longest header value that is shown.
const MOST_VALUE_CHARS: usize = 80;
/// Header lines that are shown.
const MOST_HEADER_LINES: usize = 16;

/// Coherence from which on a line is common to the picture: real lamps reach 0.55, because dark pixels answer late;
/// rotors stay below 0.4.
const TOGETHER: f64 = 0.47;

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (mut told, mut worst) = (false, Outcome::Done);
    for file in &args.files {
        if let Err(error) = about(file, &args, &mut told) {
            tell(format!("evtach: {error:#}"));
            worst = Outcome::Failed;
        }
    }
    Ok(worst.into())
}

/// Tells of one file, behind a blank line where another was told of.
fn about(file: &Path, args: &Args, told: &mut bool) -> anyhow::Result<()> {
    let name = file.display().to_string();
    let options = args.stated.into();
    let mut recording = recording::open(file, &options).with_context(|| name.clone())?;
    let mut statistics = Statistics::new(recording.geometry);
    let (mut imu, mut imu_timeline) = (Vec::new(), measure::Timeline::default());
    let mut timeline = measure::Timeline::default();
    let mut chunk: Vec<Event> = Vec::new();
    let result = loop {
        chunk.clear();
        let more = recording.read_chunk(&mut chunk);
        timeline.lay(&chunk, |event| statistics.add(event));
        if recording.starts_anew() {
            timeline.start_anew();
        }
        note_imu(&mut imu, &mut imu_timeline, &recording.take_imu());
        match more {
            Ok(true) => {}
            Ok(false) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    let mut text = if *told { "\n".to_owned() } else { String::new() };
    // Writing into a string does not fail.
    let _ = report(&mut text, &name, &recording, &statistics, &imu);
    if let Some(wrong) = timeline.wrong_times() {
        let _ = writeln!(text, "note            {wrong}");
    }
    if timeline.is_set_back() {
        let _ =
            writeln!(text, "note            {}; its parts are laid end to end", timeline.note());
    }
    say(&text)?;
    *told = true;
    result.with_context(|| name)
}

/// Sum over inertial samples: number, first and last time. Their own times tell where the clock is set back: they need not come with the
/// events of theirs.
fn note_imu(spans: &mut Vec<Count>, timeline: &mut measure::Timeline, samples: &[ImuSample]) {
    let at = |sample: &ImuSample| Event { t_us: sample.t_us, x: 0, y: 0, polarity: Polarity::On };
    let times: Vec<Event> = samples.iter().map(at).collect();
    timeline.lay(&times, |laid| match spans.first_mut() {
        Some(span) => {
            span.count += 1;
            span.last_us = span.last_us.max(laid.t_us);
        }
        None => spans.push(Count { count: 1, first_us: laid.t_us, last_us: laid.t_us }),
    });
}

fn report(
    out: &mut String,
    name: &str,
    recording: &Recording,
    statistics: &Statistics,
    imu: &[Count],
) -> std::fmt::Result {
    let geometry = recording.geometry;
    let span_us = statistics.span_us();
    writeln!(out, "{name}")?;
    writeln!(out, "format          {}", recording.format)?;
    writeln!(out, "sensor          {}x{}", geometry.width_px, geometry.height_px)?;
    for (key, value) in recording.about.iter().take(MOST_HEADER_LINES) {
        let value: String = value.chars().take(MOST_VALUE_CHARS).collect();
        writeln!(out, "header          {key}: {value}")?;
    }
    if statistics.all.count == 0 {
        writeln!(out, "events          none")?;
    } else {
        writeln!(
            out,
            "duration        {} ({:.6} s to {:.6} s)",
            duration(span_us),
            statistics.all.first_us as f64 * 1e-6,
            statistics.all.last_us as f64 * 1e-6
        )?;
        for (label, count) in [
            ("events", statistics.all),
            ("  brighter", statistics.on),
            ("  darker", statistics.off),
        ] {
            let share = 100.0 * count.count as f64 / statistics.all.count as f64;
            writeln!(
                out,
                "{label:<15} {} ({share:.1} %), {}",
                count.count,
                rate(count.rate(span_us))
            )?;
        }
        over_time(out, statistics, span_us)?;
        periodic(out, statistics)?;
    }
    for (label, count) in [
        ("out of order", recording.out_of_order()),
        ("out of bounds", recording.out_of_bounds()),
        ("lost", recording.lost()),
        ("clock wraps", recording.side().wraps),
        ("before the time", recording.side().untimed),
        ("unknown words", recording.side().unknown),
    ] {
        writeln!(out, "{label:<15} {count}")?;
    }
    for span in imu {
        let rate = span.rate(span.last_us - span.first_us);
        writeln!(out, "inertial        {} samples, {rate:.0} a second", span.count)?;
    }
    for sentence in &recording.assumed {
        writeln!(out, "assumed         {sentence}")?;
    }
    for note in &recording.side().notes {
        writeln!(out, "note            {note}")?;
    }
    Ok(())
}

fn over_time(out: &mut String, statistics: &Statistics, span_us: u64) -> std::fmt::Result {
    let (rates, column_us) = statistics.timeline.columns(span_us, COLUMNS);
    let least = rates.iter().copied().fold(f64::INFINITY, f64::min);
    let most = rates.iter().copied().fold(0.0, f64::max);
    writeln!(out, "rate over time  {}", Timeline::bars(&rates))?;
    writeln!(
        out,
        "                {} to {}, each column {}",
        rate(least),
        rate(most),
        duration(column_us)
    )?;
    let gap = duration(Statistics::GAP_US);
    if statistics.gaps == 0 {
        return writeln!(out, "gaps            none longer than {gap}");
    }
    writeln!(out, "gaps            {} longer than {gap}", statistics.gaps)?;
    for gap in &statistics.longest {
        let at = gap.after_us.saturating_sub(statistics.all.first_us);
        writeln!(
            out,
            "                {} at {} from the start",
            duration(gap.length_us),
            duration(at)
        )?;
    }
    Ok(())
}

fn periodic(out: &mut String, statistics: &Statistics) -> std::fmt::Result {
    let lines = spectrum::lines(&statistics.balance, Statistics::STEP_US);
    if lines.is_empty() {
        return writeln!(out, "periodic        nothing");
    }
    let duration_s = statistics.balance.len() as f64 * Statistics::STEP_US as f64 * 1e-6;
    for line in lines {
        let coherence = spectrum::coherence(&statistics.cells, line.hz, Statistics::STEP_US);
        let what = match spectrum::mains_hz(line.hz, duration_s) {
            _ if coherence < TOGETHER => "moves across the picture".to_owned(),
            Some(mains) => format!("lamp flicker ({mains} Hz mains)"),
            None => "the picture pulses as a whole".to_owned(),
        };
        writeln!(
            out,
            "periodic        {:.1} Hz and {} harmonics, {:.0} x background: {what}",
            line.hz, line.harmonics, line.over_background
        )?;
    }
    Ok(())
}

/// "1s 203ms 5us".
fn duration(us: u64) -> String {
    let parts = [(us / 1_000_000, "s"), (us / 1000 % 1000, "ms"), (us % 1000, "us")];
    let shown: Vec<String> = parts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, unit)| format!("{count}{unit}"))
        .collect();
    if shown.is_empty() { "0us".to_owned() } else { shown.join(" ") }
}

/// Events per second with a unit a person reads.
fn rate(per_s: f64) -> String {
    if per_s >= 1e6 {
        format!("{:.2} Mev/s", per_s * 1e-6)
    } else if per_s >= 1e3 {
        format!("{:.1} kev/s", per_s * 1e-3)
    } else {
        format!("{per_s:.0} ev/s")
    }
}

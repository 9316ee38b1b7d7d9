//! `evtach measure`: speed of every rotor in a recording.
//!
//! Exit code 0 when every file has at least one speed, 1 when one has none, 2 for bad usage or input.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use evtach_core::{Event, GyroSample, Reading};
use evtach_host::measure::{
    Capacity, Document, FileFacts, Ties, Timeline, drain, evidence, feed, summarise, table,
    with_tachometer,
};
use indicatif::{ProgressBar, ProgressStyle};

use super::how::How;
use super::span::Span;
use super::wait::Wait;
use super::{in_order, note, say};

/// Arguments of `evtach measure`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings; "-" reads stdin.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One JSON document per file instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    how: How,
    #[command(flatten)]
    span: Span,
    /// Show what each stage found, and why something was refused.
    #[arg(short, long)]
    verbose: bool,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (mut without, mut failed) = (false, false);
    for file in &args.files {
        match measure(file, &args) {
            Ok(read) => without |= !read,
            Err(error) => {
                eprintln!("evtach: {error:#}");
                failed = true;
            }
        }
    }
    Ok(ExitCode::from(if failed { 2 } else { u8::from(without) }))
}

/// Measures one file; whether it has a speed.
fn measure(file: &Path, args: &Args) -> anyhow::Result<bool> {
    let name = file.display().to_string();
    let mut recording = args.how.open(file)?;
    let settings = args.how.settings(recording.geometry);

    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {human_pos} events, {per_sec}")
    {
        bar.set_style(style);
    }
    bar.set_message(name.clone());
    let mut facts = FileFacts {
        file: name.clone(),
        format: recording.format.to_owned(),
        size_px: (recording.geometry.width_px, recording.geometry.height_px),
        ..FileFacts::default()
    };
    let mut readings: Vec<Reading> = Vec::new();
    let mut failure = None;
    let mut timeline = Timeline::default();
    let ignored = with_tachometer(settings, args.how.capacity, |tachometer| {
        let (mut chunk, mut ties) = (Vec::<Event>::new(), Ties::default());
        let (mut rolls, mut wait) = (Vec::<GyroSample>::new(), Wait::default());
        let (mut origin_us, mut has_gyro) = (None, false);
        let (mut known_lost, mut measured) = (0, None::<(u64, u64)>);
        let (mut read, mut taken, mut more) = (Vec::<Event>::new(), 0, true);
        loop {
            if taken == read.len() {
                read.clear();
                taken = 0;
                more = recording.read_chunk(&mut read).unwrap_or_else(|error| {
                    failure = Some(error);
                    false
                });
                bar.inc(read.len() as u64);
                if args.how.capacity == Capacity::Full {
                    ties.order(&mut read, more);
                }
            }
            let part = timeline.part(&read[taken..]);
            chunk.clear();
            chunk.extend_from_slice(&read[taken..taken + part]);
            taken += part;
            let set_back = if part == 0 { read.get(taken) } else { None };
            if let Some(first) = chunk.first() {
                let origin_us = *origin_us.get_or_insert(first.t_us);
                let wanted = args.span.since_us();
                chunk.retain(|event| {
                    wanted.contains(&timeline.at(event.t_us).saturating_sub(origin_us))
                });
            }
            facts.events += chunk.len() as u64;
            tachometer.lost(recording.lost() - known_lost);
            known_lost = recording.lost();
            if let (Some(first), Some(last)) = (chunk.first(), chunk.last()) {
                let (first_us, last_us) = (timeline.at(first.t_us), timeline.at(last.t_us));
                measured = Some((measured.map_or(first_us, |(start_us, _)| start_us), last_us));
            }
            rolls.append(&mut args.how.rolls(&mut recording));
            has_gyro |= !rolls.is_empty();
            if args.how.gyro {
                wait.hold(&mut chunk, &rolls, more && set_back.is_none());
            }
            let mut ahead = &rolls[..];
            feed(tachometer, &chunk, &mut ahead, |reading| readings.push(timeline.laid(reading)));
            let used = rolls.len() - ahead.len();
            rolls.drain(..used);
            if let Some(next) = set_back {
                // The device forgets a window that its clock leaves behind. What is out of order throughout will be refused.
                if args.how.capacity == Capacity::Full && !recording.is_shuffled() {
                    tachometer.finish();
                    drain(tachometer, |reading| readings.push(timeline.laid(reading)));
                }
                timeline.set_back_to(next.t_us);
            }
            if !more && taken == read.len() {
                break;
            }
        }
        args.how.note_gyro(&name, has_gyro);
        (facts.first_us, facts.last_us) = measured.unwrap_or_default();
        tachometer.finish();
        drain(tachometer, |reading| readings.push(timeline.laid(reading)));
        facts.thinned = tachometer.thinned();
        tachometer.ignored()
    });
    bar.finish_and_clear();
    if let Some(error) = failure {
        if bar.position() == 0 {
            return Err(error).with_context(|| name);
        }
        eprintln!("{name}: {error}; measured what came before");
    }
    if bar.position() == 0 {
        bail!(
            "{name}: the recording holds no events; record again, or check the format with `evtach info`"
        );
    }
    if readings.is_empty() && (!args.span.is_all() || args.how.roi.is_some()) {
        bail!("{name}: no events between --start and --end inside --roi; widen them");
    }
    note(&recording, &name);
    if ignored.out_of_order > 0 {
        eprintln!("{name}: {} events stepped back in time and were left out", ignored.out_of_order);
    }
    if timeline.is_set_back() {
        eprintln!("{name}: {}; what follows is measured as if it came then", timeline.note());
    }
    in_order(&recording, &name)?;
    facts.lost = recording.lost() + ignored.out_of_order;
    let summary = summarise(&readings, &(facts.first_us..facts.last_us), args.how.clock_ppm);
    if args.json {
        let document = Document::new(&facts, &summary, &readings);
        say(format!("{}\n", serde_json::to_string(&document)?))?;
    } else {
        say(table(&facts, &summary, &readings))?;
    }
    if args.verbose {
        eprint!("{}", evidence(&readings, facts.first_us));
    }
    Ok(summary.rotors.iter().any(|rotor| rotor.speed.is_some()))
}

//! `evtach plot`: a report with pictures, as one HTML file.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use evtach_core::{Event, GyroSample};
use evtach_host::measure::{FileFacts, Timeline, measure_events, summarise};
use evtach_host::report::{Subject, heat_map, html};

use super::how::How;
use super::{deliver, in_order, keep_apart, note};

/// Arguments of `evtach plot`.
#[derive(clap::Args)]
pub struct Args {
    /// Recording; "-" reads stdin.
    file: PathBuf,
    /// Report to write [default: the recording's name with .html], "-" for stdout; a name in .svg gets the heat map alone.
    #[arg(short, long, value_name = "HTML|SVG")]
    out: Option<PathBuf>,
    #[command(flatten)]
    how: How,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let name = args.file.display().to_string();
    let out = match &args.out {
        Some(out) => out.clone(),
        None if args.file == Path::new("-") => bail!("stdin has no name: say where to with --out"),
        None => args.file.with_extension("html"),
    };
    keep_apart(&args.file, &out)?;
    let mut recording = args.how.open(&args.file)?;
    let mut events: Vec<Event> = Vec::new();
    let mut gyro: Vec<GyroSample> = Vec::new();
    loop {
        let more = match recording.read_chunk(&mut events) {
            Ok(more) => more,
            Err(error) if events.is_empty() => return Err(error).context(name),
            Err(error) => {
                eprintln!("{name}: {error}; plotting what came before");
                false
            }
        };
        gyro.append(&mut args.how.rolls(&mut recording));
        if !more {
            break;
        }
    }
    note(&recording, &name);
    in_order(&recording, &name)?;
    let mut timeline = Timeline::default();
    let part = timeline.part(&events);
    if let Some(next) = events.get(part) {
        timeline.set_back_to(next.t_us);
        eprintln!("{name}: {}; plotting what came before", timeline.note());
        events.truncate(part);
    }
    let (Some(first), Some(last)) = (events.first(), events.last()) else {
        bail!(
            "{name}: the recording holds no events; record again, or check the format with `evtach info`"
        );
    };
    let (first_us, last_us) = (first.t_us, last.t_us);
    args.how.note_gyro(&name, !gyro.is_empty());
    let settings = args.how.settings(recording.geometry);
    let (readings, thinned) = measure_events(&events, &gyro, settings, args.how.capacity);
    let summary = summarise(&readings, &(first_us..last_us), args.how.clock_ppm);
    let facts = FileFacts {
        file: name,
        format: recording.format.to_owned(),
        size_px: (recording.geometry.width_px, recording.geometry.height_px),
        events: events.len() as u64,
        thinned,
        lost: recording.lost(),
        first_us,
        last_us,
    };
    let subject = Subject {
        facts: &facts,
        geometry: recording.geometry,
        events: &events,
        readings: &readings,
        summary: &summary,
        assumed: &recording.assumed,
    };
    let alone = out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"));
    let drawn = if alone { heat_map(&subject)? } else { html(&subject)? };
    deliver(&out, drawn.as_bytes(), &out.display().to_string())?;
    let spoken = summary.rotors.iter().any(|rotor| rotor.speed.is_some());
    Ok(ExitCode::from(u8::from(!spoken)))
}

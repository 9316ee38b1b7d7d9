//! `evtach plot`: a report with pictures, as one HTML file.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use evtach_core::{Event, Geometry, GyroSample, Settings};
use evtach_host::measure::{Capacity, FileFacts, measure_events, summarise};
use evtach_host::recording::{self, ImuSample, OpenOptions};
use evtach_host::report::{Subject, heat_map, html};

/// Arguments of `evtach plot`.
#[derive(clap::Args)]
pub struct Args {
    /// Recording; "-" reads stdin.
    file: PathBuf,
    /// Report to write [default: the recording's name with .html]; a name in .svg gets the heat map alone.
    #[arg(short, long, value_name = "HTML|SVG")]
    out: Option<PathBuf>,
    /// Blade count, when it is known.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=64))]
    blades: Option<u8>,
    /// Fixed window instead of one that adapts to the rotor.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(5..=2000))]
    window_ms: Option<u32>,
    /// Size of the sensor, where the recording does not say it or says it wrong.
    #[arg(long, value_name = "WxH", value_parser = recording::parse_geometry)]
    geometry: Option<Geometry>,
    /// Memory of the tachometer.
    #[arg(long, value_enum, default_value = "full")]
    capacity: Capacity,
}

/// One standard deviation of the camera clock's error in ppm, as `measure` assumes it.
const CLOCK_SIGMA_PPM: f32 = 15.0;

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let name = args.file.display().to_string();
    let out = match &args.out {
        Some(out) => out.clone(),
        None if args.file == Path::new("-") => bail!("stdin has no name: say where to with --out"),
        None => args.file.with_extension("html"),
    };
    let mut recording = recording::open(&args.file, &OpenOptions { geometry: args.geometry })
        .with_context(|| name.clone())?;
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
        gyro.extend(recording.take_imu().iter().map(ImuSample::roll));
        if !more {
            break;
        }
    }
    let (Some(first), Some(last)) = (events.first(), events.last()) else {
        bail!(
            "{name}: the recording holds no events; record again, or check the format with `evtach info`"
        );
    };
    let (first_us, last_us) = (first.t_us, last.t_us);
    let mut settings = Settings::new(recording.geometry);
    settings.blades = args.blades;
    settings.window_us = args.window_ms.map(|ms| ms * 1000);
    settings.clock_sigma_ppm = CLOCK_SIGMA_PPM;
    let (readings, _) = measure_events(&events, &gyro, settings, args.capacity);
    let summary =
        summarise(&readings, first_us + last_us.saturating_sub(first_us) / 2, CLOCK_SIGMA_PPM);
    let facts = FileFacts {
        file: name,
        format: recording.format.to_owned(),
        size_px: (recording.geometry.width_px, recording.geometry.height_px),
        events: events.len() as u64,
        lost: recording.lost(),
        first_us,
        last_us,
        ..FileFacts::default()
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
    std::fs::write(&out, drawn)
        .with_context(|| format!("{}: cannot be written; choose --out", out.display()))?;
    println!("{}", out.display());
    let spoken = summary.rotors.iter().any(|rotor| rotor.speed.is_some());
    Ok(ExitCode::from(u8::from(!spoken)))
}

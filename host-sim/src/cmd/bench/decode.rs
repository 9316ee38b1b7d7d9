//! `evtach bench decode`: events decoded a second, for each format, beside faery on the same file in the same run.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

use anyhow::{Context as _, bail};
use evtach_core::{Event, Geometry, Polarity};
use evtach_host::recording::write::{self, WriteFormat};
use evtach_host::recording::{self, OpenOptions};

use super::say_line;

/// Arguments of `evtach bench decode`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings to decode; without any, one is made up and written in every format.
    files: Vec<PathBuf>,
    /// Millions of events in the recording that is made up.
    #[arg(long, value_name = "N", default_value_t = 4)]
    mega_events: u32,
    /// Python that has faery; `tests/interop/setup.sh` makes one.
    #[arg(long, value_name = "PATH", default_value = "target/venv/bin/python")]
    python: PathBuf,
    /// One JSON document instead of a table.
    #[arg(long)]
    json: bool,
}

/// Sensor of the recording that is made up.
const MADE_UP: Geometry = Geometry { width_px: 640, height_px: 480 };
/// Times a file is decoded; the best counts.
const RUNS: usize = 5;

/// One line of the table.
#[derive(serde::Serialize)]
struct Row {
    file: String,
    format: &'static str,
    megabytes: f64,
    events: u64,
    /// Million events a second.
    evtach_mev_s: f64,
    /// The same for faery, where it reads the file.
    faery_mev_s: Option<f64>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let folder = std::env::temp_dir().join(format!("evtach-bench-{}", std::process::id()));
    let files = if args.files.is_empty() {
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        make_up(&folder, args.mega_events)?
    } else {
        args.files.clone()
    };
    // Text and arrays do not tell the size; faery does not look for it either.
    let options = OpenOptions {
        geometry: args.files.is_empty().then_some(MADE_UP),
        ..OpenOptions::default()
    };
    let rows: anyhow::Result<Vec<Row>> =
        files.iter().map(|file| row(file, &options, &args.python)).collect();
    if args.files.is_empty() {
        // What is left behind is the system's to clean up.
        let _ = std::fs::remove_dir_all(&folder);
    }
    print(&rows?, args.json)?;
    Ok(ExitCode::SUCCESS)
}

/// Edges of a fan's blades: neighbouring pixels of a row within a microsecond or two, as vectors of EVT 3 want them.
fn make_up(folder: &Path, mega_events: u32) -> anyhow::Result<Vec<PathBuf>> {
    let mut mixed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut t_us = 0;
    let (mut x, mut y) = (0, 0);
    let events: Vec<Event> = (0..u64::from(mega_events) * 1_000_000)
        .map(|_| {
            mixed ^= mixed << 13;
            mixed ^= mixed >> 7;
            mixed ^= mixed << 17;
            if mixed.is_multiple_of(4) {
                t_us += mixed >> 8 & 1;
                x = (mixed >> 16) as u16 % 632;
                y = (mixed >> 32) as u16 % 480;
            } else {
                x = (x + 1) % MADE_UP.width_px;
            }
            let polarity = if mixed >> 48 & 1 == 1 { Polarity::On } else { Polarity::Off };
            Event { t_us, x, y, polarity }
        })
        .collect();
    WriteFormat::ALL
        .into_iter()
        .map(|format| {
            let extension = match format {
                WriteFormat::Evt2 => "evt2.raw",
                WriteFormat::Evt3 => "evt3.raw",
                other => other.as_str(),
            };
            let path = folder.join(format!("events.{extension}"));
            let mut writer = write::create(&path, format, MADE_UP)
                .with_context(|| path.display().to_string())?;
            writer.write(&events)?;
            writer.finish()?;
            Ok(path)
        })
        .collect()
}

fn row(file: &Path, options: &OpenOptions, python: &Path) -> anyhow::Result<Row> {
    let name = file.display().to_string();
    let bytes = std::fs::metadata(file).with_context(|| name.clone())?.len();
    let mut best_s = f64::INFINITY;
    let (mut events, mut format) = (0, "");
    for _ in 0..RUNS {
        let start = Instant::now();
        let mut recording = recording::open(file, options).with_context(|| name.clone())?;
        let mut chunk: Vec<Event> = Vec::new();
        events = 0;
        loop {
            chunk.clear();
            let more = recording.read_chunk(&mut chunk).with_context(|| name.clone())?;
            events += chunk.len() as u64;
            if !more {
                break;
            }
        }
        best_s = best_s.min(start.elapsed().as_secs_f64());
        format = recording.format;
    }
    let faery_mev_s = faery(file, python, events)?;
    Ok(Row {
        file: name,
        format,
        megabytes: bytes as f64 * 1e-6,
        events,
        evtach_mev_s: events as f64 * 1e-6 / best_s,
        faery_mev_s,
    })
}

/// The same file through faery, best of as many runs; `None` where it is not there or does not read the file.
fn faery(file: &Path, python: &Path, events: u64) -> anyhow::Result<Option<f64>> {
    const SCRIPT: &str = include_str!("../../../../tests/interop/peers.py");
    if !python.is_file() {
        return Ok(None);
    }
    let output = Command::new(python)
        .args(["-c", SCRIPT, "time"])
        .arg(file)
        .output()
        .with_context(|| python.display().to_string())?;
    let text = String::from_utf8_lossy(&output.stdout);
    let mut fields = text.split_whitespace();
    let counted = fields.next().and_then(|count| count.parse::<u64>().ok());
    let seconds = fields.next().and_then(|seconds| seconds.parse::<f64>().ok());
    let (Some(counted), Some(seconds)) = (counted, seconds) else { return Ok(None) };
    if counted != events {
        bail!(
            "{}: {events} events here, {counted} in faery\nhelp: one of the two misreads it",
            file.display()
        );
    }
    Ok(Some(events as f64 * 1e-6 / seconds))
}

fn print(rows: &[Row], json: bool) -> anyhow::Result<()> {
    if json {
        say_line(serde_json::to_string(rows)?)?;
        return Ok(());
    }
    say_line(format!(
        "{:<8} {:>8} {:>10} {:>14} {:>13} {:>7}",
        "format", "MB", "events", "evtach Mev/s", "faery Mev/s", "ratio"
    ))?;
    for row in rows {
        let (faery, ratio) = match row.faery_mev_s {
            Some(faery) => (format!("{faery:.1}"), format!("{:.2}", row.evtach_mev_s / faery)),
            None => ("-".to_owned(), "-".to_owned()),
        };
        say_line(format!(
            "{:<8} {:>8.1} {:>10} {:>14.1} {faery:>13} {ratio:>7}",
            row.format, row.megabytes, row.events, row.evtach_mev_s
        ))?;
    }
    if rows.iter().all(|row| row.faery_mev_s.is_none()) {
        say_line("faery is not there: run tests/interop/setup.sh, then this again")?;
    }
    Ok(())
}

//! `evtach plot`: a report with pictures, as one HTML file.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use evtach_core::Event;
use evtach_host::report::{Subject, heat_map, html, is_report};

use super::how::How;
use super::{deliver, keep_apart};

/// Arguments of `evtach plot`.
#[derive(clap::Args)]
pub struct Args {
    /// Recording; "-" reads stdin.
    file: PathBuf,
    /// Report to write, "-" for stdout; a name in .svg gets the heat map alone [default: the recording's name with .html, unless
    /// something else than a report is there].
    #[arg(short, long, value_name = "HTML|SVG")]
    out: Option<PathBuf>,
    #[command(flatten)]
    how: How,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let out = match &args.out {
        Some(out) => out.clone(),
        None if args.file == Path::new("-") => bail!("stdin has no name: say where to with --out"),
        None => args.file.with_extension("html"),
    };
    keep_apart(&args.file, &out)?;
    // What was named is written over, as by the other subcommands. This was not, but an older report is what it renews.
    if args.out.is_none() && !is_free(&out) {
        let out = out.display();
        bail!(
            "{out} is there already\nhelp: say --out {out} to write over it, or choose another name"
        );
    }
    let ending = out.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
    let alone = match ending.to_str() {
        Some("" | "html" | "htm") => false,
        Some("svg") => true,
        _ => bail!("{}: a report is HTML or SVG; end its name in .html or .svg", out.display()),
    };
    let mut events: Vec<Event> = Vec::new();
    let measured = args.how.measure(&args.file, false, |more, timeline| {
        events.extend(more.iter().map(|event| timeline.laid_event(event)));
    })?;
    let subject = Subject {
        plan: &measured.plan,
        facts: &measured.facts,
        geometry: measured.geometry,
        events: &events,
        readings: &measured.readings,
        summary: &measured.summary,
        assumed: &measured.assumed,
    };
    let drawn = if alone { heat_map(&subject)? } else { html(&subject)? };
    deliver(&out, drawn.as_bytes(), &out.display().to_string())?;
    Ok(measured.outcome().into())
}

/// Whether nothing is there, or an older report.
fn is_free(path: &Path) -> bool {
    let mut start = Vec::new();
    match File::open(path) {
        Ok(file) => file.take(256).read_to_end(&mut start).is_ok() && is_report(&start),
        // A link to nowhere is something.
        Err(_) => path.symlink_metadata().is_err(),
    }
}

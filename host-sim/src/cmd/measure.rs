//! `evtach measure`: speed of every rotor in a recording.
//!
//! Exit code 0 when every file has at least one speed, 1 when one has none, 2 for bad usage or input.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use evtach_host::measure::{Document, evidence, table};

use super::how::{How, Measured};
use super::{say, tell};

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
                tell(format!("evtach: {error:#}"));
                failed = true;
            }
        }
    }
    Ok(ExitCode::from(if failed { 2 } else { u8::from(without) }))
}

/// Measures one file; whether it has a speed.
fn measure(file: &Path, args: &Args) -> anyhow::Result<bool> {
    let measured = args.how.measure(file, args.verbose, |_, _| ())?;
    let Measured { plan, facts, readings, summary, .. } = measured;
    if args.json {
        let document = Document::new(&plan, &facts, &summary, &readings);
        say(format!("{}\n", serde_json::to_string(&document)?))?;
    } else {
        say(table(&facts, &summary, &readings))?;
    }
    if args.verbose {
        tell(evidence(&facts, &readings).trim_end());
    }
    Ok(summary.has_speed())
}

//! `evtach measure`: speed of every rotor in a recording.
//!
//! Exit code 0 when every file has at least one speed, 1 when one has none, 2 for bad usage or input, damaged in part, too.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use evtach_host::measure::{Document, evidence, table};

use super::how::{How, Measured};
use super::{Outcome, say, tell};

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
    let mut worst = Outcome::Done;
    for file in &args.files {
        worst = worst.max(measure(file, &args).unwrap_or_else(|error| {
            tell(format!("evtach: {error:#}"));
            Outcome::Failed
        }));
    }
    Ok(worst.into())
}

/// Measures one file.
fn measure(file: &Path, args: &Args) -> anyhow::Result<Outcome> {
    let measured = args.how.measure(file, args.verbose, |_, _| ())?;
    let outcome = measured.outcome();
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
    Ok(outcome)
}

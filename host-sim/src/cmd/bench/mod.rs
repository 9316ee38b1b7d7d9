//! `evtach bench`: each table of the README from one command.
//!
//! Everything here is measured on synthetic recordings, whose truth is exact; [`spec`] says what they are. The
//! tachometer is told nothing: no speed, no blade count, no centre. Whatever falls short of what is asked is named, and makes the exit
//! code 1; of `--quick` and of few scenes of `trust` only wrong readings do, and what fails in `peers`, and means of few seeds of
//! `accuracy` may be twice as far off. Times, of which one machine says little, are shown only, and so is the device's memory in `peers`,
//! unless it fails.

mod accuracy;
mod blind;
mod budget;
mod cost;
mod decode;
mod drive;
mod image;
mod peers;
mod report;
mod score;
mod spec;
mod throughput;
mod trust;

use std::fmt::Display;
use std::process::ExitCode;

use super::{say, tell};

/// Arguments of `evtach bench`.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    table: Table,
}

#[derive(clap::Subcommand)]
enum Table {
    /// Instructions and bytes on the device, counted in QEMU.
    Cost(cost::Args),
    /// Instructions a second of the whole instrument, its RAM and flash, against their limits.
    Budget(budget::Args),
    /// What the image for the STM32F746G-DISCO takes of flash and RAM; writes it as it is dragged onto the board's drive.
    Image(image::Args),
    /// Events decoded a second, for each format, beside faery.
    Decode(decode::Args),
    /// Events measured a second on one core of this PC, from memory.
    Throughput(throughput::Args),
    /// Relative error by speed, distance, blades, hand and vibration: the paper's evaluations.
    Accuracy(accuracy::Args),
    /// Share of right readings over 60 to 60 000 rpm and 1 to 8 blades.
    Blind(blind::Args),
    /// The conditions under which other methods were measured, their figures beside these.
    Peers(peers::Args),
    /// Random scenes: wrong readings, coverage of the error bar, refusals.
    Trust(trust::Args),
}

/// What all tables understand.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Common {
    /// Few seeds and few rows: a smoke test, not a result.
    #[arg(long)]
    quick: bool,
    /// One JSON document instead of tables.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Comma-separated records instead of tables.
    #[arg(long)]
    csv: bool,
    /// Recordings worked on at the same time [default: all cores].
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Use the tuning seeds instead of the scored ones; such figures are not results.
    #[arg(long)]
    tuning: bool,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let common = match &args.table {
        Table::Cost(_)
        | Table::Budget(_)
        | Table::Image(_)
        | Table::Decode(_)
        | Table::Throughput(_) => None,
        Table::Accuracy(args) => Some(args.common),
        Table::Blind(args) => Some(args.common),
        Table::Peers(args) => Some(args.common),
        Table::Trust(args) => Some(args.common),
    };
    if let Some(jobs) = common.and_then(|common| common.jobs) {
        rayon::ThreadPoolBuilder::new().num_threads(jobs).build_global()?;
    }
    let report = match args.table {
        Table::Cost(args) => return cost::run(args),
        Table::Budget(args) => return budget::run(&args),
        Table::Image(args) => return image::run(&args),
        Table::Decode(args) => return decode::run(&args),
        Table::Throughput(args) => return throughput::run(&args),
        Table::Accuracy(args) => accuracy::run(&args)?,
        Table::Blind(args) => blind::run(&args)?,
        Table::Peers(args) => peers::run(&args)?,
        Table::Trust(args) => trust::run(&args)?,
    };
    if let Some(common) = common {
        report.print(&common)?;
    }
    // Not to stdout, which may hold records for a program.
    for short in &report.short {
        tell(short);
    }
    Ok(if report.short.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Prints a line of an answer as soon as it is known.
fn say_line(line: impl Display) -> anyhow::Result<()> {
    say(format!("{line}\n"))
}

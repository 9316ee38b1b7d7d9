//! `evtach bench`.

mod cost;

use std::process::ExitCode;

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
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.table {
        Table::Cost(args) => cost::run(args),
    }
}

//! `evtach measure`.

use std::process::ExitCode;

/// Arguments of `evtach measure`.
#[derive(clap::Args)]
pub struct Args {}

/// Runs the subcommand.
pub fn run(_args: Args) -> anyhow::Result<ExitCode> {
    anyhow::bail!("not there yet")
}

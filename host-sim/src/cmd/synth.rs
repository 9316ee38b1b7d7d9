//! `evtach synth`.

use std::process::ExitCode;

/// Arguments of `evtach synth`.
#[derive(clap::Args)]
pub struct Args {}

/// Runs the subcommand.
pub fn run(_args: Args) -> anyhow::Result<ExitCode> {
    anyhow::bail!("not there yet")
}

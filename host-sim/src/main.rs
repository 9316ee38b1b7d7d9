//! `evtach`: rotor speed from event recordings.
#![deny(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "they panic where nobody reads or nothing fits: `cmd::say` and `cmd::tell` do not"
)]

mod cmd;

use std::process::ExitCode;

use clap::Parser;

/// Rotor speed from event-camera recordings.
#[derive(Parser)]
#[command(name = "evtach", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Speed of every rotor in a recording.
    Measure(cmd::measure::Args),
    /// Sensor, format, duration, rates: what a recording holds.
    Info(cmd::info::Args),
    /// Convert between recording formats.
    Convert(cmd::convert::Args),
    /// Make a recording with known truth.
    Synth(Box<cmd::synth::Args>),
    /// Measured tables: accuracy, trust, cost and more.
    Bench(cmd::bench::Args),
    /// A report with pictures.
    Plot(cmd::plot::Args),
    /// The device's screen as a picture.
    Screen(cmd::screen::Args),
    /// A live view in the terminal, of a recording or of a device.
    Watch(cmd::watch::Args),
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Measure(args) => cmd::measure::run(args),
        Command::Info(args) => cmd::info::run(args),
        Command::Convert(args) => cmd::convert::run(args),
        Command::Synth(args) => cmd::synth::run(&args),
        Command::Bench(args) => cmd::bench::run(args),
        Command::Plot(args) => cmd::plot::run(args),
        Command::Screen(args) => cmd::screen::run(&args),
        Command::Watch(args) => cmd::watch::run(args),
    };
    result.unwrap_or_else(|error| {
        cmd::tell(format!("evtach: {error:#}"));
        ExitCode::from(2)
    })
}

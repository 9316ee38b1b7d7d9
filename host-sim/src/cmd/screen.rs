//! `evtach screen`: what the device would show of a recording, drawn by its own code.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use evtach_core::limits::MOST_STATED_BLADES;
use evtach_firmware::instrument::{Action, Instrument, Mode, Page, Preferences, Unit};
use evtach_firmware::ui::Screen;
use evtach_host::frame::Frame;
use evtach_host::play::play;
use evtach_host::recording;

use super::span::parse_seconds;
use super::stated::Stated;
use super::{Outcome, deliver, in_order, keep_apart, note, tell};

/// Arguments of `evtach screen`.
#[derive(clap::Args)]
pub struct Args {
    /// Recording; "-" reads stdin.
    file: PathBuf,
    /// Picture to write, PNG of 480x272 pixels; "-" for stdout.
    out: PathBuf,
    /// The screen at this many seconds after the first event [default: at the end].
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    at: Option<f64>,
    /// What fills the screen.
    #[arg(long, value_enum, default_value = "main")]
    page: PageName,
    /// Which value the big number shows.
    #[arg(long, value_enum, default_value = "live")]
    mode: ModeName,
    /// Unit of the numbers.
    #[arg(long, value_enum, default_value = "rpm")]
    unit: UnitName,
    /// Blade count, when it is known.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=i64::from(MOST_STATED_BLADES)))]
    blades: Option<u8>,
    #[command(flatten)]
    stated: Stated,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum PageName {
    Main,
    Aim,
    Settings,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum ModeName {
    Live,
    Hold,
    Max,
    Min,
    Mean,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum UnitName {
    Rpm,
    Hz,
    #[value(name = "rad/s")]
    RadPerS,
    Ms,
}

impl Args {
    fn actions(&self) -> [Action; 2] {
        let page = match self.page {
            PageName::Main => Page::Main,
            PageName::Aim => Page::Aim,
            PageName::Settings => Page::Settings,
        };
        let mode = match self.mode {
            ModeName::Live => Mode::Live,
            ModeName::Hold => Mode::Hold,
            ModeName::Max => Mode::Max,
            ModeName::Min => Mode::Min,
            ModeName::Mean => Mode::Mean,
        };
        [Action::Page(page), Action::Mode(mode)]
    }

    fn preferences(&self) -> Preferences {
        let unit = match self.unit {
            UnitName::Rpm => Unit::Rpm,
            UnitName::Hz => Unit::Hertz,
            UnitName::RadPerS => Unit::RadPerS,
            UnitName::Ms => Unit::MsPerTurn,
        };
        Preferences { unit, blades: self.blades, ..Preferences::default() }
    }
}

/// Runs the subcommand: 0 when the screen shows a speed, 1 when it shows none, 2 for bad usage or input, damaged in part, too.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    keep_apart(&args.file, &args.out)?;
    let ending = args.out.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default();
    if !ending.is_empty() && ending != "png" {
        bail!("{}: a screen is a PNG; end its name in .png", args.out.display());
    }
    let name = args.file.display().to_string();
    let mut recording =
        recording::open(&args.file, &args.stated.into()).with_context(|| name.clone())?;
    for assumed in &recording.assumed {
        tell(format!("{name}: {assumed}"));
    }
    let mut instrument = Instrument::new(args.preferences());
    let until_us = args.at.map(|seconds| (seconds * 1e6) as u64);
    let played = play(&mut recording, &mut instrument, until_us).with_context(|| name.clone())?;
    let is_damaged = played.damage.is_some() && played.is_whole;
    match played.damage {
        Some(damage) if is_damaged => tell(format!("{name}: {damage}; played what came before")),
        // What is damaged is not wanted.
        Some(damage) => tell(format!("{name}: behind what is played, {damage}")),
        None => {}
    }
    if until_us.is_some() && played.is_whole {
        let end_s = played.duration_us as f64 * 1e-6;
        tell(format!("{name}: ends {end_s:.3} s after its first event, before --at"));
    }
    note(&recording, &name);
    in_order(&recording, &name)?;
    for action in args.actions() {
        instrument.act(action);
    }
    let mut frame = Frame::default();
    let Ok(()) = Screen::new().draw(&mut frame, &instrument);
    let view = instrument.view();
    let shown = view.speed.map_or_else(
        || view.state.advice().to_owned(),
        |speed| format!("{} ± {} {}", speed.value, speed.error, view.preferences.unit.as_str()),
    );
    let said = format!("{}: {} {shown}", args.out.display(), view.state.word());
    deliver(&args.out, &frame.png()?, &said)?;
    Ok(Outcome::of(is_damaged, view.speed.is_some()).into())
}

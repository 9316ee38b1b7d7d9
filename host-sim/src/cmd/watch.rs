//! `evtach watch`: a live view in the terminal.
//!
//! Exit code 0 when a speed was seen, 1 when none was, 2 for bad usage or input, or where the source failed, whatever was seen before.

use std::fs;
use std::io::{self, IsTerminal as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use evtach_host::recording;
use evtach_host::watch::{Monitor, Source, draw, file, port};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::stated::Stated;
use super::{Outcome, tell};

/// How often the view is drawn.
const FRAME: Duration = Duration::from_millis(100);
/// Speed of a serial port unless stated, in bits a second.
const BAUD: u32 = 115_200;

/// Arguments of `evtach watch`.
#[derive(clap::Args)]
pub struct Args {
    /// A recording, or the serial port of a device.
    #[arg(value_name = "FILE|PORT")]
    from: PathBuf,
    /// How many times as fast as it was recorded a recording plays [default: 1].
    #[arg(long, value_name = "TIMES", value_parser = parse_speed)]
    speed: Option<f64>,
    /// Speed of the serial port in bits a second, which ports over USB ignore [default: 115200].
    #[arg(long)]
    baud: Option<u32>,
    #[command(flatten)]
    stated: Stated,
}

fn parse_speed(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(speed) if (0.001..=1e6).contains(&speed) => Ok(speed),
        _ => Err(format!("\"{text}\" is no speed; write a number from 0.001 to 1000000")),
    }
}

impl Args {
    /// Refuses what would do nothing: whoever states it takes the one source for the other.
    fn check(&self) -> anyhow::Result<()> {
        let (what, idle) = if is_port(&self.from) {
            let of_file = [("--speed", self.speed.is_some())];
            ("a port", of_file.into_iter().chain(self.stated.which()).collect())
        } else {
            ("a recording", vec![("--baud", self.baud.is_some())])
        };
        if let Some((option, _)) = idle.iter().find(|(_, is_stated)| *is_stated) {
            let from = self.from.display();
            bail!("{from} is {what}: {option} does nothing there\nhelp: leave out {option}");
        }
        Ok(())
    }
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    args.check()?;
    if !io::stdout().is_terminal() {
        bail!("watch draws on a terminal; for a pipe use `evtach measure --json`");
    }
    let name = args.from.display().to_string();
    let source = if is_port(&args.from) {
        port(&args.from, args.baud.unwrap_or(BAUD))?
    } else {
        let options = args.stated.into();
        let recording = recording::open(&args.from, &options).with_context(|| name.clone())?;
        // The view covers it, and leaves it where it was when it is closed.
        for assumed in &recording.assumed {
            tell(format!("{name}: {assumed}"));
        }
        file(recording, args.speed.unwrap_or(1.0))
    };
    let mut monitor = Monitor::new(name.clone());
    let shown = show(ratatui::init(), &source, &mut monitor);
    ratatui::restore();
    shown.context("the terminal failed")?;
    for remark in monitor.remarks() {
        tell(format!("{name}: {remark}"));
    }
    // The view had room for its first words.
    if let Some(failure) = monitor.failure() {
        tell(format!("{name}: {failure}"));
    }
    Ok(outcome(&monitor).into())
}

fn outcome(monitor: &Monitor) -> Outcome {
    Outcome::of(monitor.failure().is_some(), monitor.seen_speed())
}

/// Whether a path is a device: recordings are files.
fn is_port(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        fs::metadata(path).is_ok_and(|metadata| metadata.file_type().is_char_device())
    }
    #[cfg(not(unix))]
    {
        // COM3 is not a file.
        fs::metadata(path).is_err()
    }
}

/// Draws until q is pressed.
fn show(mut terminal: DefaultTerminal, source: &Source, monitor: &mut Monitor) -> io::Result<()> {
    let start = Instant::now();
    loop {
        while let Ok(told) = source.told.try_recv() {
            monitor.take(told, start.elapsed());
        }
        terminal.draw(|frame| draw(frame, monitor, start.elapsed()))?;
        if !event::poll(FRAME)? {
            continue;
        }
        match event::read()? {
            Event::Key(key) if key.kind == KeyEventKind::Press => match key.code {
                _ if asks_to_quit(&key) => return Ok(()),
                KeyCode::Tab => monitor.choose_next(),
                _ => {}
            },
            _ => {}
        }
    }
}

/// In raw mode Control-C is a key like any other.
fn asks_to_quit(key: &KeyEvent) -> bool {
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    matches!(key.code, KeyCode::Char('q') | KeyCode::Esc)
        || (control && key.code == KeyCode::Char('c'))
}

#[cfg(test)]
mod tests {
    use evtach_host::measure::{ReadingRow, RotorRow};
    use evtach_host::watch::Told;

    use super::*;

    fn reading() -> Told {
        let rotor = RotorRow {
            id: "A".to_owned(),
            x_px: 1.0,
            y_px: 2.0,
            radius_px: 3.0,
            rpm: Some(1500.0),
            rpm_sigma: Some(0.5),
            direction: Some("cw".into()),
            blades: None,
            accel_rpm_per_s: None,
            frame: Some("camera".into()),
            status: "coarse".into(),
            reason: None,
        };
        let (status, rotors) = ("coarse".into(), vec![rotor]);
        Told::Reading(ReadingRow { t_s: 1.0, window_s: 0.1, status, reason: None, rotors })
    }

    #[test]
    fn what_fails_is_told_by_the_exit_code_whatever_was_seen_before() {
        let failure = || Told::Failure("line 7".to_owned());
        for (told, expected) in [
            (vec![reading(), Told::End], Outcome::Done),
            (vec![Told::End], Outcome::NoSpeed),
            (vec![failure()], Outcome::Failed),
            (vec![reading(), failure()], Outcome::Failed),
        ] {
            let mut monitor = Monitor::new(String::new());
            told.into_iter().for_each(|told| monitor.take(told, Duration::ZERO));
            assert_eq!(outcome(&monitor), expected);
        }
    }
}

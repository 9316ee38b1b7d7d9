//! `evtach bench cost`: what measuring costs on the device.
//!
//! Builds the firmware, plays recordings to it in QEMU (`-icount shift=0`, where the board's timers count
//! instructions), and prints instructions per event taken in, per stage and per reading, and bytes of
//! flash and RAM. Instructions are not cycles: a Cortex-M7 may do two in one cycle, or wait for its memory. Exit code 1 past what is
//! asked.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use evtach_core::{Event, Geometry};
use evtach_host::device::{
    self, CallCost, INSTRUCTIONS_PER_TICK, Image, MOST_IN_STEP, MemoryUse, Output, Pace,
};
use evtach_host::recording::{self, OpenOptions};
use evtach_host::synth::{self, Rotor, Scene};

use super::say_line;
use crate::cmd::tell;

/// Arguments of `evtach bench cost`.
#[derive(clap::Args)]
pub struct Args {
    /// Recordings to play; without any, a three-bladed fan and a two-bladed propeller are made up.
    files: Vec<PathBuf>,
    /// Also write the recording as the device reads it, for `cargo q -- OUT`.
    #[arg(long, value_name = "OUT")]
    keep: Option<PathBuf>,
}

/// Instructions that the device may take at most: for taking in an event, for all that is measured until the first reading with a
/// speed, and for each reading after a rotor is locked. [`MOST_IN_STEP`] is asked as well.
const ASKED_PER_EVENT: f64 = 60.0;
const ASKED_FIRST_READING: u64 = 100_000_000;
const ASKED_READING_AFTER_LOCK: u64 = 8_000_000;

/// A recording in memory.
struct Played {
    name: String,
    geometry: Geometry,
    events: Vec<Event>,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    tell("building the firmware");
    let image = device::build()?;
    let (mut memory, mut past) = (None, Vec::new());
    for played in recordings(&args.files)? {
        if let Some(path) = &args.keep {
            device::write_recording(path, played.geometry, &played.events)?;
        }
        tell(format!("playing {} in QEMU", played.name));
        let output = device::run(&image, played.geometry, &played.events, Pace::File)?;
        let spent = Spent::of(&output);
        print_run(&played, &output, &spent)?;
        past.extend(
            spent.past_what_is_asked().into_iter().map(|p| format!("{}: {p}", played.name)),
        );
        // A limit that nothing reached was not held.
        if args.files.is_empty() && spent.after_lock.is_none() {
            past.push(format!("{}: no reading after lock, of which a limit is asked", played.name));
        }
        let live = device::run(&image, played.geometry, &played.events, Pace::Sensor)?;
        print_live(&played, &live)?;
        memory = Some(output.memory);
    }
    if let Some(memory) = memory {
        print_bytes(&image, &memory)?;
    }
    for past in &past {
        say_line(past)?;
    }
    Ok(if past.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Instructions of one run, for all of which a limit is asked.
#[derive(Debug, Default)]
struct Spent {
    /// Taking in one event.
    per_event: f64,
    longest_step: u64,
    /// Measuring until the first reading with a speed.
    first: Option<u64>,
    /// Mean of the readings after the first locked one, and how many they are.
    after_lock: Option<(u64, usize)>,
}

impl Spent {
    fn of(output: &Output) -> Self {
        let is = |index: usize, statuses: &[&str]| {
            output.readings[index].field("status").is_some_and(|status| statuses.contains(&status))
        };
        let in_all = |range: &[device::DeviceReading]| {
            instructions(range.iter().map(|reading| reading.poll_ticks).sum())
        };
        let indices = 0..output.readings.len();
        let first = indices.clone().find(|&i| is(i, &["coarse", "locked"]));
        let locked = indices.clone().find(|&i| is(i, &["locked"]));
        let later = locked.map_or(&[][..], |locked| &output.readings[locked + 1..]);
        let longest = output.stages.iter().map(|stage| stage.longest_ticks).max();
        Self {
            per_event: instructions(output.push.ticks) as f64 / output.events.max(1) as f64,
            longest_step: instructions(longest.unwrap_or(0)),
            first: first.map(|first| in_all(&output.readings[..=first])),
            after_lock: (!later.is_empty())
                .then(|| (in_all(later) / later.len() as u64, later.len())),
        }
    }

    /// Each limit that was passed, in words.
    fn past_what_is_asked(&self) -> Vec<String> {
        let mut past = Vec::new();
        if self.per_event > ASKED_PER_EVENT {
            past.push(format!(
                "taking in one event took {:.1} instructions, more than {ASKED_PER_EVENT:.0}",
                self.per_event
            ));
        }
        for (what, spent, asked) in [
            ("a step", Some(self.longest_step), MOST_IN_STEP),
            ("the first reading", self.first, ASKED_FIRST_READING),
            (
                "a reading after lock",
                self.after_lock.map(|(mean, _)| mean),
                ASKED_READING_AFTER_LOCK,
            ),
        ] {
            if let Some(spent) = spent.filter(|spent| *spent > asked) {
                let (spent, asked) = (grouped(spent), grouped(asked));
                past.push(format!("{what} took {spent} instructions, more than {asked}"));
            }
        }
        past
    }
}

fn recordings(files: &[PathBuf]) -> anyhow::Result<Vec<Played>> {
    if files.is_empty() { made_up() } else { files.iter().map(|path| load(path)).collect() }
}

fn load(path: &Path) -> anyhow::Result<Played> {
    let name = path.display().to_string();
    let mut recording =
        recording::open(path, &OpenOptions::default()).with_context(|| name.clone())?;
    let mut events = Vec::new();
    while recording.read_chunk(&mut events).with_context(|| name.clone())? {}
    Ok(Played { name, geometry: recording.geometry, events })
}

/// Half a second each of a fan and a propeller in front of a DAVIS346.
fn made_up() -> anyhow::Result<Vec<Played>> {
    [("three-bladed fan, 1500 rpm", 3, 1500.0), ("two-bladed propeller, 6000 rpm", 2, -6000.0)]
        .into_iter()
        .map(|(name, blades, rpm)| {
            let rotor = Rotor { blades, rpm, ..Rotor::default() };
            let scene = Scene { duration_ms: 500.0, rotors: vec![rotor], ..Scene::default() };
            let geometry = Geometry::new(scene.width_px, scene.height_px)
                .context("the scene's sensor is out of range")?;
            let events = synth::generate(&scene)?.events;
            Ok(Played { name: name.to_owned(), geometry, events })
        })
        .collect()
}

fn print_run(played: &Played, output: &Output, spent: &Spent) -> anyhow::Result<()> {
    let duration_s = duration_s(&played.events);
    say_line(format!(
        "{}: {}x{}, {duration_s:.3} s, {} events",
        played.name,
        played.geometry.width_px,
        played.geometry.height_px,
        grouped(output.events)
    ))?;
    say_line(format!("  {:<24}{:>16.1} instructions", "taking in one event", spent.per_event))?;
    say_line(format!(
        "  {:<24}{:>16}{:>12}{:>16}",
        "stage", "instructions", "calls", "longest call"
    ))?;
    for CallCost { name, calls, ticks, longest_ticks } in &output.stages {
        say_line(format!(
            "  {name:<24}{:>16}{:>12}{:>16}",
            grouped(instructions(*ticks)),
            grouped(*calls),
            grouped(instructions(*longest_ticks))
        ))?;
    }
    say_line(format!("  {:<24}{:>16} instructions", "longest step", grouped(spent.longest_step)))?;
    print_readings(output, spent)?;
    let all = instructions(output.push.ticks + output.stages.iter().map(|s| s.ticks).sum::<u64>());
    say_line(format!(
        "  {:<24}{:>16.1} million instructions per second of recording",
        "in all",
        all as f64 / duration_s / 1e6
    ))
}

/// What the first reading with a speed costs, and each after the first locked one.
fn print_readings(output: &Output, spent: &Spent) -> anyhow::Result<()> {
    let Some(first) = spent.first else {
        return say_line(format!("  no reading among {}", output.readings.len()));
    };
    say_line(format!("  {:<24}{:>16} instructions of measuring", "first reading", grouped(first)))?;
    let Some((mean, count)) = spent.after_lock else {
        return say_line("  no reading after a locked one");
    };
    say_line(format!(
        "  {:<24}{:>16} instructions, mean of {count}",
        "reading after lock",
        grouped(mean)
    ))
}

fn print_live(played: &Played, live: &Output) -> anyhow::Result<()> {
    let lost = played.events.len() as u64 - live.events;
    say_line("  played live, at 250 million instructions per second:")?;
    say_line(format!("  {:<24}{:>16}", "  readings", live.readings.len()))?;
    say_line(format!("  {:<24}{:>16} events found no free block", "  lost", grouped(lost)))?;
    say_line(format!(
        "  {:<24}{:>16} events in windows given up",
        "  measured too late",
        grouped(live.overrun)
    ))?;
    say_line("")
}

fn print_bytes(image: &Image, memory: &MemoryUse) -> anyhow::Result<()> {
    say_line("bytes on the device")?;
    for (name, bytes) in [
        ("flash", image.flash_bytes),
        ("variables in RAM", image.ram_bytes),
        ("  tachometer", memory.tachometer_bytes),
        ("  heat map", memory.heat_bytes),
        ("  event store", memory.store_bytes),
        ("  blocks of events", memory.blocks_bytes),
        ("deepest stack", memory.stack_bytes),
    ] {
        say_line(format!("  {name:<24}{:>16}", grouped(bytes)))?;
    }
    Ok(())
}

fn instructions(ticks: u64) -> u64 {
    ticks * INSTRUCTIONS_PER_TICK
}

fn duration_s(events: &[Event]) -> f64 {
    match (events.first(), events.last()) {
        (Some(first), Some(last)) => last.t_us.saturating_sub(first.t_us).max(1) as f64 * 1e-6,
        _ => 1e-6,
    }
}

/// Digits in groups of three.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_is_named() {
        let asked = Spent {
            per_event: ASKED_PER_EVENT,
            longest_step: MOST_IN_STEP,
            first: Some(ASKED_FIRST_READING),
            after_lock: Some((ASKED_READING_AFTER_LOCK, 3)),
        };
        assert!(asked.past_what_is_asked().is_empty());
        let more = Spent {
            per_event: 60.1,
            longest_step: 1_000_040,
            first: Some(100_000_040),
            after_lock: Some((8_000_040, 3)),
        };
        let past = more.past_what_is_asked();
        let named = ["taking in one event", "a step", "the first reading", "a reading after lock"];
        assert_eq!(past.len(), named.len());
        for (past, named) in past.iter().zip(named) {
            assert!(past.starts_with(named), "{past}");
        }
        assert!(Spent::default().past_what_is_asked().is_empty());
    }

    #[test]
    fn groups_from_the_right() {
        assert_eq!([0, 999, 1_000, 12_345_678].map(grouped), ["0", "999", "1 000", "12 345 678"]);
    }
}

//! `evtach bench budget`: what the whole instrument costs on the device, and whether that is within its limits.
//!
//! Runs the firmware in QEMU on made-up rotors at a million events a second, with its screen drawn four times a second
//! and its link telling every reading, and prints instructions a second by task, readings a second, and bytes of flash and
//! RAM, beside what is asked. Exit code 1 past a limit.

use std::process::ExitCode;

use anyhow::Context as _;
use evtach_core::Geometry;
use evtach_firmware::sensor::spi::{Bridge, Kind};
use evtach_host::device::{self, Image, Used};
use evtach_host::synth::{self, Rotor, Scene};

use super::say_line;
use crate::cmd::tell;

/// Arguments of `evtach bench budget`.
#[derive(clap::Args)]
pub struct Args {
    /// Seconds of the board's time, 2 or 3: what is asked is asked of those after the first, in which the rotors are found.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(2..=3))]
    seconds: u32,
}

/// What the device is to stay within.
const ASKED_INSTRUCTIONS_PER_S: u64 = 150_000_000;
pub(super) const ASKED_RAM_BYTES: u64 = 320 * 1024;
pub(super) const ASKED_FLASH_BYTES: u64 = 256 * 1024;

/// Readings of one rotor a second, and of each of four.
const ASKED_READINGS: f64 = 10.0;
const ASKED_READINGS_OF_FOUR: f64 = 4.0;

/// Events a second that come, and the stretch of a recording by which the rotors' speed is set to that.
const EVENTS_PER_S: f64 = 1e6;
const TRIAL_MS: f64 = 200.0;

/// Longest time in seconds from the end of a window to its reading, where nothing is searched: what the windows that end later
/// show has not been told yet.
const TOLD_AFTER_S: f64 = 0.25;

/// Runs the subcommand.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    tell("building the firmware");
    let image = device::build()?;
    let one = vec![Rotor { blades: 3, rpm: 1000.0, radius_px: 42.0, ..Rotor::default() }];
    let used = play(&image, "one rotor", one, args.seconds)?;
    let good = [
        most("instructions a second", instructions_per_s(&used), ASKED_INSTRUCTIONS_PER_S)?,
        least("readings a second", readings_per_s(&used, 1), ASKED_READINGS)?,
        most("internal RAM, bytes", print_ram(&image, &used)?, ASKED_RAM_BYTES)?,
        most("flash, bytes", image.flash_bytes, ASKED_FLASH_BYTES)?,
    ];
    let places = [
        (90.0, 65.0, 2270.0),
        (255.0, 65.0, -2390.0),
        (90.0, 195.0, -2500.0),
        (255.0, 195.0, 2610.0),
    ];
    let four = places.map(|(x_px, y_px, rpm)| Rotor {
        x_px,
        y_px,
        rpm,
        blades: 2,
        radius_px: 20.0,
        ..Rotor::default()
    });
    let used = play(&image, "four rotors", four.to_vec(), args.seconds)?;
    let each =
        least("readings a second of each", readings_per_s(&used, 4), ASKED_READINGS_OF_FOUR)?;
    Ok(ExitCode::from(u8::from(!(each && good.iter().all(|good| *good)))))
}

/// Plays rotors to the instrument and prints who used the processor, second by second.
fn play(image: &Image, name: &str, rotors: Vec<Rotor>, seconds: u32) -> anyhow::Result<Used> {
    let rotors = at_that_rate(rotors)?;
    let rpm: Vec<_> = rotors.iter().map(|rotor| format!("{:.0}", rotor.rpm)).collect();
    let (stream, rate) = stream(rotors, f64::from(seconds))?;
    tell("running it in QEMU");
    let used = device::run_instrument(image, &stream, seconds)?;
    say_line(format!(
        "{name}, {} rpm, {:.2} Mev/s, screen at 4 Hz, every reading told over the link",
        rpm.join(", "),
        rate * 1e-6
    ))?;
    say_line("  instructions in each second")?;
    for (name, seconds) in used.instructions.iter().filter(|(name, _)| name != "sleep") {
        let seconds: String = seconds.iter().map(|spent| format!("{spent:>14}")).collect();
        say_line(format!("  {name:<24}{seconds}"))?;
    }
    for (letter, ends) in ('A'..).zip(&used.read_s) {
        // The second window begins with what came while the first was searched and measured.
        let second = ends.get(1).copied().unwrap_or(f64::NAN);
        say_line(format!(
            "  {letter}: {} readings; the window of the second ends at {second:.2} s",
            ends.len()
        ))?;
    }
    Ok(used)
}

/// The same rotors, as fast as it takes for a million events a second.
fn at_that_rate(rotors: Vec<Rotor>) -> anyhow::Result<Vec<Rotor>> {
    let times = |factor: f64| {
        let faster = |rotor: &Rotor| Rotor { rpm: rotor.rpm * factor, ..rotor.clone() };
        rotors.iter().map(faster).collect::<Vec<_>>()
    };
    let (mut low, mut high) = (0.25, 4.0);
    for _ in 0..10 {
        let middle = 0.5 * (low + high);
        let scene = Scene { duration_ms: TRIAL_MS, rotors: times(middle), ..Scene::default() };
        let rate = synth::generate(&scene)?.events.len() as f64 / TRIAL_MS * 1e3;
        if rate < EVENTS_PER_S {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(times(low))
}

/// Rotors in front of a DAVIS346, as an SPI bridge sends them, and their events a second.
fn stream(rotors: Vec<Rotor>, seconds: f64) -> anyhow::Result<(Vec<u8>, f64)> {
    let scene = Scene { duration_ms: seconds * 1e3 + 100.0, rotors, ..Scene::default() };
    let geometry = Geometry::new(scene.width_px, scene.height_px)
        .context("the scene's sensor is out of range")?;
    let events = synth::generate(&scene)?.events;
    let rate = events.len() as f64 / scene.duration_ms * 1e3;
    let mut bridge = Bridge::new(Kind::Evt2, geometry, "bench");
    let mut stream = Vec::new();
    for event in &events {
        bridge.push(event, |frame| stream.extend_from_slice(frame));
    }
    bridge.end(|frame| stream.extend_from_slice(frame));
    Ok((stream, rate))
}

/// What all tasks did in a second, after the first.
fn instructions_per_s(used: &Used) -> u64 {
    let tasks = used.instructions.iter().filter(|(name, _)| name != "sleep");
    let all: u64 = tasks.flat_map(|(_, seconds)| seconds.iter().skip(1)).sum();
    all / u64::from(used.seconds.saturating_sub(1).max(1))
}

/// How often each of so many rotors is read in a second once all are found: from the second reading on, up to the end.
fn readings_per_s(used: &Used, rotors: usize) -> f64 {
    if used.read_s.len() < rotors {
        return 0.0;
    }
    let told_by_s = f64::from(used.seconds) - TOLD_AFTER_S;
    let rate = |ends: &Vec<f64>| match &ends[..] {
        [_, second, .., last] => (ends.len() - 2) as f64 / (last.max(told_by_s) - second),
        _ => 0.0,
    };
    used.read_s.iter().map(rate).reduce(f64::min).unwrap_or(0.0)
}

fn print_ram(image: &Image, used: &Used) -> anyhow::Result<u64> {
    say_line(format!("  {:<24}{:>14}", "variables, bytes", image.ram_bytes))?;
    say_line(format!("  {:<24}{:>14}", "stack while starting", used.stack_starting))?;
    say_line(format!("  {:<24}{:>14}", "stack while running", used.stack_running))?;
    Ok(image.ram_bytes + used.stack_starting.max(used.stack_running))
}

/// Prints a value beside what it may be at most, and returns whether it is within that.
fn most(name: &str, value: u64, asked: u64) -> anyhow::Result<bool> {
    let verdict = if value <= asked { "within" } else { "PAST" };
    say_line(format!("{name:<26}{value:>14}  {verdict} the {asked} asked"))?;
    Ok(value <= asked)
}

/// Prints a value beside what it must be at least, and returns whether it is.
fn least(name: &str, value: f64, asked: f64) -> anyhow::Result<bool> {
    let verdict = if value >= asked { "within" } else { "SHORT OF" };
    say_line(format!("{name:<26}{value:>14.1}  {verdict} the {asked} asked"))?;
    Ok(value >= asked)
}

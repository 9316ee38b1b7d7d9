//! `evtach bench budget`: what the whole instrument costs on the device, and whether that is within its limits.
//!
//! Runs the firmware in QEMU on a made-up rotor at about a million events a second, with its screen drawn four times a second
//! and its link telling every reading, and prints instructions a second by task, and bytes of flash and RAM, beside
//! what is asked. Exit code 1 past the limits on flash and RAM.

use std::process::ExitCode;

use anyhow::Context as _;
use evtach_core::Geometry;
use evtach_firmware::sensor::spi::{Bridge, Kind};
use evtach_host::device::{self, Image, Used};
use evtach_host::synth::{self, Rotor, Scene};

/// Arguments of `evtach bench budget`.
#[derive(clap::Args)]
pub struct Args {
    /// Seconds of the board's time, 1 to 3.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=3))]
    seconds: u32,
}

/// What the device is to stay within.
const ASKED_INSTRUCTIONS_PER_S: u64 = 150_000_000;
pub(super) const ASKED_RAM_BYTES: u64 = 320 * 1024;
pub(super) const ASKED_FLASH_BYTES: u64 = 256 * 1024;

/// Readings of each of four rotors a second.
const ASKED_READINGS_OF_FOUR: u32 = 4;

/// Past these the command fails. Instructions and readings have no such limit: they are where things stand.
const MOST_RAM_BYTES: u64 = ASKED_RAM_BYTES;
const MOST_FLASH_BYTES: u64 = ASKED_FLASH_BYTES;

/// Runs the subcommand.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    eprintln!("building the firmware");
    let image = device::build()?;
    let seconds = f64::from(args.seconds);
    let one = Rotor { blades: 3, rpm: 1500.0, radius_px: 42.0, ..Rotor::default() };
    let (stream, rate) = stream(vec![one], seconds)?;
    eprintln!("running it in QEMU");
    let used = device::run_instrument(&image, &stream, args.seconds)?;
    println!(
        "one rotor, {:.2} Mev/s, screen at 4 Hz, every reading told over the link",
        rate * 1e-6
    );
    let all = print_tasks(&used);
    println!("  {:<24}{:>14}", "readings a second", used.readings / args.seconds.max(1));
    let good = [
        check("instructions a second", all, ASKED_INSTRUCTIONS_PER_S, None),
        check(
            "internal RAM, bytes",
            print_ram(&image, &used),
            ASKED_RAM_BYTES,
            Some(MOST_RAM_BYTES),
        ),
        check("flash, bytes", image.flash_bytes, ASKED_FLASH_BYTES, Some(MOST_FLASH_BYTES)),
    ];
    print_four(&image, args.seconds)?;
    Ok(ExitCode::from(u8::from(!good.iter().all(|good| *good))))
}

/// Prints how often each of a drone's four rotors is read.
fn print_four(image: &Image, seconds: u32) -> anyhow::Result<()> {
    let places = [
        (90.0, 65.0, 4000.0),
        (255.0, 65.0, -4200.0),
        (90.0, 195.0, -4400.0),
        (255.0, 195.0, 4600.0),
    ];
    let rotors = places.map(|(x_px, y_px, rpm)| Rotor {
        x_px,
        y_px,
        rpm,
        blades: 2,
        radius_px: 20.0,
        ..Rotor::default()
    });
    let (stream, rate) = stream(rotors.to_vec(), f64::from(seconds))?;
    let used = device::run_instrument(image, &stream, seconds)?;
    println!("four rotors, {:.2} Mev/s", rate * 1e-6);
    print_tasks(&used);
    let least = used.of_rotors.iter().copied().min().filter(|_| used.of_rotors.len() >= 4);
    let each = least.unwrap_or(0) / seconds.max(1);
    let verdict = if each >= ASKED_READINGS_OF_FOUR { "within" } else { "SHORT OF" };
    println!(
        "{:<26}{each:>14}  {verdict} the {ASKED_READINGS_OF_FOUR} asked, of {} rotors",
        "readings a second of each",
        used.of_rotors.len()
    );
    Ok(())
}

/// Rotors in front of a DAVIS346, as an SPI bridge sends them, and their events a second.
fn stream(rotors: Vec<Rotor>, seconds: f64) -> anyhow::Result<(Vec<u8>, f64)> {
    let duration_ms = seconds * 1e3 + 100.0;
    let scene = Scene { duration_ms, rotors, ..Scene::default() };
    let geometry = Geometry::new(scene.width_px, scene.height_px)
        .context("the scene's sensor is out of range")?;
    let events = synth::generate(&scene)?.events;
    let rate = events.len() as f64 / duration_ms * 1e3;
    let mut bridge = Bridge::new(Kind::Evt2, geometry, "bench");
    let mut stream = Vec::new();
    for event in &events {
        bridge.push(event, |frame| stream.extend_from_slice(frame));
    }
    bridge.end(|frame| stream.extend_from_slice(frame));
    Ok((stream, rate))
}

/// Prints what each task used, and returns what all did.
fn print_tasks(used: &Used) -> u64 {
    let mut all = 0;
    for (name, instructions) in &used.instructions {
        if name != "sleep" {
            all += instructions / u64::from(used.seconds.max(1));
            println!("  {name:<24}{:>14}", instructions / u64::from(used.seconds.max(1)));
        }
    }
    all
}

fn print_ram(image: &Image, used: &Used) -> u64 {
    println!("  {:<24}{:>14}", "variables, bytes", image.ram_bytes);
    println!("  {:<24}{:>14}", "stack while starting", used.stack_starting);
    println!("  {:<24}{:>14}", "stack while running", used.stack_running);
    image.ram_bytes + used.stack_starting.max(used.stack_running)
}

/// Prints a value beside what is asked, and returns whether it is within the limit that must hold.
fn check(name: &str, value: u64, asked: u64, most: Option<u64>) -> bool {
    let verdict = if value <= asked { "within" } else { "PAST" };
    print!("{name:<26}{value:>14}  {verdict} the {asked} asked");
    let holds = most.is_none_or(|most| value <= most);
    println!("{}", if holds { "" } else { ", and past the limit" });
    holds
}

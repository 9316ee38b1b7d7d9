//! `evtach info`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use evtach_core::{Event, Geometry, Polarity};
use evtach_host::recording::{self, OpenOptions};

/// Arguments of `evtach info`.
#[derive(clap::Args)]
pub struct Args {
    /// Recording; "-" reads stdin.
    file: PathBuf,
    /// Size of the sensor, where the recording does not say it or says it wrong.
    #[arg(long, value_name = "WxH", value_parser = recording::parse_geometry)]
    geometry: Option<Geometry>,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let name = args.file.display().to_string();
    let options = OpenOptions { geometry: args.geometry };
    let mut recording = recording::open(&args.file, &options).with_context(|| name.clone())?;
    let mut chunk: Vec<Event> = Vec::new();
    let (mut on, mut off) = (0_u64, 0_u64);
    let (mut first_us, mut last_us) = (u64::MAX, 0);
    let mut failure = None;
    loop {
        chunk.clear();
        let more = match recording.read_chunk(&mut chunk) {
            Ok(more) => more,
            Err(error) => {
                failure = Some(error);
                false
            }
        };
        for event in &chunk {
            match event.polarity {
                Polarity::On => on += 1,
                Polarity::Off => off += 1,
            }
            first_us = first_us.min(event.t_us);
            last_us = last_us.max(event.t_us);
        }
        if !more {
            break;
        }
    }
    let duration_s = last_us.saturating_sub(first_us) as f64 * 1e-6;
    let geometry = recording.geometry;
    println!("{name}");
    println!("format         {}", recording.format);
    println!("sensor         {}x{}", geometry.width_px, geometry.height_px);
    println!("duration       {duration_s:.6} s");
    println!("events         {} ({on} on, {off} off)", on + off);
    println!("out of order   {}", recording.out_of_order());
    println!("out of bounds  {}", recording.out_of_bounds());
    println!("lost           {}", recording.lost());
    println!("clock wraps    {}", recording.side().wraps);
    for sentence in &recording.assumed {
        println!("assumed        {sentence}");
    }
    for note in &recording.side().notes {
        println!("note           {note}");
    }
    match failure {
        Some(error) => Err(error).with_context(|| name),
        None => Ok(ExitCode::SUCCESS),
    }
}

//! `evtach bench throughput`: events measured a second on one core of this PC, from memory.
//!
//! Taking in an event costs the same always, a reading costs about the same however many events its window had, and readings come
//! twenty times a second (ten with the device's memory): so a dense stream is measured at more events a second than a sparse one. The
//! first reading takes as long as many later ones, as a rotor that is locked is followed.

use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context as _;
use evtach_core::{Geometry, Settings};
use evtach_host::measure::{Capacity, drain, feed, with_tachometer};
use evtach_host::synth::{Rotor, Scene, generate};

use super::say_line;

/// Arguments of `evtach bench throughput`.
#[derive(clap::Args)]
pub struct Args {
    /// One JSON document instead of a table.
    #[arg(long)]
    json: bool,
}

/// Times a recording is measured; the best counts.
const RUNS: usize = 3;

/// One line of the table.
#[derive(serde::Serialize)]
struct Row {
    scene: &'static str,
    capacity: &'static str,
    events: usize,
    /// Million events a second, in the recording.
    stream_mev_s: f64,
    /// The same that are measured.
    measured_mev_s: f64,
    /// Seconds of recording in a second of measuring.
    times_real_time: f64,
    readings: usize,
    /// Milliseconds of measuring until the first of them.
    first_ms: f64,
}

/// Three-bladed fans, from a quiet stream to one denser than any camera's link.
fn scenes() -> [(&'static str, Scene); 3] {
    let fan = |rpm: f64| Scene {
        rotors: vec![Rotor { rpm, ..Rotor::default() }],
        duration_ms: 2_000.0,
        ..Scene::default()
    };
    let large =
        Rotor { rpm: 6_000.0, radius_px: 165.0, x_px: 320.0, y_px: 240.0, ..Rotor::default() };
    let near = Scene {
        width_px: 640,
        height_px: 480,
        rotors: vec![large],
        duration_ms: 1_000.0,
        ..Scene::default()
    };
    [
        ("346x260, 50 px, 1500 rpm", fan(1_500.0)),
        ("346x260, 50 px, 6000 rpm", fan(6_000.0)),
        ("640x480, 165 px, 6000 rpm", near),
    ]
}

/// Runs the subcommand.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let mut rows = Vec::new();
    for (name, scene) in scenes() {
        let events = generate(&scene)?.events;
        let geometry = Geometry::new(scene.width_px, scene.height_px);
        let settings = Settings::new(geometry.context("a sensor out of range")?);
        for capacity in Capacity::ALL {
            let (mut best_s, mut first_s) = (f64::INFINITY, f64::INFINITY);
            let mut readings = 0;
            for _ in 0..RUNS {
                with_tachometer(settings, capacity, |tachometer| {
                    readings = 0;
                    let start = Instant::now();
                    let mut count = |_| {
                        if readings == 0 {
                            first_s = first_s.min(start.elapsed().as_secs_f64());
                        }
                        readings += 1;
                    };
                    feed(tachometer, &events, &mut &[][..], &mut count);
                    tachometer.finish();
                    drain(tachometer, &mut count);
                    best_s = best_s.min(start.elapsed().as_secs_f64());
                });
            }
            let (mega_events, duration_s) = (events.len() as f64 * 1e-6, scene.duration_ms * 1e-3);
            rows.push(Row {
                scene: name,
                capacity: capacity.as_str(),
                events: events.len(),
                stream_mev_s: mega_events / duration_s,
                measured_mev_s: mega_events / best_s,
                times_real_time: duration_s / best_s,
                readings,
                first_ms: first_s * 1e3,
            });
        }
    }
    print(&rows, args.json)?;
    Ok(ExitCode::SUCCESS)
}

fn print(rows: &[Row], json: bool) -> anyhow::Result<()> {
    if json {
        say_line(serde_json::to_string(rows)?)?;
        return Ok(());
    }
    say_line(format!(
        "{:<26} {:<8} {:>10} {:>13} {:>15} {:>16} {:>9} {:>9}",
        "scene",
        "memory",
        "events",
        "stream Mev/s",
        "measured Mev/s",
        "times real time",
        "readings",
        "first ms"
    ))?;
    for row in rows {
        say_line(format!(
            "{:<26} {:<8} {:>10} {:>13.1} {:>15.1} {:>16.1} {:>9} {:>9.0}",
            row.scene,
            row.capacity,
            row.events,
            row.stream_mev_s,
            row.measured_mev_s,
            row.times_real_time,
            row.readings,
            row.first_ms
        ))?;
    }
    Ok(())
}

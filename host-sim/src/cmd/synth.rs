//! `evtach synth`: a recording with known truth.
//!
//! ```text
//! evtach synth fan.raw --rpm 2400 --blades 5 --handheld
//! evtach synth drone.aedat4 --rotor x=100,y=130,rpm=4200,blades=2 --rotor x=240,y=130,rpm=-4150,blades=2
//! evtach synth lamp.raw --preset flicker --seed 3
//! ```
//!
//! Flags change the scene of `--preset` or `--scene`. The truth, with the whole scene in it, goes to `fan.truth.json`
//! beside the recording; `--scene` takes the scene out of such a file again.

mod args;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use evtach_core::Geometry;
use evtach_host::recording::write::{WriteFormat, Writer, create};
use evtach_host::recording::{ImuSample, RecordingError, parse_geometry};
use evtach_host::synth::presets::Preset;
use evtach_host::synth::{Model, Scene, Synthetic, generate};
use serde_json::Value;

use super::{keep_apart, keep_new_apart, say, tell};
use args::{BackdropArgs, MotionArgs, RotorArgs, SensorArgs, set};

/// Arguments of `evtach synth`.
#[derive(clap::Args)]
pub struct Args {
    /// Recording to write; the extension gives the format; `-` is stdout.
    out: PathBuf,
    /// Format, where the extension does not tell: evt2, evt3, dat, aedat4, csv, npy, es, spi, ev8.
    #[arg(long)]
    format: Option<WriteFormat>,
    /// Where the truth goes [default: beside the recording; nowhere for `-`]; `-` is stdout.
    #[arg(long)]
    truth: Option<PathBuf>,
    /// Scene to start from.
    #[arg(long, value_enum, default_value = "standard")]
    preset: Preset,
    /// Scene file, or a truth file, to start from.
    #[arg(long, conflicts_with = "preset")]
    scene: Option<PathBuf>,
    /// Print the scene as JSON and write nothing.
    #[arg(long)]
    print_scene: bool,
    /// Size of the sensor in pixels, for example 640x480.
    #[arg(long, value_parser = parse_geometry)]
    geometry: Option<Geometry>,
    /// Length in milliseconds.
    #[arg(long)]
    duration_ms: Option<f64>,
    /// How brightness becomes events.
    #[arg(long, value_enum)]
    model: Option<Model>,
    /// Everything random follows from it.
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    rotor: RotorArgs,
    #[command(flatten)]
    motion: MotionArgs,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    backdrop: BackdropArgs,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let scene = scene(args)?;
    if args.print_scene {
        say(format!("{}\n", serde_json::to_string_pretty(&scene)?))?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(format) = args.format.or_else(|| WriteFormat::from_path(&args.out)) else {
        bail!(
            "{}: the extension names no format; end it in .raw, .dat, .aedat4, .csv, .npy, .es, .spi or .ev8, \
             or give --format",
            args.out.display()
        );
    };
    let geometry = Geometry::new(scene.width_px, scene.height_px)
        .context("the sensor's sides have to be 1 to 2048 pixels: correct --geometry")?;
    let truth = args.truth.clone().or_else(|| truth_path(&args.out));
    let stdout = Path::new("-");
    if args.out == stdout && truth.as_deref() == Some(stdout) {
        bail!("stdout takes either the recording or its truth; give one of them a name");
    }
    if let Some(path) = truth.as_deref().filter(|_| args.out != stdout) {
        // Before anything is written.
        keep_new_apart(&args.out, path)?;
    }
    let made = {
        let spinner = indicatif::ProgressBar::new_spinner().with_message("synthesising");
        spinner.enable_steady_tick(std::time::Duration::from_millis(100));
        let made = generate(&scene);
        spinner.finish_and_clear();
        made?
    };
    let mut writer =
        create(&args.out, format, geometry).with_context(|| args.out.display().to_string())?;
    write(&mut writer, &made)?;
    writer.finish()?;
    if let Some(path) = &truth {
        // Other names of what was just created are seen only now.
        keep_apart(&args.out, path)?;
        write_truth(path, &made)?;
    }
    report(&args.out, format, &made, truth.as_deref());
    Ok(ExitCode::SUCCESS)
}

/// Writes gyro samples and events side by side in time, as a camera's recorder does.
fn write(writer: &mut Writer, made: &Synthetic) -> Result<(), RecordingError> {
    const PIECE_EVENTS: usize = 4096;
    let samples: Vec<ImuSample> = made.gyro.iter().map(ImuSample::rolling).collect();
    let mut samples = &samples[..];
    for events in made.events.chunks(PIECE_EVENTS) {
        let until_us = events.last().map_or(0, |event| event.t_us);
        let (reached, later) =
            samples.split_at(samples.partition_point(|sample| sample.t_us <= until_us));
        writer.write_imu(reached)?;
        writer.write(events)?;
        samples = later;
    }
    writer.write_imu(samples)
}

fn report(out: &Path, format: WriteFormat, made: &Synthetic, truth: Option<&Path>) {
    let t = &made.truth;
    let mega = t.events as f64 / t.duration_s / 1e6;
    tell(format!(
        "{}: {} events in {:.0} ms ({mega:.2} Mev/s), {}, {} lost in the readout",
        out.display(),
        t.events,
        t.duration_s * 1e3,
        format.as_str(),
        t.dropped
    ));
    for r in &t.rotors {
        tell(format!(
            "  {:.2} rpm {} in the room, {} blades, radius {:.0} px at ({:.0}, {:.0})",
            r.rpm_room_mean_signed.abs(),
            r.direction,
            r.blades,
            r.radius_px,
            r.centre_px[0],
            r.centre_px[1]
        ));
    }
    if !made.gyro.is_empty() && !format.holds_imu() {
        let kept = if truth.is_some() { "in the truth alone" } else { "nowhere" };
        tell(format!(
            "  gyro samples: {kept}, {} has no place for them; aedat4 has",
            format.as_str()
        ));
    }
    if let Some(path) = truth {
        tell(format!("  truth: {}", path.display()));
    }
}

/// The truth file beside a recording: its name without the extensions of its format.
fn truth_path(out: &Path) -> Option<PathBuf> {
    let name = Path::new(out.file_name().filter(|name| *name != "-")?);
    let stem = Path::new(name.file_stem()?);
    let is_kind_of_raw = stem.extension().is_some_and(|kind| kind == "evt2" || kind == "evt3");
    let stem = if is_kind_of_raw { stem.file_stem()? } else { stem.as_os_str() };
    // Not through text: names need not be UTF-8.
    let mut truth = stem.to_owned();
    truth.push(".truth.json");
    Some(out.with_file_name(truth))
}

fn write_truth(path: &Path, made: &Synthetic) -> anyhow::Result<()> {
    let mut value = serde_json::to_value(&made.truth)?;
    if !made.gyro.is_empty() {
        let samples = made.gyro.iter().map(|s| (s.t_us, s.roll_rad_s)).collect::<Vec<_>>();
        value["gyro_us_rad_s"] = serde_json::to_value(samples)?;
    }
    let text = format!("{}\n", serde_json::to_string_pretty(&value)?);
    if path == Path::new("-") {
        return say(text);
    }
    std::fs::write(path, text)
        .with_context(|| format!("{}: cannot be written; choose --truth", path.display()))
}

fn scene(args: &Args) -> anyhow::Result<Scene> {
    let mut scene = match &args.scene {
        None => args.preset.scene(),
        Some(path) => {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("{}: cannot be read; check the path", path.display()))?;
            let mut value: Value = serde_json::from_str(&text).with_context(|| {
                format!("{}: no JSON; --print-scene shows what a scene looks like", path.display())
            })?;
            let value = value.get_mut("scene").map_or(Value::Null, Value::take);
            let value = if value.is_null() { serde_json::from_str(&text)? } else { value };
            serde_json::from_value(value)
                .with_context(|| format!("{}: no scene; --print-scene shows one", path.display()))?
        }
    };
    if let Some(geometry) = args.geometry {
        let (dx, dy) = (
            (f64::from(geometry.width_px) - f64::from(scene.width_px)) / 2.0,
            (f64::from(geometry.height_px) - f64::from(scene.height_px)) / 2.0,
        );
        // What was in the middle stays there.
        scene.rotors.iter_mut().for_each(|r| {
            r.x_px += dx;
            r.y_px += dy;
        });
        (scene.width_px, scene.height_px) = (geometry.width_px, geometry.height_px);
    }
    set(&mut scene.duration_ms, args.duration_ms);
    set(&mut scene.model, args.model);
    set(&mut scene.seed, args.seed);
    args.rotor.apply(&mut scene);
    args.motion.apply(&mut scene);
    args.sensor.apply(&mut scene);
    args.backdrop.apply(&mut scene);
    scene.check()?;
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_truth_lies_beside_the_recording() {
        let truth = |out: &str| truth_path(Path::new(out));
        assert_eq!(truth("a/fan.evt2.raw"), Some(PathBuf::from("a/fan.truth.json")));
        assert_eq!(truth("fan.v2.aedat4"), Some(PathBuf::from("fan.v2.truth.json")));
        assert_eq!(truth("fan"), Some(PathBuf::from("fan.truth.json")));
        assert_eq!(truth("-"), None);
    }

    #[cfg(unix)]
    #[test]
    fn names_need_not_be_utf_8() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt as _;
        let path = |bytes: &'static [u8]| Path::new(OsStr::from_bytes(bytes));
        let truth = truth_path(path(b"a/f\xff.evt3.raw"));
        assert_eq!(truth.as_deref(), Some(path(b"a/f\xff.truth.json")));
    }
}

//! How a recording is to be measured: what `measure` and `plot` let a person say.

use std::path::Path;

use anyhow::{Context, bail};
use evtach_core::limits::MOST_STATED_BLADES;
use evtach_core::{Event, Frame, Geometry, Ignored, Reading, Roi, Settings};
use evtach_host::measure::{Capacity, FileFacts, Plan, Run, Summary, Timeline, summarise_all};
use evtach_host::recording;
use indicatif::{ProgressBar, ProgressStyle};

use super::span::Span;
use super::stated::Stated;
use super::{Outcome, in_order, note, tell};

/// What is known better than the tachometer finds it, and the memory it is given.
#[derive(clap::Args)]
pub struct How {
    /// Blade count, when it is known.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=i64::from(MOST_STATED_BLADES)))]
    blades: Option<u8>,
    /// Look at this part of the sensor only, in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_roi)]
    roi: Option<Roi>,
    /// Fixed window instead of one that adapts to the rotor.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(5..=2000))]
    window_ms: Option<u32>,
    #[command(flatten)]
    span: Span,
    #[command(flatten)]
    stated: Stated,
    /// Memory of the tachometer: "device" gives what the device shows, to the bit.
    #[arg(long, value_enum, default_value = "full")]
    capacity: Capacity,
    /// One standard deviation of the camera clock's error.
    #[arg(long, value_name = "PPM", default_value_t = 15.0, value_parser = parse_clock_ppm)]
    clock_ppm: f32,
    /// Take the camera's own roll out of the speed by the recording's gyro, where it has one.
    ///
    /// The gyro's offset is found while measuring, in some seconds from the hand; --gyro-sigma tells how well it is known before. Its
    /// axes are those of the cameras' documentation, not yet checked against a recording of a rolling camera.
    #[arg(long)]
    gyro: bool,
    /// One standard deviation of the gyro's zero-rate offset; 0.003 where it was calibrated on a still camera. Unless stated, that of
    /// data sheets.
    #[arg(long, value_name = "RAD/S", requires = "gyro", value_parser = parse_gyro_sigma)]
    gyro_sigma: Option<f32>,
}

/// What was measured of a recording.
pub struct Measured {
    pub plan: Plan,
    pub facts: FileFacts,
    pub geometry: Geometry,
    /// What was assumed about the file, one sentence each.
    pub assumed: Vec<String>,
    pub readings: Vec<Reading>,
    pub summary: Summary,
    /// Whether damage ended it before its end.
    pub is_damaged: bool,
}

impl Measured {
    /// The exit code.
    pub fn outcome(&self) -> Outcome {
        Outcome::of(self.is_damaged, self.summary.has_speed())
    }
}

impl How {
    /// Measures a recording, and says on stderr what is to be known of it. `all_stages`: those, too, that no speed needs. `seen` is
    /// handed the events that are measured.
    pub fn measure(
        &self,
        file: &Path,
        all_stages: bool,
        mut seen: impl FnMut(&[Event], &Timeline),
    ) -> anyhow::Result<Measured> {
        let since_us = self.span.since_us()?;
        let name = file.display().to_string();
        let options = self.stated.into();
        let mut recording = recording::open(file, &options).with_context(|| name.clone())?;
        for assumed in &recording.assumed {
            tell(format!("{name}: {assumed}"));
        }
        let plan = Plan {
            settings: Settings { all_stages, ..self.settings(recording.geometry) },
            capacity: self.capacity,
            takes_gyro: self.gyro,
            since_us,
        };
        let bar = spinner(&name);
        let run = Run::over(name.clone(), &mut recording, &plan, |events, timeline| {
            bar.inc(events.len() as u64);
            seen(events, timeline);
        });
        bar.finish_and_clear();
        if self.gyro && !run.has_gyro {
            tell(format!("{name}: no gyro samples; speeds are relative to the camera"));
        } else if self.gyro && leaves_roll(&run.readings) {
            tell(format!(
                "{name}: --gyro takes nothing out, speeds are relative to the camera: the gyro's offset is not known \
                 better than how the camera rolls; record for longer, or say by --gyro-sigma how well it is"
            ));
        }
        // Before what is wrong, as it may be why.
        note(&recording, &name);
        let is_damaged = run.damage.is_some() && !run.is_past_end;
        match run.damage {
            Some(damage) if run.events_read == 0 => return Err(damage).context(name),
            // What is damaged is not wanted.
            Some(damage) if run.is_past_end => {
                tell(format!("{name}: behind what is measured, {damage}"));
            }
            Some(damage) => tell(format!("{name}: {damage}; measured what came before")),
            None if run.events_read == 0 && recording.out_of_bounds() > 0 => {
                let Geometry { width_px, height_px } = recording.geometry;
                bail!(
                    "{name}: no event lies inside a sensor of {width_px}x{height_px}; state its size with --geometry WxH"
                )
            }
            None if run.events_read == 0 => bail!(
                "{name}: the recording holds no events; record again, or check the format with `evtach info`"
            ),
            None => {}
        }
        if let Some(part) = self.span.part(self.roi).filter(|_| run.readings.is_empty()) {
            bail!("{name}: no events {part}; widen what is stated");
        }
        let Ignored { out_of_order, out_of_roi, overrun, .. } = run.ignored;
        if out_of_order > 0 {
            tell(format!("{name}: {out_of_order} events stepped back in time and were left out"));
        }
        if overrun > 0 {
            tell(format!(
                "{name}: {overrun} events are in no window: they came right before a break in the stream or a window that began anew"
            ));
        }
        if let Some(wrong) = run.timeline.wrong_times() {
            tell(format!("{name}: {wrong}"));
        }
        if run.timeline.is_set_back() {
            let set_back = run.timeline.note();
            tell(format!("{name}: {set_back}; what follows is measured as if it came then"));
        }
        in_order(&recording, &name)?;
        let Run { facts, readings, .. } = run;
        let summary = summarise_all(&readings, &facts.streams_us, self.clock_ppm);
        if out_of_roi > 0 && !summary.has_speed() {
            // It may be why.
            tell(format!("{name}: {out_of_roi} of {} events lie outside --roi", facts.events));
        }
        let (geometry, assumed) = (recording.geometry, recording.assumed);
        Ok(Measured { plan, facts, geometry, assumed, readings, summary, is_damaged })
    }

    /// The tachometer's settings for a sensor of this size.
    fn settings(&self, geometry: Geometry) -> Settings {
        let mut settings = Settings::new(geometry);
        settings.roi = self.roi;
        settings.blades = self.blades;
        settings.window_us = self.window_ms.map(|ms| ms * 1000);
        settings.clock_sigma_ppm = self.clock_ppm;
        if let Some(sigma_rad_s) = self.gyro_sigma {
            settings.gyro_sigma_rad_s = sigma_rad_s;
        }
        settings
    }
}

/// Whether there are speeds, but none is relative to the room.
fn leaves_roll(readings: &[Reading]) -> bool {
    let rotors = readings.iter().flat_map(|reading| &reading.rotors);
    let mut frames = rotors.filter_map(|rotor| rotor.speed).map(|speed| speed.frame).peekable();
    frames.peek().is_some() && frames.all(|frame| frame == Frame::Camera)
}

/// Shows how many events were measured so far.
fn spinner(name: &str) -> ProgressBar {
    let bar = ProgressBar::new_spinner().with_message(name.to_owned());
    match ProgressStyle::with_template("{spinner} {msg} {human_pos} events, {per_sec}") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Beyond that it tells nothing: a clock that is 10 % off.
const MOST_CLOCK_PPM: f32 = 1e5;
/// Fifty times that of data sheets: a gyro that is further off measures nothing.
const MOST_GYRO_RAD_S: f32 = 10.0;

fn parse_clock_ppm(text: &str) -> Result<f32, String> {
    parse_sigma(text, MOST_CLOCK_PPM, "15")
}

fn parse_gyro_sigma(text: &str) -> Result<f32, String> {
    parse_sigma(text, MOST_GYRO_RAD_S, "0.003")
}

/// A standard deviation, which is a number, not negative and at most `most`; `example` is one.
fn parse_sigma(text: &str, most: f32, example: &str) -> Result<f32, String> {
    let sigma = text.parse().ok().filter(|sigma: &f32| (0.0..=most).contains(sigma));
    sigma.ok_or_else(|| {
        format!("\"{text}\" is no error bar; write a number from 0 to {most}, as {example}")
    })
}

/// A region as people write it: x,y,width,height in pixels.
pub fn parse_roi(text: &str) -> Result<Roi, String> {
    let sides: Option<Vec<u16>> = text.split(',').map(|side| side.trim().parse().ok()).collect();
    match sides.as_deref() {
        Some(&[x, y, width_px, height_px]) if width_px > 0 && height_px > 0 => {
            Ok(Roi { x, y, width_px, height_px })
        }
        _ => Err(format!("\"{text}\" is no region; write x,y,width,height in pixels")),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn error_bars_are_checked() {
        assert_eq!(parse_gyro_sigma("0.003"), Ok(0.003));
        assert_eq!(parse_clock_ppm("100000"), Ok(1e5));
        for text in ["", "-1", "nan", "inf", "1e30", "1e6", "a"] {
            let told = [parse_clock_ppm(text), parse_gyro_sigma(text)].map(Result::unwrap_err);
            assert!(told[0].contains("from 0 to 100000,"), "{}", told[0]);
            assert!(told[1].contains("from 0 to 10,"), "{}", told[1]);
        }
    }

    #[test]
    fn regions_are_checked() {
        let whole = Roi { x: 1, y: 2, width_px: 3, height_px: 4 };
        assert_eq!(parse_roi("1, 2,3,4"), Ok(whole));
        for text in ["", "1,2,3", "1,2,0,4", "1,2,3,4,5", "-1,2,3,4", "a,2,3,4", "a,1,2,3,4"] {
            assert!(parse_roi(text).is_err(), "{text}");
        }
    }
}

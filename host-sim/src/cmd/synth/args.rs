//! The flags of `evtach synth`: one for every property of a scene.

use evtach_host::synth::presets::{self, Preset};
use evtach_host::synth::scene::{Camera, Gyro, Lamp, Mover, Shape};
use evtach_host::synth::{Rotor, Scene};
use serde_json::{Map, Value};

/// Rotors.
#[derive(clap::Args)]
#[command(next_help_heading = "Rotors (single flags apply to all of them)")]
pub struct RotorArgs {
    /// A rotor, for example x=100,y=130,rpm=-4200,blades=2; may be repeated; replaces the preset's.
    #[arg(long = "rotor", value_name = "KEY=VALUE,...", value_parser = rotor)]
    rotors: Vec<Rotor>,
    /// Without any rotor.
    #[arg(long, conflicts_with = "rotors")]
    no_rotor: bool,
    /// Speed in rpm; positive is clockwise on the screen.
    #[arg(long, allow_negative_numbers = true)]
    rpm: Option<f64>,
    /// Number of blades.
    #[arg(long)]
    blades: Option<u8>,
    /// Radius in pixels.
    #[arg(long)]
    radius: Option<f64>,
    /// Radius of the hub in pixels.
    #[arg(long)]
    hub: Option<f64>,
    /// Column of the axis in pixels.
    #[arg(long, allow_negative_numbers = true)]
    x: Option<f64>,
    /// Row of the axis in pixels.
    #[arg(long, allow_negative_numbers = true)]
    y: Option<f64>,
    /// Shape of the blades.
    #[arg(long, value_enum)]
    shape: Option<Shape>,
    /// Width of the first blade relative to the others.
    #[arg(long)]
    odd_width: Option<f64>,
    /// Standard deviation of the blades' angles about even places in milliradians.
    #[arg(long)]
    blade_spread: Option<f64>,
    /// Relative change of the speed per second.
    #[arg(long, allow_negative_numbers = true)]
    ramp: Option<f64>,
    /// Relative amplitude of the motor's hunting.
    #[arg(long)]
    hunting: Option<f64>,
    /// Frequency of the hunting in Hz.
    #[arg(long)]
    hunting_hz: Option<f64>,
    /// Tilt of the axis against the line of sight in degrees.
    #[arg(long, allow_negative_numbers = true)]
    tilt: Option<f64>,
    /// Direction on the screen of the axis about which the disc is tilted, in degrees.
    #[arg(long, allow_negative_numbers = true)]
    tilt_axis: Option<f64>,
    /// Logarithm of blade over background intensity.
    #[arg(long, allow_negative_numbers = true)]
    contrast: Option<f64>,
    /// Angle of the first blade at the start in degrees.
    #[arg(long, allow_negative_numbers = true)]
    phase: Option<f64>,
}

/// Camera and mount.
#[derive(clap::Args)]
#[command(next_help_heading = "Motion")]
pub struct MotionArgs {
    /// The standard hand: tremor of 3 px and 3 mrad before a textured wall.
    #[arg(long)]
    handheld: bool,
    /// Tremor, rms in pixels.
    #[arg(long)]
    tremor_px: Option<f64>,
    /// Roll tremor, rms in milliradians.
    #[arg(long)]
    tremor_mrad: Option<f64>,
    /// Drift of the image to the right in pixels per second.
    #[arg(long, allow_negative_numbers = true)]
    drift_x: Option<f64>,
    /// Drift of the image downwards in pixels per second.
    #[arg(long, allow_negative_numbers = true)]
    drift_y: Option<f64>,
    /// Steady roll of the image in rad/s.
    #[arg(long, allow_negative_numbers = true)]
    roll: Option<f64>,
    /// Gyro samples: in the truth, and in a recording that is written as aedat4.
    #[arg(long)]
    gyro: bool,
    /// Gyro samples per second.
    #[arg(long)]
    gyro_hz: Option<f64>,
    /// Noise of a gyro sample in rad/s.
    #[arg(long)]
    gyro_noise: Option<f64>,
    /// Zero-rate offset of the gyro in rad/s.
    #[arg(long, allow_negative_numbers = true)]
    gyro_offset: Option<f64>,
    /// The standard shaken table: 1 px at 35 to 60 Hz and 0.4 px at twice that.
    #[arg(long)]
    vibrating: bool,
    /// Amplitude of the mount's vibration in pixels.
    #[arg(long)]
    vibration_px: Option<f64>,
    /// Amplitude at twice the frequency in pixels.
    #[arg(long)]
    vibration_second_px: Option<f64>,
    /// Frequency of the vibration in Hz.
    #[arg(long)]
    vibration_hz: Option<f64>,
}

/// Sensor and clock.
#[derive(clap::Args)]
#[command(next_help_heading = "Sensor")]
pub struct SensorArgs {
    /// Contrast threshold, logarithm of intensity.
    #[arg(long)]
    threshold: Option<f64>,
    /// Relative spread of the threshold over the pixels.
    #[arg(long)]
    threshold_spread: Option<f64>,
    /// Refractory time in microseconds.
    #[arg(long)]
    refractory_us: Option<f64>,
    /// Spread of the pixels' latencies in microseconds.
    #[arg(long)]
    latency_us: Option<f64>,
    /// Jitter of every event in microseconds.
    #[arg(long)]
    jitter_us: Option<f64>,
    /// Background noise in Hz per pixel.
    #[arg(long)]
    noise_hz: Option<f64>,
    /// Number of hot pixels.
    #[arg(long)]
    hot_pixels: Option<u32>,
    /// Rate of the hot pixels in Hz.
    #[arg(long)]
    hot_hz: Option<f64>,
    /// Share of the rotors' events that are lost one by one.
    #[arg(long)]
    dropout: Option<f64>,
    /// Optical blur in pixels.
    #[arg(long)]
    blur_px: Option<f64>,
    /// Capacity of the readout in million events per second.
    #[arg(long)]
    readout_mev_s: Option<f64>,
    /// Events that may wait for the readout.
    #[arg(long)]
    readout_queue: Option<u32>,
    /// Every event is reported as ON.
    #[arg(long)]
    all_on: bool,
    /// The pixels take what they see at first for their level, as in a sensor that has only just started.
    #[arg(long)]
    cold_start: bool,
    /// Error of the clock in ppm [default: drawn from its stated ppm].
    #[arg(long, allow_negative_numbers = true)]
    clock_ppm: Option<f64>,
    /// One standard deviation of the clock's error in ppm, as its maker states it.
    #[arg(long)]
    clock_sigma_ppm: Option<f64>,
}

/// Behind and around the rotors.
#[derive(clap::Args)]
#[command(next_help_heading = "Background")]
pub struct BackdropArgs {
    /// Contrast of the background's texture, logarithm of intensity.
    #[arg(long)]
    texture: Option<f64>,
    /// Size of the texture's features in pixels.
    #[arg(long)]
    grain_px: Option<f64>,
    /// Number of box-shaped things in the background.
    #[arg(long)]
    boxes: Option<u32>,
    /// Frequency of a lamp's light in Hz (100 or 120 on mains).
    #[arg(long)]
    lamp_hz: Option<f64>,
    /// Depth of the lamp's modulation, 0 to 0.95.
    #[arg(long)]
    lamp_depth: Option<f64>,
    /// Relative amplitudes of the lamp's 2nd, 3rd, ... harmonic.
    #[arg(long, value_delimiter = ',')]
    lamp_harmonics: Vec<f64>,
    /// Spot that the lamp lights: its place and radius in pixels, three numbers with blanks between.
    #[arg(long, num_args = 3, action = clap::ArgAction::Set, allow_negative_numbers = true, value_names = ["X", "Y", "RADIUS"])]
    lamp_spot: Vec<f64>,
    /// Something that moves without turning, as in a scene file: kind=bars,speed_px_s=1500 or kind=walker,step_hz=2.
    #[arg(long = "mover", value_name = "KEY=VALUE,...", value_parser = mover)]
    movers: Vec<Mover>,
}

/// Replaces a value by a flag's, where that was given.
pub fn set<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}

impl RotorArgs {
    /// Changes the scene by the flags that were given.
    pub fn apply(&self, scene: &mut Scene) {
        if !self.rotors.is_empty() {
            scene.rotors.clone_from(&self.rotors);
        }
        if self.no_rotor {
            scene.rotors.clear();
        }
        for r in &mut scene.rotors {
            set(&mut r.rpm, self.rpm);
            set(&mut r.blades, self.blades);
            set(&mut r.radius_px, self.radius);
            set(&mut r.hub_px, self.hub.map(Some));
            set(&mut r.x_px, self.x);
            set(&mut r.y_px, self.y);
            set(&mut r.shape, self.shape);
            set(&mut r.odd_width, self.odd_width);
            set(&mut r.blade_spread_mrad, self.blade_spread);
            set(&mut r.ramp_per_s, self.ramp);
            set(&mut r.hunting, self.hunting);
            set(&mut r.hunting_hz, self.hunting_hz);
            set(&mut r.tilt_deg, self.tilt);
            set(&mut r.tilt_axis_deg, self.tilt_axis);
            set(&mut r.contrast, self.contrast);
            set(&mut r.phase_deg, self.phase.map(Some));
        }
    }
}

impl MotionArgs {
    /// Changes the scene by the flags that were given.
    pub fn apply(&self, scene: &mut Scene) {
        let camera = &mut scene.camera;
        if self.handheld {
            *camera = Camera { gyro: camera.gyro.take(), ..presets::hand() };
            scene.background = presets::wall();
        }
        set(&mut camera.tremor_px, self.tremor_px);
        set(&mut camera.tremor_mrad, self.tremor_mrad);
        set(&mut camera.drift_px_s[0], self.drift_x);
        set(&mut camera.drift_px_s[1], self.drift_y);
        set(&mut camera.roll_rad_s, self.roll);
        let detail = [self.gyro_hz, self.gyro_noise, self.gyro_offset];
        if self.gyro || detail.iter().any(Option::is_some) {
            let gyro = camera.gyro.get_or_insert_with(Gyro::default);
            set(&mut gyro.rate_hz, self.gyro_hz);
            set(&mut gyro.noise_rad_s, self.gyro_noise);
            set(&mut gyro.offset_rad_s, self.gyro_offset);
        }
        if self.vibrating {
            scene.vibration = presets::shaken();
        }
        set(&mut scene.vibration.amplitude_px, self.vibration_px);
        set(&mut scene.vibration.second_px, self.vibration_second_px);
        set(&mut scene.vibration.frequency_hz, self.vibration_hz.map(Some));
    }
}

impl SensorArgs {
    /// Changes the scene by the flags that were given.
    pub fn apply(&self, scene: &mut Scene) {
        let s = &mut scene.sensor;
        set(&mut s.threshold, self.threshold);
        set(&mut s.threshold_spread, self.threshold_spread);
        set(&mut s.refractory_us, self.refractory_us);
        set(&mut s.latency_spread_us, self.latency_us);
        set(&mut s.jitter_us, self.jitter_us);
        set(&mut s.noise_hz, self.noise_hz);
        set(&mut s.hot_pixels, self.hot_pixels);
        set(&mut s.hot_hz, self.hot_hz);
        set(&mut s.dropout, self.dropout);
        set(&mut s.blur_px, self.blur_px);
        set(&mut s.readout_mev_s, self.readout_mev_s.map(Some));
        set(&mut s.readout_queue, self.readout_queue);
        s.all_on |= self.all_on;
        s.cold_start |= self.cold_start;
        set(&mut scene.clock.sigma_ppm, self.clock_sigma_ppm);
        set(&mut scene.clock.error_ppm, self.clock_ppm.map(Some));
    }
}

impl BackdropArgs {
    /// Changes the scene by the flags that were given.
    pub fn apply(&self, scene: &mut Scene) {
        set(&mut scene.background.contrast, self.texture);
        set(&mut scene.background.grain_px, self.grain_px);
        set(&mut scene.background.boxes, self.boxes);
        let spot = <[f64; 3]>::try_from(self.lamp_spot.as_slice()).ok();
        let given = self.lamp_hz.or(self.lamp_depth).is_some();
        if given || spot.is_some() || !self.lamp_harmonics.is_empty() {
            let lamp = scene.lamp.get_or_insert_with(Lamp::default);
            set(&mut lamp.frequency_hz, self.lamp_hz);
            set(&mut lamp.depth, self.lamp_depth);
            set(&mut lamp.spot_px, spot.map(Some));
            if !self.lamp_harmonics.is_empty() {
                lamp.harmonics.clone_from(&self.lamp_harmonics);
            }
        }
        scene.movers.extend(self.movers.iter().cloned());
    }
}

/// Reads KEY=VALUE,... over the given values; keys may leave out their unit.
fn overlay(base: Map<String, Value>, text: &str) -> Result<Value, String> {
    let mut map = base;
    for pair in text.split(',') {
        let (key, value) =
            pair.split_once('=').ok_or_else(|| format!("{pair:?} should be key=value"))?;
        let key = key.trim();
        let known = ["", "_px", "_deg", "_per_s", "_px_s", "_hz"]
            .iter()
            .map(|unit| format!("{key}{unit}"))
            .find(|name| map.contains_key(name));
        let value = value.trim();
        // JSON has neither NaN nor infinity: as numbers they would become null, which means "not given".
        let number = value.parse::<f64>().ok().filter(|number| number.is_finite());
        let value = number.map_or_else(
            || Value::from(value),
            // Whole numbers stay whole: blade counts are integers.
            |number| value.parse::<u64>().map_or_else(|_| Value::from(number), Value::from),
        );
        map.insert(known.unwrap_or_else(|| key.to_owned()), value);
    }
    Ok(Value::Object(map))
}

fn rotor(text: &str) -> Result<Rotor, String> {
    let base = match serde_json::to_value(Rotor::default()) {
        Ok(Value::Object(map)) => map,
        other => return Err(format!("{other:?}")),
    };
    serde_json::from_value(overlay(base, text)?).map_err(|e| e.to_string())
}

fn mover(text: &str) -> Result<Mover, String> {
    let preset = if text.contains("walker") { Preset::Walker } else { Preset::Bar };
    let base = preset.scene().movers.into_iter().next().map(serde_json::to_value);
    let base = match base {
        Some(Ok(Value::Object(map))) => map,
        other => return Err(format!("{other:?}")),
    };
    serde_json::from_value(overlay(base, text)?).map_err(|e| e.to_string())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_rotor_is_read_from_pairs() {
        let read = rotor("x=100, y=20.5,rpm=-4200,blades=2,shape=dot,tilt=20").unwrap();
        let expected = Rotor {
            x_px: 100.0,
            y_px: 20.5,
            rpm: -4200.0,
            blades: 2,
            shape: Shape::Dot,
            tilt_deg: 20.0,
            ..Rotor::default()
        };
        assert_eq!(read, expected);
        assert!(rotor("blades=2.5").is_err());
        assert!(rotor("wings=2").unwrap_err().contains("wings"));
        assert!(rotor("blades").is_err());
        for text in ["phase=nan", "hub=inf", "x=-inf"] {
            assert!(rotor(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_lamp_spot_is_three_numbers() {
        use clap::{Args as _, FromArgMatches as _};
        let spot = |flags: &[&str]| {
            let command = BackdropArgs::augment_args(clap::Command::new("synth"));
            let matches = command.try_get_matches_from([&["synth"][..], flags].concat()).ok()?;
            Some(BackdropArgs::from_arg_matches(&matches).ok()?.lamp_spot)
        };
        assert_eq!(spot(&["--lamp-spot", "-10", "120", "60.5"]), Some(vec![-10.0, 120.0, 60.5]));
        assert_eq!(spot(&[]), Some(Vec::new()));
        assert_eq!(spot(&["--lamp-spot", "1,2", "3", "4"]), None);
        assert_eq!(spot(&["--lamp-spot", "1", "2"]), None);
        let twice = ["--lamp-spot", "1", "2", "3", "--lamp-spot", "1", "2", "3"];
        assert_eq!(spot(&twice), None);
    }

    #[test]
    fn movers_start_from_their_kind() {
        assert!(matches!(mover("kind=walker,step=3"), Ok(Mover::Walker { step_hz: 3.0, .. })));
        let bars = mover("kind=bars,spacing=30,speed=-800").unwrap();
        assert!(matches!(bars, Mover::Bars { spacing_px: Some(30.0), speed_px_s: -800.0, .. }));
    }
}

//! Recordings with known truth, made from a scene.
//!
//! Two event models that share nothing but the rotor's outline, so that an estimator cannot be tuned to one: [`threshold`]
//! renders the intensity and lets each pixel compare it with its threshold, [`edges`] computes when each edge passes each
//! pixel. Each random number depends on the seed and the pixel alone, so the number of threads changes nothing.

mod backdrop;
mod blades;
mod check;
pub mod edges;
mod field;
mod made;
pub mod motion;
mod pixel;
pub mod presets;
mod random;
mod readout;
pub mod scene;
pub mod threshold;
pub mod truth;

use evtach_core::{Event, GyroSample};
use rayon::prelude::*;

use field::Field;
use made::Made;
pub use motion::Motion;
use pixel::{Pixel, Span, Tray};
use random::{Purpose, normal, stream};
pub use scene::{Model, Rotor, Scene, SceneError};
pub use truth::{RotorTruth, Truth, Verdict};

/// What all pixels of a row are taken through together, in seconds: its poses stay in the processor's cache.
const SLICE_S: f64 = 0.1;

/// A synthetic recording.
#[derive(Clone, Debug)]
pub struct Synthetic {
    /// Events by time, then row, column and polarity.
    pub events: Vec<Event>,
    /// Samples of the camera's gyro, where the scene has one.
    pub gyro: Vec<GyroSample>,
    /// What is true of it.
    pub truth: Truth,
}

/// Makes the recording of a scene.
///
/// # Errors
/// When a value of the scene is out of range.
pub fn generate(scene: &Scene) -> Result<Synthetic, SceneError> {
    scene.check()?;
    let motion = Motion::new(scene);
    let duration_s = scene.duration_s();
    let ticks_per_s = 1e6 * (1.0 + motion.clock_error_ppm() * 1e-6);
    let span = Span { duration_s, ticks_per_s };

    let longest_period_s = scene.rotors.iter().map(Rotor::period_s).fold(0.2, f64::max);
    let renders_rotors = scene.model == Model::Threshold;
    let field = Field::new(
        scene,
        &motion,
        -longest_period_s - 4.0 * threshold::TAIL_S,
        duration_s + 2.0 * threshold::TAIL_S,
        renders_rotors,
    );
    let contrasts: Vec<f64> = scene.rotors.iter().map(|r| r.contrast).collect();
    let rows: Vec<Tray> = (0..scene.height_px)
        .into_par_iter()
        .map(|y| row(scene, &field, &contrasts, &span, y))
        .collect();

    let mut made = Vec::with_capacity(rows.iter().map(Vec::len).sum());
    rows.into_iter().for_each(|row| made.extend(row));
    made.extend(hot_pixels(scene, &span));
    made.par_sort_unstable();
    let dropped = match scene.sensor.readout_mev_s {
        Some(rate) => {
            let end_us = (duration_s * ticks_per_s) as u64;
            readout::limit(&mut made, rate, scene.sensor.readout_queue, end_us)
        }
        None => 0,
    };
    let mut of_rotor = vec![0; contrasts.len()];
    for rotor in made.iter().filter_map(|made| made.rotor()) {
        of_rotor[rotor] += 1;
    }
    let truth = Truth::new(scene, &motion, &of_rotor, made.len() as u64, dropped);
    let events = made.into_iter().map(Made::event).collect();
    Ok(Synthetic { events, gyro: gyro_samples(scene, &motion, &span), truth })
}

/// The events of one row of pixels.
fn row(scene: &Scene, field: &Field, contrasts: &[f64], span: &Span, y: u16) -> Tray {
    let mut tray = Tray::new();
    let mut pixels: Vec<_> = (0..scene.width_px)
        .map(|x| {
            let mut pixel = Pixel::new(&scene.sensor, scene.seed, x, y);
            pixel.noise(scene.sensor.noise_hz, false, span, &mut tray);
            let view = field.view(x, y, scene.sensor.threshold);
            let run = view.map(|view| threshold::Run::new(field, view, &mut pixel));
            (x, pixel, run)
        })
        .collect();
    let end_s = span.duration_s + threshold::TAIL_S;
    let mut until_s = 0.0;
    while until_s < end_s {
        until_s += SLICE_S;
        for (_, pixel, run) in &mut pixels {
            if let Some(run) = run {
                run.advance(field, pixel, until_s, span, &mut tray);
            }
        }
    }
    if !field.renders_layers {
        for (x, pixel, _) in &mut pixels {
            edges::run(field, contrasts, (*x, y), pixel, span, &mut tray);
        }
    }
    tray
}

fn hot_pixels(scene: &Scene, span: &Span) -> Tray {
    use rand::Rng as _;
    let mut places = stream(scene.seed, Purpose::Hot, 0);
    let mut tray = Tray::new();
    for number in 0..scene.sensor.hot_pixels {
        let x = places.random_range(0..scene.width_px);
        let y = places.random_range(0..scene.height_px);
        let rate_hz = scene.sensor.hot_hz * places.random_range(0.3..2.0);
        // A stream of its own: the pixel's other events must not change because it is hot.
        let seed = scene.seed ^ 0x5eed_0000 ^ u64::from(number);
        Pixel::new(&scene.sensor, seed, x, y).noise(rate_hz, true, span, &mut tray);
    }
    tray
}

fn gyro_samples(scene: &Scene, motion: &Motion, span: &Span) -> Vec<GyroSample> {
    let Some(gyro) = &scene.camera.gyro else { return Vec::new() };
    let mut rng = stream(scene.seed, Purpose::Gyro, 0);
    let count = (span.duration_s * gyro.rate_hz) as u32 + 1;
    let at = |i: u32| f64::from(i) / gyro.rate_hz;
    (0..count)
        .filter_map(|i| {
            let noise = gyro.noise_rad_s * normal(&mut rng);
            let roll_rad_s = (motion.roll_rate(at(i)) + gyro.offset_rad_s + noise) as f32;
            Some(GyroSample { t_us: span.stamp(at(i))?, roll_rad_s })
        })
        .collect()
}

#[cfg(test)]
mod tests;

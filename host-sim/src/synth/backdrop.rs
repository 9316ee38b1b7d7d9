//! What is not a rotor: texture, lamp, and things that move without turning.

use std::f64::consts::TAU;

use rand::Rng as _;

use super::random::{Purpose, normal, stream};
use super::scene::{Lamp, Mover, Scene};

/// Still texture of the room, one value a pixel and a margin around the sensor.
#[derive(Debug)]
pub struct Texture {
    width: usize,
    height: usize,
    level: Vec<f32>,
    intensity: Vec<f32>,
}

impl Texture {
    /// Margin in pixels that the camera may see beyond the sensor's rest position.
    const MARGIN: usize = 40;

    /// The texture of a scene, or `None` for a plain background.
    #[must_use]
    pub fn new(scene: &Scene) -> Option<Self> {
        let back = &scene.background;
        if back.contrast == 0.0 && back.boxes == 0 {
            return None;
        }
        let width = usize::from(scene.width_px) + 2 * Self::MARGIN;
        let height = usize::from(scene.height_px) + 2 * Self::MARGIN;
        let mut rng = stream(scene.seed, Purpose::Texture, 0);
        let mut level = vec![0.0f64; width * height];
        // Two octaves of smooth noise on a lattice.
        for (grain, share) in [(back.grain_px, 0.8), (back.grain_px / 2.5, 0.6)] {
            let columns = (width as f64 / grain) as usize + 3;
            let rows = (height as f64 / grain) as usize + 3;
            let lattice: Vec<f64> = (0..columns * rows).map(|_| normal(&mut rng)).collect();
            for (i, value) in level.iter_mut().enumerate() {
                let (u, v) = ((i % width) as f64 / grain, (i / width) as f64 / grain);
                let (c, r) = (u as usize, v as usize);
                let (fu, fv) = (smooth(u - c as f64), smooth(v - r as f64));
                let at = |dc: usize, dr: usize| lattice[(r + dr) * columns + c + dc];
                let top = at(0, 0) + (at(1, 0) - at(0, 0)) * fu;
                let bottom = at(0, 1) + (at(1, 1) - at(0, 1)) * fu;
                *value += back.contrast * share * 1.5 * (top + (bottom - top) * fv);
            }
        }
        for _ in 0..back.boxes {
            let (bw, bh) = (rng.random_range(12.0..70.0), rng.random_range(12.0..70.0));
            let (bx, by) =
                (rng.random_range(0.0..width as f64), rng.random_range(0.0..height as f64));
            let shade = 0.6 * normal(&mut rng);
            for (i, value) in level.iter_mut().enumerate() {
                let dx = bw / 2.0 - ((i % width) as f64 - bx).abs();
                let dy = bh / 2.0 - ((i / width) as f64 - by).abs();
                let inside = (dx.min(dy) + 0.5).clamp(0.0, 1.0);
                *value += shade * inside;
            }
        }
        let level: Vec<f32> = level.iter().map(|v| v.clamp(-2.0, 2.0) as f32).collect();
        let intensity = level.iter().map(|v| v.exp()).collect();
        Some(Self { width, height, level, intensity })
    }

    /// Intensity at a place in the room.
    #[must_use]
    pub fn intensity(&self, room: [f64; 2]) -> f64 {
        self.between(&self.intensity, room)
    }

    /// Logarithm of intensity at a place in the room.
    #[must_use]
    pub fn level(&self, room: [f64; 2]) -> f64 {
        self.between(&self.level, room)
    }

    fn between(&self, values: &[f32], room: [f64; 2]) -> f64 {
        let margin = Self::MARGIN as f64;
        let u = (room[0] + margin).clamp(0.0, (self.width - 2) as f64) as f32;
        let v = (room[1] + margin).clamp(0.0, (self.height - 2) as f64) as f32;
        let (c, r) = (u as usize, v as usize);
        let (fu, fv) = (u - c as f32, v - r as f32);
        let row = |r: usize| {
            let (a, b) = (values[r * self.width + c], values[r * self.width + c + 1]);
            a + (b - a) * fu
        };
        let (top, bottom) = (row(r), row(r + 1));
        f64::from(top + (bottom - top) * fv)
    }
}

fn smooth(u: f64) -> f64 {
    u * u * (3.0 - 2.0 * u)
}

/// A lamp on mains current.
#[derive(Debug)]
pub struct Light {
    lamp: Lamp,
    wave: Vec<f64>,
}

impl Light {
    const SAMPLES: usize = 1024;

    /// The light of a lamp.
    #[must_use]
    pub fn new(lamp: &Lamp) -> Self {
        let shape = |u: f64| {
            let harmonics = (2u32..).zip(&lamp.harmonics);
            (TAU * u).sin()
                + harmonics.map(|(k, a)| a * (TAU * u * f64::from(k)).sin()).sum::<f64>()
        };
        let mut wave: Vec<f64> =
            (0..=Self::SAMPLES).map(|i| shape(i as f64 / Self::SAMPLES as f64)).collect();
        let peak = wave.iter().fold(1e-9f64, |m, v| m.max(v.abs()));
        wave.iter_mut().for_each(|v| *v /= peak);
        Self { lamp: lamp.clone(), wave }
    }

    /// Period of the light in seconds.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        1.0 / self.lamp.frequency_hz
    }

    /// Seconds between two looks at the light.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.period_s() / 24.0
    }

    /// Depth of the modulation at a place.
    #[must_use]
    pub fn depth(&self, [x, y]: [f64; 2]) -> f64 {
        let share = self.lamp.spot_px.map_or(1.0, |[sx, sy, radius]| {
            let d = ((x - sx).powi(2) + (y - sy).powi(2)) / (radius * radius).max(1.0);
            // A spot fades; its nominal radius is where a quarter is left.
            (-1.386 * d * d).exp()
        });
        self.lamp.depth * share
    }

    /// Largest change of the logarithm of intensity at a pixel.
    #[must_use]
    pub fn swing(&self, place: [f64; 2]) -> f64 {
        let depth = self.depth(place);
        ((1.0 + depth) / (1.0 - depth)).ln()
    }

    /// The light at a time, relative to its mean, where its depth is known.
    #[must_use]
    pub fn factor(&self, depth: f64, t_s: f64) -> f64 {
        let place = (t_s * self.lamp.frequency_hz).rem_euclid(1.0) * Self::SAMPLES as f64;
        let i = (place as usize).min(Self::SAMPLES - 1);
        let wave = self.wave[i] + (self.wave[i + 1] - self.wave[i]) * (place - i as f64);
        1.0 + depth * wave
    }
}

/// A mover with what it needs to be drawn.
#[derive(Debug)]
pub struct Shade {
    mover: Mover,
    middle: [f64; 2],
    transition: f64,
}

impl Shade {
    /// The shade of a mover.
    #[must_use]
    pub fn new(mover: &Mover, scene: &Scene) -> Self {
        Self {
            mover: mover.clone(),
            middle: [f64::from(scene.width_px) / 2.0, f64::from(scene.height_px) / 2.0],
            transition: 4.472 * scene.sensor.blur_px,
        }
    }

    /// Intensity of the mover.
    #[must_use]
    pub fn intensity(&self) -> f64 {
        let (Mover::Bars { contrast, .. } | Mover::Walker { contrast, .. }) = self.mover;
        contrast.exp()
    }

    /// Upper bound of the speed of its outline in pixels per second.
    #[must_use]
    pub fn speed(&self) -> f64 {
        match self.mover {
            Mover::Bars { speed_px_s, .. } => speed_px_s.abs(),
            Mover::Walker { speed_px_s, step_hz, height_px, .. } => {
                speed_px_s.abs() + TAU * step_hz.abs() * height_px * 0.2
            }
        }
    }

    /// Share of the pixel that is covered, and distance in pixels to the nearest change.
    #[must_use]
    pub fn look(&self, room: [f64; 2], t_s: f64) -> (f64, f64) {
        let inside = match self.mover {
            Mover::Bars { direction_deg, speed_px_s, width_px, spacing_px, offset_px, .. } => {
                let (sin, cos) = direction_deg.to_radians().sin_cos();
                let along = (room[0] - self.middle[0]) * cos + (room[1] - self.middle[1]) * sin;
                let mut from_middle = along - offset_px - speed_px_s * t_s;
                if let Some(spacing) = spacing_px {
                    from_middle -= spacing * (from_middle / spacing).round();
                }
                width_px / 2.0 - from_middle.abs()
            }
            Mover::Walker { x_px, y_px, height_px, speed_px_s, step_hz, .. } => {
                let (x, y) = (room[0] - x_px - speed_px_s * t_s, room[1] - y_px);
                let swing = (TAU * step_hz * t_s).sin() * 0.2 * height_px;
                let limb = |foot: f64, top: f64, length: f64| {
                    // A capsule from hip or shoulder to foot or hand.
                    let (bx, by) = (foot, length);
                    let (px, py) = (x, y - top);
                    let u = ((px * bx + py * by) / (bx * bx + by * by)).clamp(0.0, 1.0);
                    0.045 * height_px - (px - u * bx).hypot(py - u * by)
                };
                let body = {
                    let (bx, by) = (x / (0.11 * height_px), y / (0.22 * height_px));
                    (1.0 - bx.hypot(by)) * 0.11 * height_px
                };
                let head = 0.08 * height_px - x.hypot(y + 0.33 * height_px);
                let hip = 0.15 * height_px;
                let legs =
                    limb(swing, hip, 0.35 * height_px).max(limb(-swing, hip, 0.35 * height_px));
                let shoulder = -0.18 * height_px;
                let arms = limb(-swing * 0.8, shoulder, 0.3 * height_px).max(limb(
                    swing * 0.8,
                    shoulder,
                    0.3 * height_px,
                ));
                body.max(head).max(legs).max(arms)
            }
        };
        let u = (inside / self.transition + 0.5).clamp(0.0, 1.0);
        (smooth(u), inside.abs() - self.transition / 2.0)
    }
}

//! The logarithm of intensity at a pixel at any time: what the threshold model looks at.

use std::f64::consts::TAU;

use super::backdrop::{Light, Shade, Texture};
use super::blades::{Blades, Ring};
use super::motion::{Motion, Pose, PoseTable, Spin};
use super::scene::{Rotor, Scene};

/// Largest step in pixels of an edge's motion between two samples.
const STEP_PX: f64 = 0.6;
/// Largest step in pixels of the image's own motion between two samples.
const IMAGE_STEP_PX: f64 = 0.5;

/// A rotor as the field sees it.
#[derive(Debug)]
pub struct Layer {
    /// Outline.
    pub blades: Blades,
    /// Angle over time.
    pub spin: Spin,
    intensity: f64,
    axis: [f64; 2],
    tilt: [f64; 2],
    stretch: f64,
    peak_rate: f64,
    bounds: [f64; 4],
    warm_up_s: f64,
}

impl Layer {
    fn new(rotor: &Rotor, number: usize, scene: &Scene, motion: &Motion, span: (f64, f64)) -> Self {
        let blades = Blades::new(rotor, scene.sensor.blur_px);
        let spin = motion.spins()[number].clone();
        let (sin, cos) = rotor.tilt_axis_deg.to_radians().sin_cos();
        // Where the centre gets to, in milliseconds steps; half a pixel covers what lies between.
        let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let steps = if motion.rotors_move() { ((span.1 - span.0) * 1e3).ceil() as u32 } else { 0 };
        for i in 0..=steps {
            let [x, y] = motion.centre(rotor, span.0 + f64::from(i) * 1e-3);
            let reach = blades.reach() + 0.5;
            bounds = [
                bounds[0].min(x - reach),
                bounds[1].min(y - reach),
                bounds[2].max(x + reach),
                bounds[3].max(y + reach),
            ];
        }
        Self {
            intensity: rotor.contrast.exp(),
            axis: [rotor.x_px, rotor.y_px],
            tilt: [cos, sin],
            stretch: 1.0 / rotor.tilt_deg.to_radians().cos(),
            peak_rate: spin.peak_rate(span.0, span.1),
            bounds,
            warm_up_s: rotor.period_s(),
            blades,
            spin,
        }
    }

    /// Whether the pixel ever sees this rotor.
    #[must_use]
    pub fn reaches(&self, x: f64, y: f64) -> bool {
        let [left, top, right, bottom] = self.bounds;
        if !(x >= left && x <= right && y >= top && y <= bottom) {
            return false;
        }
        // The bounds' corners lie outside of the swept disc.
        let reach = self.blades.reach() + 0.5;
        let (inner_left, inner_right) = (left + reach, right - reach);
        let (inner_top, inner_bottom) = (top + reach, bottom - reach);
        let dx = x - x.clamp(inner_left, inner_right.max(inner_left));
        let dy = y - y.clamp(inner_top, inner_bottom.max(inner_top));
        dx * dx + dy * dy <= reach * reach
    }

    /// Radius in pixels and angle in radians, in the rotor's own plane, of a place in the room.
    #[must_use]
    pub fn polar(&self, room: [f64; 2], pose: &Pose) -> (f64, f64) {
        let dx = room[0] - self.axis[0] - pose.mount[0];
        let dy = room[1] - self.axis[1] - pose.mount[1];
        let [cos, sin] = self.tilt;
        // Along the tilt axis lengths stay, across it they appear shortened.
        let along = dx * cos + dy * sin;
        let across = (dy * cos - dx * sin) * self.stretch;
        let (u, v) = (along * cos - across * sin, along * sin + across * cos);
        ((u * u + v * v).sqrt(), v.atan2(u))
    }

    /// What covers the pixel more than half at a time hides whatever is below.
    #[must_use]
    pub fn hides(&self, room: [f64; 2], pose: &Pose, t_s: f64) -> bool {
        let (r, angle) = self.polar(room, pose);
        let ring = self.blades.ring(r);
        r < self.blades.reach() && self.blades.look(&ring, angle - self.spin.angle(t_s)).cover > 0.5
    }
}

/// Everything that is in front of the camera.
#[derive(Debug)]
pub struct Field<'a> {
    /// The motion behind the table.
    pub motion: &'a Motion,
    /// Poses over the simulated time.
    pub poses: PoseTable,
    /// Rotors in painter's order.
    pub layers: Vec<Layer>,
    /// Whether the layers are part of the intensity (in the edge model they are not).
    pub renders_layers: bool,
    texture: Option<Texture>,
    light: Option<Light>,
    shades: Vec<Shade>,
    camera_moves: bool,
    rotors_move: bool,
    peak_image_speed: f64,
}

/// One pixel's view of the field.
#[derive(Debug)]
pub struct View {
    x: f64,
    y: f64,
    layers: Vec<(usize, Option<(Ring, f64)>)>,
    lit: bool,
    textured: bool,
    /// Nothing but texture is ever seen here.
    plain: bool,
}

impl View {
    /// Whether a rotor passes this pixel.
    #[must_use]
    pub fn turns(&self) -> bool {
        !self.layers.is_empty()
    }
}

/// The field at a pixel and a time.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Logarithm of intensity.
    pub level: f64,
    /// Seconds until the next look is due.
    pub step_s: f64,
    /// The rotor whose edge is at this pixel now.
    pub rotor: Option<usize>,
}

impl<'a> Field<'a> {
    /// The field of a scene from `from_s` to `to_s`.
    #[must_use]
    pub fn new(
        scene: &Scene,
        motion: &'a Motion,
        from_s: f64,
        to_s: f64,
        renders_layers: bool,
    ) -> Self {
        let layers = scene
            .rotors
            .iter()
            .enumerate()
            .map(|(i, rotor)| Layer::new(rotor, i, scene, motion, (from_s, to_s)))
            .collect();
        Self {
            motion,
            poses: PoseTable::new(motion, from_s, to_s),
            layers,
            renders_layers,
            texture: Texture::new(scene),
            light: scene.lamp.as_ref().map(Light::new),
            shades: scene.movers.iter().map(|m| Shade::new(m, scene)).collect(),
            camera_moves: motion.camera_moves(),
            rotors_move: motion.rotors_move(),
            peak_image_speed: motion.peak_image_speed(),
        }
    }

    /// Seconds of simulation that a pixel needs before recording starts, so that its first visits are like later ones.
    #[must_use]
    pub fn warm_up_s(&self, view: &View) -> f64 {
        let rotors = view.layers.iter().map(|&(i, _)| self.layers[i].warm_up_s);
        let mut warm_up = rotors.fold(0.0, f64::max);
        if view.textured && self.camera_moves && !view.turns() {
            warm_up = 0.1;
        }
        if let Some(light) = self.light.as_ref().filter(|_| view.lit) {
            warm_up = warm_up.max(2.0 * light.period_s());
        }
        warm_up + 1e-3
    }

    /// Whether the rotors' centres move on the sensor.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.rotors_move
    }

    /// The pixel's view, or `None` where nothing ever changes.
    #[must_use]
    pub fn view(&self, x: u16, y: u16, threshold: f64) -> Option<View> {
        let (x, y) = (f64::from(x), f64::from(y));
        let mut layers = Vec::new();
        if self.renders_layers {
            for (i, layer) in self.layers.iter().enumerate().filter(|(_, l)| l.reaches(x, y)) {
                let still = (!self.rotors_move).then(|| {
                    let pose = self.poses.at(0.0);
                    let (r, angle) = layer.polar(self.motion.room(&pose, x, y), &pose);
                    (layer.blades.ring(r), angle)
                });
                layers.push((i, still));
            }
        }
        let lit = self.light.as_ref().is_some_and(|light| light.swing(x, y) > threshold * 0.9);
        let textured = self.texture.is_some();
        let changes =
            !layers.is_empty() || lit || (textured && self.camera_moves) || !self.shades.is_empty();
        let plain = layers.is_empty() && !lit && self.shades.is_empty();
        changes.then_some(View { x, y, layers, lit, textured, plain })
    }

    /// The field at a pixel and a time.
    #[must_use]
    pub fn sample(&self, view: &View, t_s: f64) -> Sample {
        let mut step_s = f64::INFINITY;
        let mut rotor = None;
        let mut intensity = 1.0;
        let mut pose = None;
        let mut room = [view.x, view.y];
        if self.rotors_move {
            let p = self.poses.at(t_s);
            room = self.motion.room(&p, view.x, view.y);
            pose = Some(p);
            step_s = IMAGE_STEP_PX / self.poses.speed(t_s).max(1.0);
        }
        if let Some(texture) = self.texture.as_ref().filter(|_| view.plain) {
            return Sample { level: texture.level(room), step_s, rotor: None };
        }
        if let Some(texture) = &self.texture {
            intensity = texture.intensity(room);
        }
        for shade in &self.shades {
            let (cover, free_px) = shade.look(room, t_s);
            intensity += (shade.intensity() - intensity) * cover;
            let speed = shade.speed() + self.peak_image_speed;
            step_s = step_s.min(free_px.max(STEP_PX) / speed.max(1e-3));
        }
        for (i, still) in &view.layers {
            let layer = &self.layers[*i];
            let (ring, angle) = still.unwrap_or_else(|| {
                let pose = pose.unwrap_or_default();
                let (r, angle) = layer.polar(room, &pose);
                (layer.blades.ring(r), angle)
            });
            let look = layer.blades.look(&ring, angle - layer.spin.angle(t_s));
            if look.cover > 0.0 {
                intensity += (layer.intensity - intensity) * look.cover;
            }
            // Camera motion acts like a rotation of its speed over the radius.
            let rate = layer.peak_rate + self.peak_image_speed * layer.stretch / ring.r;
            step_s = step_s.min(look.free.max(STEP_PX / ring.r) / rate);
            if look.free <= 0.0 {
                rotor = Some(*i);
            }
        }
        let mut level = if intensity == 1.0 { 0.0 } else { intensity.ln() };
        if let Some(light) = self.light.as_ref().filter(|_| view.lit) {
            level += light.level(room, t_s);
            step_s = step_s.min(light.step_s());
        }
        Sample { level, step_s: step_s.max(1e-6), rotor }
    }
}

/// An angle brought to (-pi, pi].
#[must_use]
pub fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

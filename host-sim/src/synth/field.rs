//! The logarithm of intensity at a pixel at any time: what the threshold model looks at.

use std::f64::consts::TAU;

use super::backdrop::{Light, Shade, Texture};
use super::blades::{Blades, Ring};
use super::motion::{Motion, Pose, PoseTable, Spin};
use super::random::{Purpose, stream};
use super::scene::{Rotor, Scene};

/// Largest step in pixels of an edge's motion between two samples.
const STEP_PX: f64 = 0.6;
/// Largest step in pixels of the image's own motion between two samples.
const IMAGE_STEP_PX: f64 = 0.5;
/// Length in seconds of the straight lines that stand for the camera's motion where a rotor is seen; the fastest vibration
/// bends away from them by less than 0.005 pixels.
const LINE_S: f64 = 0.25e-3;

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
    least_rate: f64,
    sense: f64,
    bounds: [f64; 4],
    warm_up_s: f64,
}

impl Layer {
    fn new(rotor: &Rotor, number: usize, scene: &Scene, motion: &Motion, span: (f64, f64)) -> Self {
        let mut places = stream(scene.seed, Purpose::Blades, number as u64);
        let blades = Blades::new(rotor, scene.sensor.blur_px, &mut places);
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
            least_rate: spin.least_rate(span.0, span.1),
            sense: rotor.rpm.signum(),
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
        r < self.blades.reach()
            && self.blades.look(&ring, angle - self.spin.angle(t_s), 0.0).cover > 0.5
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

/// A value that changes in a straight line over a short time.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    value: f64,
    rate: f64,
}

impl Line {
    fn new(from: f64, to: f64, over_s: f64) -> Self {
        Self { value: from, rate: (to - from) / over_s }
    }

    fn at(self, after_s: f64) -> f64 {
        self.value + self.rate * after_s
    }
}

/// A rotor seen by one pixel.
#[derive(Debug)]
struct Seen {
    layer: usize,
    /// Where nothing moves: what holds at the pixel's radius.
    ring: Option<Ring>,
    r: Line,
    angle: Line,
}

/// One pixel's view of the field. What only the camera's motion changes is followed in short straight lines.
#[derive(Debug)]
pub struct View {
    x: f64,
    y: f64,
    layers: Vec<Seen>,
    lit: bool,
    textured: bool,
    /// Nothing but texture is ever seen here.
    plain: bool,
    since_s: f64,
    span_s: f64,
    image_step_s: f64,
    room: [Line; 2],
    intensity: Line,
    depth: Line,
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

    /// Upper bound of the speed of any point of the image because of camera and mount, in pixels per second.
    #[must_use]
    pub fn peak_image_speed(&self) -> f64 {
        self.peak_image_speed
    }

    /// Seconds of simulation that a pixel needs before recording starts, so that its first visits are like later ones.
    #[must_use]
    pub fn warm_up_s(&self, view: &View) -> f64 {
        let rotors = view.layers.iter().map(|seen| self.layers[seen.layer].warm_up_s);
        let mut warm_up = rotors.fold(0.0, f64::max);
        if view.textured && self.camera_moves && !view.turns() {
            warm_up = 0.1;
        }
        if let Some(light) = self.light.as_ref().filter(|_| view.lit) {
            warm_up = warm_up.max(2.0 * light.period_s());
        }
        warm_up
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
            let reaching = self.layers.iter().enumerate().filter(|(_, l)| l.reaches(x, y));
            layers.extend(reaching.map(|(layer, _)| Seen {
                layer,
                ring: None,
                r: Line::default(),
                angle: Line::default(),
            }));
        }
        // On a rotor even a light too faint for events of its own moves the edges' events.
        let least = if layers.is_empty() { threshold * 0.9 } else { 0.01 };
        let lit = self.light.as_ref().is_some_and(|light| light.swing([x, y]) > least);
        let textured = self.texture.is_some();
        let shaded = !self.shades.is_empty();
        let moves = textured && self.camera_moves;
        if layers.is_empty() && !lit && !moves && !shaded {
            return None;
        }
        let plain = layers.is_empty() && !lit && !shaded;
        let mut view = View {
            x,
            y,
            layers,
            lit,
            textured,
            plain,
            since_s: f64::NEG_INFINITY,
            span_s: 0.0,
            image_step_s: f64::INFINITY,
            room: [Line { value: x, rate: 0.0 }, Line { value: y, rate: 0.0 }],
            intensity: Line { value: 1.0, rate: 0.0 },
            depth: Line::default(),
        };
        if !self.rotors_move || (view.layers.is_empty() && !self.camera_moves) {
            self.hold(&mut view);
        }
        Some(view)
    }

    /// Fills in what stays as it is where nothing moves.
    fn hold(&self, view: &mut View) {
        let pose = self.poses.at(0.0);
        let room = self.motion.room(&pose, view.x, view.y);
        let still = |value: f64| Line { value, rate: 0.0 };
        view.room = room.map(still);
        view.intensity = still(self.texture.as_ref().map_or(1.0, |t| t.intensity(room)));
        view.depth = still(self.light.as_ref().map_or(0.0, |l| l.depth(room)));
        for seen in &mut view.layers {
            let layer = &self.layers[seen.layer];
            let (r, angle) = layer.polar(room, &pose);
            (seen.r, seen.angle) = (still(r), still(angle));
            seen.ring = Some(layer.blades.ring(r));
        }
        view.since_s = 0.0;
        view.span_s = f64::INFINITY;
    }

    /// Lays new lines from a time on.
    fn follow(&self, view: &mut View, t_s: f64) {
        view.image_step_s = IMAGE_STEP_PX / self.poses.speed(t_s).max(1.0);
        view.since_s = t_s;
        view.span_s = if view.turns() { LINE_S } else { view.image_step_s };
        let over_s = view.span_s;
        let (from, to) = (self.poses.at(t_s), self.poses.at(t_s + over_s));
        let (a, b) =
            (self.motion.room(&from, view.x, view.y), self.motion.room(&to, view.x, view.y));
        view.room = [Line::new(a[0], b[0], over_s), Line::new(a[1], b[1], over_s)];
        if let Some(texture) = &self.texture {
            view.intensity = Line::new(texture.intensity(a), texture.intensity(b), over_s);
        }
        if let Some(light) = self.light.as_ref().filter(|_| view.lit) {
            view.depth = Line::new(light.depth(a), light.depth(b), over_s);
        }
        for seen in &mut view.layers {
            let layer = &self.layers[seen.layer];
            let ((r0, angle0), (r1, angle1)) = (layer.polar(a, &from), layer.polar(b, &to));
            seen.r = Line::new(r0, r1, over_s);
            seen.angle = Line::new(angle0, angle0 + wrapped(angle1 - angle0), over_s);
        }
    }

    /// The field at a pixel and a time.
    #[must_use]
    pub fn sample(&self, view: &mut View, t_s: f64) -> Sample {
        if let Some(texture) = self.texture.as_ref().filter(|_| view.plain) {
            let room = self.motion.room(&self.poses.at(t_s), view.x, view.y);
            let step_s = IMAGE_STEP_PX / self.poses.speed(t_s).max(1.0);
            return Sample { level: texture.level(room), step_s, rotor: None };
        }
        let mut after_s = t_s - view.since_s;
        // A look back by less than a span, to place an event, is still on the same lines.
        if after_s.abs() > view.span_s {
            self.follow(view, t_s);
            after_s = 0.0;
        }
        let mut step_s = view.image_step_s;
        let mut rotor = None;
        let mut intensity = view.intensity.at(after_s);
        for shade in &self.shades {
            let room = view.room.map(|line| line.at(after_s));
            let (cover, free_px) = shade.look(room, t_s);
            intensity += (shade.intensity() - intensity) * cover;
            let speed = shade.speed() + self.peak_image_speed;
            step_s = step_s.min(free_px.max(STEP_PX) / speed.max(1e-3));
        }
        for seen in &view.layers {
            let layer = &self.layers[seen.layer];
            let ring = seen.ring.unwrap_or_else(|| layer.blades.ring(seen.r.at(after_s)));
            let angle = seen.angle.at(after_s) - layer.spin.angle(t_s);
            // Camera motion acts like a rotation of its speed over the radius.
            let shake_rate = self.peak_image_speed * layer.stretch / ring.r;
            let sense = if layer.least_rate > shake_rate { layer.sense } else { 0.0 };
            let look = layer.blades.look(&ring, angle, sense);
            if look.cover > 0.0 {
                intensity += (layer.intensity - intensity) * look.cover;
            }
            let rate = layer.peak_rate + shake_rate;
            step_s = step_s.min(look.free.max(STEP_PX / ring.r) / rate);
            if look.free <= 0.0 {
                rotor = Some(seen.layer);
            }
        }
        if let Some(light) = self.light.as_ref().filter(|_| view.lit) {
            intensity *= light.factor(view.depth.at(after_s), t_s);
            step_s = step_s.min(light.step_s());
        }
        let level = if intensity == 1.0 { 0.0 } else { intensity.max(1e-6).ln() };
        Sample { level, step_s: step_s.max(1e-6), rotor }
    }
}

/// An angle brought to (-pi, pi].
#[must_use]
pub fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

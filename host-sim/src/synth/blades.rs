//! The outline of a rotor in polar coordinates: one description for both event models.

use std::f64::consts::{PI, TAU};

use rand_pcg::Pcg64Mcg;

use super::random::normal;
use super::scene::{Rotor, Shape};

/// Width of the blurred transition in units of the blur's standard deviation: that of a smoothstep.
const TRANSITION_PER_SIGMA: f64 = 4.472;

/// A rotor's outline.
#[derive(Clone, Debug)]
pub struct Blades {
    shape: Shape,
    blades: f64,
    pitch: f64,
    odd_width: f64,
    /// Angle in radians by which each blade is off its even place.
    places: Vec<f64>,
    /// Whether each blade is like any other.
    alike: bool,
    radius: f64,
    hub: f64,
    transition: f64,
}

/// What holds at one radius, whatever the angle.
#[derive(Clone, Copy, Debug)]
pub struct Ring {
    /// Radius in pixels.
    pub r: f64,
    /// Half the angle a blade covers, in radians; `None`: no blade at this radius.
    half: Option<f64>,
    /// Angle by which the blade's middle line lags at this radius, in radians.
    bend: f64,
    /// Pixels across the edge per radian of rotation.
    lever: f64,
    /// Share of the tip's blurred rim.
    tip: f64,
    /// Share of the hub's blurred rim.
    hub: f64,
}

/// What a pixel sees of a rotor at one angle.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Share of the pixel covered by the rotor, 0 to 1.
    pub cover: f64,
    /// Angle in radians by which the rotor may turn before this share changes; not positive: it changes now.
    pub free: f64,
}

/// Blurred step: 0 below -1/2, 1 above 1/2.
fn step(x: f64) -> f64 {
    let u = (x + 0.5).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Nearest whole number; f64::round is a function call on the oldest x86-64.
fn rounded(x: f64) -> f64 {
    (x + 0.5f64.copysign(x)) as i64 as f64
}

impl Blades {
    /// The outline of a rotor seen with a blur of `blur_px` (one standard deviation). Where its blades sit is drawn from `rng`.
    #[must_use]
    pub fn new(rotor: &Rotor, blur_px: f64, rng: &mut Pcg64Mcg) -> Self {
        let blades = f64::from(rotor.blades);
        let spread = rotor.blade_spread_mrad * 1e-3;
        Self {
            shape: rotor.shape,
            blades,
            pitch: TAU / blades,
            odd_width: rotor.odd_width,
            places: (0..rotor.blades).map(|_| spread * normal(rng)).collect(),
            alike: rotor.odd_width == 1.0 && spread == 0.0,
            radius: rotor.radius_px,
            hub: rotor.hub_radius_px(),
            transition: TRANSITION_PER_SIGMA * blur_px,
        }
    }

    /// Radius beyond which the rotor is invisible, in pixels.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.radius + self.transition / 2.0
    }

    fn mark(&self) -> (f64, f64) {
        (self.radius * 0.75, self.radius * 0.15 * (4.0 / self.blades).min(1.0))
    }

    /// What holds at a radius.
    #[must_use]
    pub fn ring(&self, r: f64) -> Ring {
        let r = r.max(0.25);
        let tip = step((self.radius - r) / self.transition);
        let hub = step((self.hub - r) / self.transition);
        let mut ring = Ring { r, half: None, bend: 0.0, lever: r, tip, hub };
        // Half the width, in pixels; thinner where there are many blades.
        let bar = |share: f64, enough: f64| self.radius * share * (enough / self.blades).min(1.0);
        let half = match self.shape {
            Shape::Straight => bar(0.12, 4.0) / r,
            Shape::Tapered => bar(0.22, 3.0) * (1.0 - 0.55 * r / self.radius) / r,
            Shape::Spokes => (self.radius * 0.02).max(0.6) / r,
            Shape::Swept => {
                let s = r / self.radius;
                ring.bend = -0.6 * s * s;
                let slope = 1.2 * s * s;
                ring.lever = r / (1.0 + slope * slope).sqrt();
                (0.45 * PI / self.blades).min(0.6)
            }
            Shape::Dot => {
                let (m, d) = self.mark();
                ring.tip = 1.0;
                ring.hub = 0.0;
                ring.lever = m;
                let c = (r * r + m * m - d * d) / (2.0 * r * m);
                if (r - m).abs() < d + self.transition / 2.0 {
                    // Rings that only graze the mark's blurred rim have no edge, but they do see the mark.
                    ring.half = Some(if (r - m).abs() < d { c.acos() } else { 0.0 });
                }
                return ring;
            }
        };
        if ring.tip > 0.0 {
            ring.half = Some(half.min(0.7 * PI / self.blades));
        }
        ring
    }

    /// What is seen at an angle relative to the first blade. `sense` is the sign of the rotor's speed, or 0 where the
    /// camera may outrun it: then an edge may come from either side.
    #[must_use]
    pub fn look(&self, ring: &Ring, angle: f64, sense: f64) -> Look {
        let never = Look { cover: ring.hub, free: f64::INFINITY };
        let Some(half) = ring.half else { return never };
        if ring.hub >= 1.0 {
            return never;
        }
        let place = (angle - ring.bend) / self.pitch;
        let nearest = rounded(place);
        let (width, at) = self.blade(nearest);
        let off = (place - nearest) * self.pitch - at;
        // The neighbour on that side: its width, and how far away its middle is.
        let neighbour = || {
            let side = off.signum();
            let (width, beside) = self.blade(nearest + side);
            (width, self.pitch - off.abs() + side * (beside - at))
        };
        let (mut cover, mut free) = self.seen(ring, half * width, width, off.abs());
        // The pixel moves against the rotor: `ahead` shrinks until the blade's middle passes.
        let ahead = off * sense;
        if sense != 0.0 && free > 0.0 && self.shape != Shape::Dot && off.abs() < half * width {
            // On the blade: the next edge is the trailing one.
            free = ahead + half * width - 0.5 * self.transition / ring.lever;
        } else if free > 0.0 && ahead <= 0.0 {
            // Leaving this blade, or not known: the next one counts.
            let (width, away) = neighbour();
            let (_, free_next) = self.seen(ring, half * width, width, away);
            free = if sense == 0.0 { free.min(free_next) } else { free_next };
        }
        let margin = 0.5 * self.transition / ring.lever;
        if self.pitch - off.abs() < half * width + margin {
            // So near the hub that the neighbour's blur is seen as well.
            let (width, away) = neighbour();
            cover = (cover + self.seen(ring, half * width, width, away).0).min(1.0);
        }
        cover *= ring.tip;
        Look { cover: ring.hub + (1.0 - ring.hub) * cover, free }
    }

    /// Cover by one blade whose middle is `off` radians away, and how far it may turn unseen.
    fn seen(&self, ring: &Ring, half: f64, width: f64, off: f64) -> (f64, f64) {
        if self.shape == Shape::Dot {
            let (m, d) = self.mark();
            let d = d * width;
            let distance = (ring.r * ring.r + m * m - 2.0 * ring.r * m * off.cos()).max(0.0).sqrt();
            let cover = step((d - distance) / self.transition);
            return (cover, ((distance - d).abs() - self.transition / 2.0) / m);
        }
        let scale = ring.lever / self.transition;
        let cover = step((half - off) * scale) + step((half + off) * scale) - 1.0;
        (cover, (half - off).abs() - 0.5 / scale)
    }

    /// Width of a blade relative to the others, and the angle in radians by which it is off its even place.
    fn blade(&self, number: f64) -> (f64, f64) {
        if self.alike {
            return (1.0, 0.0);
        }
        let number = number.rem_euclid(self.blades) as usize;
        (if number == 0 { self.odd_width } else { 1.0 }, self.places[number])
    }

    /// Angle of edge number `i` (even: leading) on a ring, or `None` where the blade does not reach.
    #[must_use]
    pub fn edge(&self, ring: &Ring, i: u32) -> Option<f64> {
        let (width, off) = self.blade(f64::from(i / 2));
        let half = if self.shape == Shape::Dot {
            let (m, d) = self.mark();
            let d = d * width;
            let c = (ring.r * ring.r + m * m - d * d) / (2.0 * ring.r * m);
            ((ring.r - m).abs() < d).then(|| c.acos())?
        } else {
            let seen = ring.r > self.hub && ring.r < self.radius;
            ring.half.filter(|_| seen)? * width
        };
        let middle = f64::from(i / 2) * self.pitch + off + ring.bend;
        Some(if i.is_multiple_of(2) { middle + half } else { middle - half })
    }

    /// Distance in pixels from a radius to where the blades are; 0 within.
    #[must_use]
    pub fn gap(&self, r: f64) -> f64 {
        let (inner, outer) = match self.shape {
            Shape::Dot => (self.mark().0 - self.mark().1, self.mark().0 + self.mark().1),
            _ => (self.hub, self.radius),
        };
        (inner - r).max(r - outer).max(0.0)
    }

    /// Number of edges of all blades.
    #[must_use]
    pub fn edge_count(&self) -> u32 {
        self.blades as u32 * 2
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::{Purpose, stream};
    use super::*;

    #[test]
    fn a_blade_covers_half_of_what_its_edge_is_on_wherever_it_sits() {
        for shape in [Shape::Straight, Shape::Tapered, Shape::Swept, Shape::Dot] {
            let rotor = Rotor { blades: 5, shape, odd_width: 0.7, ..Rotor::default() };
            let loose = Rotor { blade_spread_mrad: 20.0, ..rotor.clone() };
            let made = |rotor| Blades::new(rotor, 0.7, &mut stream(3, Purpose::Blades, 0));
            let (even, loose) = (made(&rotor), made(&loose));
            let ring = loose.ring(0.75 * rotor.radius_px);
            let mut moved = 0;
            for i in 0..loose.edge_count() {
                let (at, was) = (loose.edge(&ring, i).unwrap_or(0.0), even.edge(&ring, i));
                let look = loose.look(&ring, at, 1.0);
                assert!((look.cover - 0.5).abs() < 0.01, "{shape:?} {i}: {look:?}");
                assert!(look.free <= 0.0, "{shape:?} {i}: {look:?}");
                moved += u32::from((at - was.unwrap_or(0.0)).abs() > 1e-3);
            }
            assert!(moved > 7, "{shape:?}: {moved}");
        }
    }
}

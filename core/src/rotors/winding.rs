//! Phase winding: the rotation that explains a coherence map.
//!
//! Under a rotor with speed w, the phase of a cell at the frequency f = m w / 2 pi is m times the cell's direction
//! as seen from the centre (plus a constant for each radius and polarity): going around the centre
//! once, the phase winds m times. The number of windings tells the speed from its multiples, its sign the
//! direction, and its centre is the axis, even where the light makes one side of the rotor brighter or part of it
//! lies outside the frame, so that the centroid is off. A flickering lamp winds zero times, a shaken
//! texture winds nowhere.

use heapless::Vec;

use super::coherence::Phasor;
use super::disc::Disc;
use crate::limits::WINDING_PHASORS;
use crate::math::{larger, sqrt};
use crate::thinning::Thinning;

/// Most windings that are tried: a wheel's spokes, or 8 blades seen at the second overtone.
const MOST_WINDINGS: usize = 20;
/// Most rings between centre and rim, each with a phase of its own (swept blades), for each polarity.
const RINGS: usize = 4;
const BANKS: usize = 2 * RINGS;
/// Phasors that make it worth to tell one more ring apart.
const PHASORS_A_RING: usize = 16;
/// Most that the phase may turn within a cell, in radians: more windings are not told apart.
const MOST_IN_CELL_RAD: f32 = 2.2;
/// Phasors that a winding takes to be seen: fewer on a circle fit any number of them.
const PHASORS_A_WINDING: usize = 3;
/// Power that the axes and windings that are tried reach by chance, in standard deviations: one in thirty thousand.
const CHANCE_SIGMAS: f32 = 4.0;
/// First search: this many steps to each side.
const COARSE_STEPS: i32 = 3;
/// Spacing of the first search, as a share of the radius.
const COARSE_SPACING: f32 = 0.2;
/// Halvings of the spacing afterwards.
const HALVINGS: u8 = 3;
/// A rotor's rim holds this share of what its rotation explains.
const RIM_SHARE: f32 = 0.95;
/// It lies within so many radii of the disc that was looked at.
const MOST_RIM: f32 = 2.0;
/// Steps in which it is looked for.
const RIM_STEPS: usize = 128;

/// Phasors of one region, evenly thinned.
type Region = Vec<Phasor, WINDING_PHASORS>;

/// A rotation that explains a region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Winding {
    /// Axis of rotation in pixels.
    pub x_px: f32,
    /// Axis of rotation in pixels.
    pub y_px: f32,
    /// Windings of the phase around the axis: positive = clockwise on the screen, 0 = all in step.
    pub windings: i32,
    /// Share of the region's phasors that the rotation explains, 0 to 1.
    pub share: f32,
    /// The same share for zero windings about the same centre: all cells in step, as under a lamp.
    pub share_in_step: f32,
    /// Power over the highest that unrelated phasors would reach in a search like this: above 1 where there is a rotation.
    pub over_chance: f32,
}

/// Collects the phasors for which `inside` holds, without what chance adds, evenly thinned to the capacity; returns their number before
/// that too.
fn collect(
    phasors: impl Iterator<Item = Phasor> + Clone,
    inside: impl Fn(&Phasor) -> bool,
) -> (Region, usize) {
    let mut region = Region::new();
    let total = phasors.clone().filter(&inside).count();
    let mut thinning = Thinning::new(WINDING_PHASORS, total);
    for phasor in phasors.filter(&inside).filter(|_| thinning.keeps_next()) {
        region.push(phasor.without_chance()).ok();
    }
    (region, total)
}

/// The search for the axis and winding number that explain a region best, a centre a step.
///
/// Centres lie on a square of 0.6 radius to each side of the disc's centre, then on ever smaller ones around the best.
#[derive(Debug, Default)]
pub struct Explainer {
    region: Region,
    /// Phasors before thinning.
    total: usize,
    disc: Disc,
    /// Side of the cells that the phasors come from; `None`: they are single events.
    cell_px: Option<f32>,
    /// Most windings that the cells let tell apart.
    most: usize,
    from: (f32, f32),
    spacing_px: f32,
    halvings: u8,
    row: i32,
    column: i32,
    best: Winding,
}

impl Explainer {
    /// Starts over with the phasors for which `inside` holds, of cells of `cell_px`.
    pub fn start(
        &mut self,
        phasors: impl Iterator<Item = Phasor> + Clone,
        inside: impl Fn(&Phasor) -> bool,
        disc: Disc,
        cell_px: f32,
    ) {
        (self.region, self.total) = collect(phasors, inside);
        self.cell_px = Some(cell_px);
        let told_apart = (MOST_IN_CELL_RAD * disc.radius_px / cell_px) as usize;
        self.most = told_apart.min(self.region.len() / PHASORS_A_WINDING).min(MOST_WINDINGS);
        self.begin(disc);
    }

    /// Starts over with single events as phasors, to be [added](Self::add): where there are too few for a phase in each cell.
    pub fn start_events(&mut self, disc: Disc) {
        self.region.clear();
        self.cell_px = None;
        self.most = MOST_WINDINGS;
        self.begin(disc);
    }

    /// Adds an event, while there is room.
    pub fn add(&mut self, event: Phasor) {
        self.region.push(event.without_chance()).ok();
    }

    /// All events were added, out of so many before thinning.
    pub const fn collected(&mut self, total: usize) {
        self.total = total;
    }

    fn begin(&mut self, disc: Disc) {
        self.disc = disc;
        self.from = (disc.x_px, disc.y_px);
        self.spacing_px = COARSE_SPACING * disc.radius_px;
        self.halvings = 0;
        (self.row, self.column) = (-COARSE_STEPS, -COARSE_STEPS);
        self.best = Winding::default();
    }

    /// Tries a centre; `true` once the best is found. Cost: about 850 instructions a phasor.
    pub fn step(&mut self) -> bool {
        let steps = if self.halvings == 0 { COARSE_STEPS } else { 1 };
        let x_px = self.from.0 + self.column as f32 * self.spacing_px;
        let y_px = self.from.1 + self.row as f32 * self.spacing_px;
        let found = about(&self.region, x_px, y_px, self.disc.radius_px, self.most);
        if found.share > self.best.share {
            self.best = found;
        }
        self.column += 1;
        if self.column <= steps {
            return false;
        }
        self.column = -steps;
        self.row += 1;
        if self.row > steps {
            self.halvings += 1;
            self.spacing_px *= 0.5;
            self.from = (self.best.x_px, self.best.y_px);
            (self.row, self.column) = (-1, -1);
        }
        self.halvings > HALVINGS
    }

    /// Side of the cells that the phasors come from; `None` where they are single events.
    #[must_use]
    pub const fn cell_px(&self) -> Option<f32> {
        self.cell_px
    }

    /// Distance from the axis within which 95 % of the events lie that the rotation explains, in pixels. Not of all in step: a
    /// background that does so for a few periods lies all around.
    #[must_use]
    pub fn rim_px(&self) -> f32 {
        let Winding { x_px, y_px, windings, .. } = self.best;
        let rings = rings(&self.region);
        let mut sums = [(0.0_f32, 0.0_f32, 0.0_f32); BANKS];
        for phasor in &self.region {
            if let Some(seen) = Around::new(phasor, (x_px, y_px), self.disc.radius_px, rings) {
                let (re, im) = seen.turned(windings);
                sums[seen.bank].0 += re;
                sums[seen.bank].1 += im;
                sums[seen.bank].2 += phasor.amplitude * phasor.amplitude;
            }
        }
        let mut explained = [0.0_f32; RIM_STEPS];
        let steps_per_px = RIM_STEPS as f32 / (MOST_RIM * self.disc.radius_px.max(1.0));
        for phasor in &self.region {
            let Some(seen) = Around::new(phasor, (x_px, y_px), self.disc.radius_px, rings) else {
                continue;
            };
            let ((re, im), (sum_re, sum_im, squares)) = (seen.turned(windings), sums[seen.bank]);
            let power = sum_re * sum_re + sum_im * sum_im;
            // As in `about`, a bank no more in step than chance explains nothing.
            if power <= squares {
                continue;
            }
            // By what the others of the bank say: it agrees with itself whatever it is.
            let agrees = re * sum_re + im * sum_im - phasor.amplitude * phasor.amplitude;
            let step = ((seen.r_px * steps_per_px) as usize).min(RIM_STEPS - 1);
            explained[step] += agrees / sqrt(power);
        }
        let wanted = RIM_SHARE * explained.iter().sum::<f32>();
        let mut within = 0.0;
        for (step, more) in explained.iter().enumerate() {
            if within + more >= wanted {
                let way = (wanted - within) / larger(*more, f32::MIN_POSITIVE);
                return (step as f32 + way) / steps_per_px;
            }
            within += more;
        }
        RIM_STEPS as f32 / steps_per_px
    }

    /// The phasors, their number before thinning, the disc they come from, and what explains them best.
    #[must_use]
    pub fn result(&self) -> (&[Phasor], usize, Disc, Winding) {
        (&self.region, self.total, self.disc, self.best)
    }
}

/// Rings that so many phasors let tell apart.
fn rings(region: &[Phasor]) -> usize {
    (region.len() / PHASORS_A_RING).clamp(1, RINGS)
}

/// A phasor as seen from an axis.
struct Around {
    r_px: f32,
    /// Cosine and sine of its direction.
    direction: (f32, f32),
    /// Ring and polarity.
    bank: usize,
    re: f32,
    im: f32,
}

impl Around {
    fn new(
        phasor: &Phasor,
        (x_px, y_px): (f32, f32),
        radius_px: f32,
        rings: usize,
    ) -> Option<Self> {
        let (dx, dy) = (phasor.x_px - x_px, phasor.y_px - y_px);
        let r_px = sqrt(dx * dx + dy * dy);
        if r_px < 1.0 {
            return None;
        }
        let ring = ((r_px / larger(radius_px, 1.0) * rings as f32) as usize).min(rings - 1);
        Some(Self {
            r_px,
            direction: (dx / r_px, dy / r_px),
            bank: 2 * ring + usize::from(phasor.on),
            re: phasor.re,
            im: phasor.im,
        })
    }

    /// The phase with so many windings taken out.
    fn turned(&self, windings: i32) -> (f32, f32) {
        let (cos, sin) =
            (self.direction.0, if windings < 0 { -self.direction.1 } else { self.direction.1 });
        let rotate = |(c, s): (f32, f32), _| (c * cos - s * sin, s * cos + c * sin);
        let (c, s) = (0..windings.unsigned_abs()).fold((1.0, 0.0), rotate);
        (self.re * c - self.im * s, self.re * s + self.im * c)
    }
}

/// The winding number of at most `most` that explains the region best about a given axis.
fn about(region: &[Phasor], x_px: f32, y_px: f32, radius_px: f32, most: usize) -> Winding {
    const TERMS: usize = 2 * MOST_WINDINGS + 1;
    let mut sums = [[(0.0_f32, 0.0_f32); TERMS]; BANKS];
    let mut weights = [(0.0_f32, 0.0_f32); BANKS];
    let rings = rings(region);
    for phasor in region {
        let Some(seen) = Around::new(phasor, (x_px, y_px), radius_px, rings) else { continue };
        let Around { direction: (cos, sin), bank, re, im, .. } = seen;
        weights[bank].0 += phasor.amplitude;
        weights[bank].1 += phasor.amplitude * phasor.amplitude;
        let (mut c, mut s) = (1.0_f32, 0.0_f32);
        for m in 0..=most {
            // z e^{i m theta} and z e^{-i m theta}
            let (rc, is, rs, ic) = (re * c, im * s, re * s, im * c);
            let plus = &mut sums[bank][MOST_WINDINGS + m];
            plus.0 += rc - is;
            plus.1 += rs + ic;
            if m > 0 {
                let minus = &mut sums[bank][MOST_WINDINGS - m];
                minus.0 += rc + is;
                minus.1 += ic - rs;
            }
            (c, s) = (c * cos - s * sin, s * cos + c * sin);
        }
    }
    // Without each phasor's square, so that a bank of one phasor explains nothing.
    let possible: f32 = weights.iter().map(|(sum, sum2)| sqrt(larger(sum * sum - sum2, 0.0))).sum();
    let mut found = Winding { x_px, y_px, ..Winding::default() };
    let mut best = MOST_WINDINGS;
    for term in MOST_WINDINGS - most..=MOST_WINDINGS + most {
        let aligned: f32 = sums
            .iter()
            .zip(&weights)
            .map(|(bank, (_, squares))| {
                let (re, im) = bank[term];
                sqrt(larger(re * re + im * im - squares, 0.0))
            })
            .sum();
        let share = aligned / possible.max(1.0);
        if share > found.share {
            found.share = share;
            found.windings = term as i32 - MOST_WINDINGS as i32;
            best = term;
        }
        if term == MOST_WINDINGS {
            found.share_in_step = share;
        }
    }
    let (mut power, mut banks) = (0.0, 0.0);
    for (sums, (_, squares)) in sums.iter().zip(&weights).filter(|(_, (_, squares))| *squares > 0.0)
    {
        let (re, im) = sums[best];
        power += (re * re + im * im) / squares;
        banks += 1.0;
    }
    found.over_chance = power / highest_by_chance(banks);
    found
}

/// What a sum of `banks` powers of unrelated phasors, 1 on average each, reaches in a search (Wilson and Hilferty).
fn highest_by_chance(banks: f32) -> f32 {
    let banks = banks.max(1.0);
    let root = 1.0 - 1.0 / (9.0 * banks) + CHANCE_SIGMAS / (3.0 * sqrt(banks));
    banks * root * root * root
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Phasors of a rotor about (100, 80), as cells of 8 px see it.
    fn rotor(windings: i32, radius_px: f32) -> Vec<Phasor> {
        let mut phasors = Vec::new();
        for row in 0..30 {
            for column in 0..30 {
                let (x_px, y_px) = (column as f32 * 8.0, row as f32 * 8.0);
                let (dx, dy) = (x_px - 100.0, y_px - 80.0);
                if dx * dx + dy * dy < radius_px * radius_px {
                    let phase = -windings as f32 * libm::atan2f(dy, dx) + 0.7;
                    let (re, im) = (10.0 * libm::cosf(phase), 10.0 * libm::sinf(phase));
                    phasors.push(Phasor { x_px, y_px, re, im, amplitude: 10.0, on: true });
                }
            }
        }
        phasors
    }

    fn explained(phasors: &[Phasor], disc: Disc) -> Explainer {
        let mut explainer = Explainer::default();
        explainer.start(phasors.iter().copied(), |_| true, disc, 8.0);
        while !explainer.step() {}
        explainer
    }

    fn explain(phasors: &[Phasor], disc: Disc) -> Winding {
        explained(phasors, disc).result().3
    }

    #[test]
    fn the_windings_tell_speed_sense_and_axis_from_an_off_centre_start() {
        let start = Disc { x_px: 118.0, y_px: 70.0, radius_px: 60.0 };
        for windings in [-5, -2, -1, 1, 3, 4, 8] {
            let found = explain(&rotor(windings, 60.0), start);
            assert_eq!(found.windings, windings);
            assert!(found.share > 0.9, "{found:?}");
            assert!(
                (found.x_px - 100.0).abs() < 5.0 && (found.y_px - 80.0).abs() < 5.0,
                "{found:?}"
            );
        }
    }

    #[test]
    fn the_rim_is_where_the_rotation_ends() {
        let rotor = rotor(3, 60.0);
        let unrelated = (0..80).map(|i| {
            // Around it, as strong as under it, each with a phase of its own.
            let (turn, phase) = (0.3 * i as f32, 2.4 * (i * i % 79) as f32);
            let r_px = 70.0 + 60.0 * (i % 8) as f32 / 8.0;
            Phasor {
                x_px: 100.0 + r_px * libm::cosf(turn),
                y_px: 80.0 + r_px * libm::sinf(turn),
                re: 10.0 * libm::cosf(phase),
                im: 10.0 * libm::sinf(phase),
                amplitude: 10.0,
                on: true,
            }
        });
        // In a ring of their own, and cancelling all but a little.
        let opposite = [(195.0, 10.0), (5.0, 9.99)].map(|(x_px, amplitude)| Phasor {
            x_px,
            y_px: 80.0,
            re: amplitude,
            im: 0.0,
            amplitude,
            on: false,
        });
        let seen: Vec<Phasor> = rotor.iter().copied().chain(unrelated).collect();
        let cancelled: Vec<Phasor> = rotor.iter().copied().chain(opposite).collect();
        for phasors in [rotor, seen, cancelled] {
            let disc = Disc { x_px: 104.0, y_px: 78.0, radius_px: 100.0 };
            let explainer = explained(&phasors, disc);
            assert_eq!(explainer.result().3.windings, 3);
            assert!((explainer.rim_px() - 58.0).abs() < 4.0, "{}", explainer.rim_px());
        }
    }

    #[test]
    fn few_phasors_show_few_windings() {
        let many = rotor(16, 60.0);
        let few: Vec<_> = many.iter().step_by(many.len() / 24).copied().collect();
        let disc = Disc { x_px: 100.0, y_px: 80.0, radius_px: 60.0 };
        assert!(explain(&few, disc).windings.unsigned_abs() as usize <= few.len() / 3);
    }

    #[test]
    fn a_lamp_winds_zero_times() {
        let start = Disc { x_px: 100.0, y_px: 80.0, radius_px: 60.0 };
        assert_eq!(explain(&rotor(0, 60.0), start).windings, 0);
    }
}

//! What a round sees in a segment of the window.

use heapless::Vec;

use super::super::path::Moving;
use super::blocks::{self, Seen};
use super::schedule::Phase;
use super::template::{BANKS, rings};
use super::{Pose, Sums, sides};
use crate::math::{Turn, TurnRate, quick_sqrt};
use crate::store::Window;

impl Pose {
    /// Looks at the events of a segment: how far the blocks are off the template, and the templates of this harmonic
    /// and of twice it. Early rounds look at some events only.
    pub(super) fn look(&self, window: &Window<'_>, sums: &mut Sums) {
        let one_of = self.events.div_ceil(self.schedule.events(self.events)).max(1);
        // A sample of events has to do at first, and where the store has thinned them; else one of pixels, each with all its
        // events, so that what is fixed to them cancels from period to period.
        let by_event = self.schedule.samples() || self.even_share < 1.0;
        let (stride, one_of) = if by_event { (one_of, 1) } else { (1, one_of) };
        let mut disc = Moving::new(self.disc, &self.path, window);
        let rate = TurnRate::from_rad_s(self.omega_rad_s);
        let rings = rings(self.sectors);
        let rings_per_px = rings as f32 / self.disc.radius_px.max(1.0);
        // Nothing is learnt in the last round.
        let last = self.schedule.phase() == Phase::Last;
        let doubles = self.may_double() && !last;
        let halves_us = if last { self.halves_us() as u32 } else { 0 };
        // A sample of the events tells the tilt well enough.
        let tilts = self.tilt.is_some() && self.schedule.samples();
        let always_on = usize::from(window.ignores_polarity);
        let asks_sides = self.schedule.asks_sides();
        let sided = asks_sides || self.inverted.any();
        let cells_per_px = sides::cells_per_px(self.disc.radius_px);
        let mut seen = Vec::new();
        for event in window.segment(self.segment).iter().step_by(stride) {
            if one_of > 1 && !event.is_of(one_of as u32) {
                continue;
            }
            let t_us = disc.since_middle_us(*event);
            let (index, f, knot) = disc.follow(t_us);
            let Some(place) = disc.place_by(*event, knot) else { continue };
            let (x_px, y_px, r2) = self.tilt.map_or(place, |tilt| tilt.undone(place));
            let turn = Turn::from_rad(knot.turn_rad).plus(rate.after(t_us));
            let angle = Turn::of_vector(y_px, x_px).minus(turn);
            let (s, c) = angle.times(self.harmonic).sin_cos();
            let ring = ((quick_sqrt(r2) * rings_per_px) as usize).min(rings - 1);
            let sector = angle.sector(self.sectors) as usize;
            let (mut cell, mut is_on) = (0, event.is_on());
            if sided {
                cell = sides::cell(x_px * cells_per_px, y_px * cells_per_px);
                is_on = self.inverted.is_on(cell, is_on);
            }
            let polarity = usize::from(is_on) | always_on;
            let bank = (2 * (sector * rings + ring) + polarity).min(BANKS - 1);
            sums.counts[bank] += 1;
            sums.low.add(bank, (s, c));
            if doubles {
                sums.high.add(bank, (2.0 * s * c, c * c - s * s));
            }
            if t_us.unsigned_abs() < halves_us {
                sums.growth.add(t_us >= 0, r2);
            }
            let Some(phases) = &self.phases else { continue };
            let (re, im, weight) = phases[bank];
            let off = (s * re - c * im, c * re + s * im);
            if asks_sides {
                let (other_re, other_im, _) = phases[bank ^ 1];
                sums.sides.add(cell, off.1, c * other_re + s * other_im);
            }
            let per_r2 = 1.0 / r2;
            let (x, y) = (-y_px * per_r2, x_px * per_r2);
            let (sin_psi, cos_psi) = off;
            if tilts {
                sums.tilt.add((x_px, y_px), per_r2, sin_psi);
            }
            seen.push(Seen { block: index, x, y, sin_psi, cos_psi, f, weight }).ok();
            if seen.is_full() {
                blocks::add(&mut sums.blocks, &mut seen);
            }
        }
        blocks::add(&mut sums.blocks, &mut seen);
    }
}

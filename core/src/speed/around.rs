//! What keeps step in each direction about a centre: whether a pattern is seen all around, and how often it winds.

use super::phase::{Pattern, ahead, direction};
use super::polar::PolarEvent;
use crate::math::{Turn, TurnRate, sqrt};
use crate::rotors::Disc;
use crate::settings::Roi;

/// Parts of the circle: the phases of eight blades that are tilted by 60 degrees differ by less than half a turn from one to the next.
const SECTORS: usize = 32;
/// Sum of the cosines of unrelated phases that none reach by chance, over the root of their number: four standard deviations. And the least
/// number that tells.
const STANDS_OUT: f32 = 2.83;
const LEAST_BESIDE: f32 = 16.0;

/// Events of a part of the circle: the sum of their phases' cosines and sines, off those of all, and their number.
#[derive(Clone, Copy, Debug, Default)]
struct Sector {
    along: f32,
    across: f32,
    count: f32,
}

impl Sector {
    fn turn(&self) -> Turn {
        direction((self.along, self.across))
    }
}

/// The phases of a harmonic by direction.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    disc: Disc,
    sectors: [Sector; SECTORS],
}

impl Around {
    /// Learns the phases at a speed. Cost: about 300 instructions an event.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn learn(track: &[PolarEvent], disc: Disc, omega_rad_s: f32, harmonic: u32) -> Self {
        let turns = Pattern::learn(track, disc, omega_rad_s, harmonic).turns();
        let rate = TurnRate::from_rad_s(omega_rad_s);
        let mut sectors = [Sector::default(); SECTORS];
        for event in track {
            let (sin, cos) = ahead(*event, disc, rate, harmonic, &turns);
            let sector = &mut sectors[event.angle().sector(SECTORS as u32) as usize];
            sector.along += cos;
            sector.across += sin;
            sector.count += 1.0;
        }
        Self { disc, sectors }
    }

    /// Whether the events keep step on one side of the centre only: in the half of all directions opposite to where most do, they keep no more
    /// step than unrelated ones, or there are too few to tell, although that lies in `view`.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn is_arc(&self, view: Roi) -> bool {
        // Where they lie, as much as they keep step; then what lies on the other side.
        let (mut x, mut y) = (0.0, 0.0);
        let (mut sum, mut count) = (0.0, 0.0);
        for beside in [false, true] {
            for (index, sector) in self.sectors.iter().enumerate() {
                let middle = (2 * index as u32 + 1) * (u32::MAX / (2 * SECTORS as u32) + 1);
                let (sin, cos) = Turn(middle).sin_cos();
                if !beside {
                    (x, y) = (x + sector.along * cos, y + sector.along * sin);
                } else if x * cos + y * sin < 0.0 {
                    sum += sector.along;
                    count += sector.count;
                }
            }
        }
        if count > LEAST_BESIDE {
            return sum < STANDS_OUT * sqrt(count);
        }
        // Nothing is seen there: it should be, unless it would lie outside the picture.
        let per_length = Disc::MEAN_RADIUS * self.disc.radius_px / sqrt(x * x + y * y);
        let (x_px, y_px) = (self.disc.x_px - per_length * x, self.disc.y_px - per_length * y);
        x_px >= 0.0 && y_px >= 0.0 && view.contains(x_px as u16, y_px as u16)
    }

    /// Turns that the phases make beyond those of the harmonic as the direction goes round once: none of the right harmonic, however much the
    /// rotor is tilted, so that it seems to turn faster here than there. `None` where in some direction too few events keep step to tell.
    #[must_use]
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn turns_beyond(&self) -> Option<i32> {
        let mut turns = 0_i64;
        let [.., last] = &self.sectors;
        let mut before = last.turn();
        for sector in &self.sectors {
            let Sector { along, across, count } = *sector;
            if along * along + across * across <= STANDS_OUT * STANDS_OUT * count {
                return None;
            }
            let turn = sector.turn();
            turns += i64::from(turn.minus(before).0 as i32);
            before = turn;
        }
        Some((turns >> 32) as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::phase::tests::{DISC, pattern, seen_at};
    use super::*;
    use crate::math::TAU;

    extern crate std;
    use std::vec::Vec;

    const VIEW: Roi = Roi { x: 0, y: 0, width_px: 200, height_px: 200 };

    #[test]
    fn an_arc_keeps_step_on_one_side_only() {
        let (windings, line_hz) = (3, 120.0);
        let omega_rad_s = line_hz * TAU / windings as f32;
        let in_view =
            |track: &[PolarEvent], view| Around::learn(track, DISC, omega_rad_s, 3).is_arc(view);
        let is_arc = |track: &[PolarEvent]| in_view(track, VIEW);
        let whole = pattern(windings, line_hz);
        assert!(!is_arc(&whole));
        let right = |event: &&PolarEvent| event.angle().sin_cos().1 > 0.3;
        let arc: Vec<_> = whole.iter().filter(right).copied().collect();
        // With nothing beside it, an arc may as well be a rotor that is partly outside the picture, where that ends there.
        assert!(is_arc(&arc));
        assert!(!in_view(&arc, Roi { x: DISC.x_px as u16, ..VIEW }));
        let unrelated = pattern(windings, 777.0);
        let beside = unrelated.iter().filter(|event| !right(event)).copied();
        let before_noise: Vec<_> = arc.into_iter().chain(beside).collect();
        assert!(is_arc(&before_noise));
    }

    #[test]
    fn a_tilted_pattern_winds_as_often_as_it_has_blades_whatever_keeps_step_best() {
        let line_hz = 120.0;
        for blades in 3..=8_u32 {
            let upright = pattern(blades as i32, line_hz);
            for squeezed in [1.0, 0.7, 0.5] {
                // As a rotor that is tilted about the x axis is seen.
                let tilted: Vec<_> = upright
                    .iter()
                    .filter_map(|event| {
                        let (sin, cos) = event.angle().sin_cos();
                        let r_px = event.radius_px();
                        seen_at(r_px * cos, squeezed * r_px * sin, event.t_us)
                    })
                    .collect();
                for harmonic in [blades - 2, blades, blades + 2] {
                    let omega_rad_s = line_hz * TAU / harmonic as f32;
                    let around = Around::learn(&tilted, DISC, omega_rad_s, harmonic);
                    let beyond = harmonic as i32 - blades as i32;
                    let told = around.turns_beyond();
                    assert!(
                        told.is_none_or(|turns| turns == beyond),
                        "{blades} {harmonic}: {told:?}"
                    );
                    let shows = harmonic == blades && squeezed > 0.6
                        || blades == 4 && beyond > 0 && squeezed < 0.6;
                    assert!(told.is_some() || !shows, "{blades} {harmonic} {squeezed}");
                }
            }
        }
    }
}

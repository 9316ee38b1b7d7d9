//! On which sides of the rotor its edges change polarity.
//!
//! What is behind the blades may be brighter than they are in one place and darker in the next: an edge that fires ON here fires
//! OFF there. Taken as they are, such events pull the axis to where they contradict the rest least, by several pixels while the
//! harmonic is low. So the disc is cut into cells, and where a cell's events keep step with the template of the other polarity,
//! they count as of that one from then on.

use crate::math::sqrt;

/// Cells across the disc: a fan of 50 px has them 12 px wide, about as finely as things in the background differ.
const ACROSS: usize = 8;
/// Standard errors that a cell must keep better step by with the other polarity, and must keep step by with it at all.
const SIGMAS: f32 = 4.0;
/// Most cells that are turned round, an eighth: so many that a wrong axis is not explained by them. A rotor before two tones is searched
/// for without regard to polarity.
const MOST_TURNED: u8 = 4;

/// Which cells have their polarities the other way round: a bit for each, a byte for each row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inverted([u8; ACROSS]);

/// Sums over the events of a cell.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// Cosine of the phase off the other polarity's template, and by how much it is above that of its own.
    other: f32,
    gain: f32,
    /// Squares of the latter.
    squares: f32,
}

/// How well each cell of the disc keeps step with either polarity.
#[derive(Clone, Copy, Debug)]
pub struct Sides([Side; ACROSS * ACROSS]);

/// Cells a pixel of a disc of this radius.
pub fn cells_per_px(radius_px: f32) -> f32 {
    0.5 * ACROSS as f32 / radius_px.max(1.0)
}

/// The cell of a place relative to the axis, in cells.
#[inline]
pub fn cell(x: f32, y: f32) -> usize {
    // Casting a negative float gives 0.
    let at = |value: f32| ((value + 0.5 * ACROSS as f32) as usize).min(ACROSS - 1);
    ACROSS * at(y) + at(x)
}

impl Inverted {
    /// None.
    pub const UPRIGHT: Self = Self([0; ACROSS]);

    /// Whether any are.
    pub fn any(&self) -> bool {
        *self != Self::UPRIGHT
    }

    /// What an event of this polarity counts as there.
    #[inline]
    pub const fn is_on(&self, cell: usize, is_on: bool) -> bool {
        is_on ^ (self.0[cell / ACROSS % ACROSS] >> (cell % ACROSS) & 1 == 1)
    }

    /// Turns those cells round that keep step the other way; none, and `false`, where they are too many.
    pub fn learn(&mut self, sides: &Sides) -> bool {
        let mut turned = 0;
        for (cell, side) in sides.0.iter().enumerate() {
            let least = SIGMAS * sqrt(side.squares);
            if side.gain > least && side.other > least {
                self.0[cell / ACROSS] ^= 1 << (cell % ACROSS);
            }
            turned += u8::from(self.is_on(cell, false));
        }
        if turned > MOST_TURNED {
            *self = Self::UPRIGHT;
        }
        turned <= MOST_TURNED
    }
}

impl Sides {
    /// No events.
    pub const EMPTY: Self = Self([Side { other: 0.0, gain: 0.0, squares: 0.0 }; ACROSS * ACROSS]);

    /// Adds an event by the cosines of its phase off the template of its polarity and of the other one.
    #[inline]
    pub fn add(&mut self, cell: usize, own: f32, other: f32) {
        let side = &mut self.0[cell];
        let gain = other - own;
        side.other += other;
        side.gain += gain;
        side.squares += gain * gain;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learnt(cosines: &[(f32, f32)]) -> Inverted {
        let (mut sides, mut inverted) = (Sides::EMPTY, Inverted::UPRIGHT);
        cosines.iter().for_each(|(own, other)| sides.add(cell(3.9, -4.1), *own, *other));
        inverted.learn(&sides);
        inverted
    }

    #[test]
    fn a_cell_in_step_with_the_other_polarity_is_turned_round() {
        let inverted = learnt(&[(-0.2, 0.9); 40]);
        assert!(inverted.is_on(cell(3.9, -4.1), false));
        assert!(!inverted.is_on(cell(-3.9, -4.1), false));
    }

    #[test]
    fn neither_few_events_nor_chance_nor_an_absent_polarity_turn_a_cell_round() {
        let upright = Inverted::UPRIGHT;
        assert_eq!(learnt(&[(-0.2, 0.9); 8]), upright);
        let by_chance: Vec<_> = (0..400).map(|i| ((i as f32).sin(), (i as f32).cos())).collect();
        assert_eq!(learnt(&by_chance), upright);
        assert_eq!(learnt(&[(-0.9, 0.0); 400]), upright);
    }

    #[test]
    fn half_of_the_disc_is_not_turned_round() {
        let (mut sides, mut inverted) = (Sides::EMPTY, Inverted::UPRIGHT);
        for place in 0..=MOST_TURNED {
            (0..40).for_each(|_| sides.add(usize::from(place), -0.2, 0.9));
        }
        assert!(!inverted.learn(&sides));
        assert!(!inverted.any());
    }

    #[test]
    fn places_beyond_the_disc_count_with_its_rim() {
        assert_eq!(cell(-100.0, -100.0), 0);
        assert_eq!(cell(100.0, 100.0), ACROSS * ACROSS - 1);
        assert!((cells_per_px(50.0) * 50.0 - 4.0).abs() < 1e-6);
    }
}

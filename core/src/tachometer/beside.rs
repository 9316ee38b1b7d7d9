//! Whether something else moves beside the rotors, which may turn too slowly for their window to show it.
//!
//! A window is as long as the slowest rotor *found* wants it, and one that has not passed anywhere twice is not found beside
//! one that is. So where all that was found is locked and a patch of the picture beside it is dense with events, the window
//! grows once, in two steps up to the longest, and then begins short again if nothing in it wanted that.

use super::conclude::Wants;
use super::{Beside, Tachometer};
use crate::rotors::Disc;
use crate::speed::measurement::{ENOUGH, Outcome};

/// Of so many cells one is asked for the mean.
const SAMPLED: usize = 7;
/// Times the mean of the cells beside the rotors, and events more, from which on a cell is dense: one in a thousand is by
/// chance where noise makes two or three events in each.
const DENSE: u32 = 3;
/// Squares of three by three dense cells, at least: what turns leaves no gaps, while edges that a hand shakes are lines.
const LEAST_SQUARES: usize = 6;
/// How far a rotor's own events reach beyond its radius: its share and pixels, as the axis moves in a hand.
const REACH: f32 = 1.2;
const REACH_PX: f32 = 8.0;
/// Factor by which the window grows at a time.
pub(super) const GROWTH: f32 = 4.0;

impl Tachometer<'_> {
    /// Decides from a window of `window_us`, `locked` or not, whether longer ones are looked at for what moves beside the rotors; `longest`
    /// tells that there are none. Returns whether they are to be short again, as nothing in it wants them longer than before.
    pub(super) fn look_beside(&mut self, window_us: f32, locked: bool, longest: bool) -> bool {
        let wants = self.wants();
        if let Beside::LookedAt(before_us) = self.beside {
            let found = wants.read_us > ENOUGH * before_us;
            // What does not lock in longer windows than it did before is none the wiser for them.
            let ends = found || longest || !locked || self.overrun;
            if ends {
                self.beside = Beside::Known;
            }
            return ends && !found;
        }
        let Wants { all_locked, all_us, .. } = wants;
        if self.outcomes.is_empty() {
            self.beside = Beside::Nothing;
        } else if self.searched && all_locked && all_us <= ENOUGH * window_us {
            self.beside = match (self.moves_beside(), self.beside) {
                (false, _) => Beside::Nothing,
                (true, Beside::Nothing) => Beside::LookedAt(window_us),
                (true, _) => Beside::Known,
            };
        }
        false
    }

    /// Whether the window is longer than what is locked wants it.
    pub(super) const fn looks_beside(&self) -> bool {
        matches!(self.beside, Beside::LookedAt(_))
    }

    /// Whether some patch beside the rotors is dense with events. Cost: about 25 instructions a cell.
    #[inline(never)]
    fn moves_beside(&self) -> bool {
        let counts = self.heat.counts();
        let (mut sum, mut seen) = (0, 1);
        for cell in (0..counts.len()).step_by(SAMPLED).filter(|cell| self.is_beside(*cell)) {
            sum += u32::from(counts[cell]);
            seen += 1;
        }
        let least = DENSE * (1 + sum / seen);
        let row = self.heat.grid().columns;
        let dense = |cell: usize| {
            counts.get(cell).is_some_and(|count| u32::from(*count) >= least && self.is_beside(cell))
        };
        let mut squares = 0;
        for cell in 0..counts.len() {
            let all = (0..9).all(|place| dense(cell + place / 3 * row + place % 3));
            squares += usize::from(all);
        }
        squares >= LEAST_SQUARES
    }

    /// Whether a cell of the heat map is none of a rotor's.
    #[inline(never)]
    fn is_beside(&self, cell: usize) -> bool {
        let (x_px, y_px) = self.heat.grid().centre(cell);
        let at = Disc { x_px, y_px, radius_px: 0.0 };
        let covers = |outcome: &Outcome| {
            let disc = outcome.found.disc;
            let reach_px = REACH * disc.radius_px + REACH_PX;
            disc.distance2(&at) < reach_px * reach_px
        };
        !self.outcomes.iter().any(covers)
    }
}

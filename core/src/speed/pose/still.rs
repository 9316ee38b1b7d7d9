//! An axis that stands still although its path does not.
//!
//! Path and template are learnt together: what differs from blade to blade and from place to place (light, latency, what is behind)
//! takes the axis round once a turn, by pixels where blocks hold many events, and the turn with it. So an axis that hardly moved
//! is tried at rest.

use super::blocks::{WALK_PX, WALK_TWO_PX};
use super::{MOVING_PX_S, Path, Pose};

/// Root mean square speed of the axis in px/s up to which it may have stood still: of a rotor whose blades show a shift, and of one
/// with two, whose path is held back.
const MAYBE_STILL_PX_S: f32 = 30.0;
const MAYBE_STILL_TWO_PX_S: f32 = 12.0;
/// It did where as large a share of the events is in step about an axis at rest as along its path: on a tripod that is all and more but
/// seldom, in a hand mostly less, but not always where two blades hardly show how it moves.
const STILL_SHARE: f32 = 0.985;

impl Pose {
    /// Whether all events are to be looked at about an axis at rest first, at the mean place of the path, which is kept in `walked`.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn tries_still(&mut self, walked: &mut Path) -> bool {
        // The shift of a single mark, which one of two may be, looks like its turn.
        let may_be_mark = self.walk_px < WALK_TWO_PX;
        let two = self.walk_px < WALK_PX;
        let most_px_s = if two { MAYBE_STILL_TWO_PX_S } else { MAYBE_STILL_PX_S };
        if may_be_mark || self.phases.is_none() || self.drift_px_s() > most_px_s {
            return false;
        }
        (self.still, self.in_doubt) = (true, true);
        walked.clone_from(&self.path);
        self.path.rest();
        true
    }

    /// Whether the round about an axis at rest, in which a share of `coherence` was in step, tells that it moves: then the path is
    /// as it was before, and the round is to be done again along it.
    pub(super) fn moves_after_all(&mut self, coherence: f32, walked: &mut Path) -> bool {
        let moves = core::mem::take(&mut self.in_doubt) && coherence < STILL_SHARE * self.coherence;
        if moves {
            self.still = false;
            core::mem::swap(&mut self.path, walked);
        }
        moves
    }

    /// Goes back to half the harmonic where the axis moves and all events are looked at next.
    // Nor this.
    #[inline(never)]
    pub(super) fn reach_out(&mut self) {
        let moves = self.drift_px_s() > MOVING_PX_S;
        if moves && self.schedule.reaches_out() && self.harmonic > self.first_harmonic {
            // A sample leaves the path off by more than the harmonic's reach where a hand moves fast: half of it reaches
            // farther, and all events follow it as finely.
            self.harmonic /= 2;
            self.phases = None;
        }
    }
}

//! An axis that stands still although its path does not.
//!
//! Path and template are learnt together: what differs from blade to blade and from place to place (light, latency, what is behind)
//! takes the axis round once a turn, by pixels where blocks hold many events, and the turn with it. So an axis that hardly moved
//! is tried at rest.

use super::blocks::WALK_PX;
use super::{Path, Pose};

/// Root mean square speed of the axis in px/s up to which it may have stood still: of a rotor whose blades show a shift, and of one
/// with two, whose path is held back.
const MAYBE_STILL_PX_S: f32 = 30.0;
const MAYBE_STILL_TWO_PX_S: f32 = 12.0;
/// It did where as large a share of the events is in step about an axis at rest: in a hand, and as far as that goes by so little, up to
/// 0.98 of them are, on a tripod all and more.
const STILL_SHARE: f32 = 0.985;

impl Pose {
    /// Whether all events are to be looked at about an axis at rest first, at the mean place of the path, which is kept in `walked`.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn tries_still(&mut self, walked: &mut Path) -> bool {
        // The shift of a single mark, which one of two may be, looks like its turn.
        let may_be_mark = self.parts < 2 && self.sectors < 3;
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
}

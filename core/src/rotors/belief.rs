//! Which rotation is believed.

use super::coherence::Phasor;
use super::disc::Disc;
use super::extraction::Candidate;
use super::winding::{Explainer, Winding};
use crate::math::{TAU, larger};

/// Least share of its disc that a rotor's phasors cover: a mark on a rim sweeps a fifth.
const LEAST_COVER: f32 = 0.08;
/// A rotation must explain this share of one cluster's phasors.
const LEAST_SHARE: f32 = 0.6;
/// By how much it must explain more than "all in step" does.
const LEAST_LEAD: f32 = 0.2;
/// Fewest phasors that a rotation is believed on.
pub const LEAST_PHASORS: usize = 12;
/// The same three where the phasors are single events, noise among them: their number, the share that is explained, and the power
/// over what chance would reach.
const LEAST_EVENTS: usize = 64;
const LEAST_EVENT_SHARE: f32 = 0.45;
const EVENTS_OVER_CHANCE: f32 = 1.5;
/// Farthest axis from the disc's centre, in radii.
const MOST_OFF_CENTRE: f32 = 0.7;

/// Whether a phasor belongs to a disc.
pub fn inside(phasor: &Phasor, part: &Disc) -> bool {
    let reach_px = 1.2 * part.radius_px;
    phasor.distance2(part) < reach_px * reach_px
}

/// A rotor, when the winding is one to be believed.
pub fn believe(explainer: &Explainer, line_hz: f32) -> Option<Candidate> {
    let (region, total, part, winding) = explainer.result();
    let Winding { share, share_in_step, windings, over_chance, .. } = winding;
    let thinned = total as f32 / region.len().max(1) as f32;
    let axis = Disc { x_px: winding.x_px, y_px: winding.y_px, radius_px: 0.0 };
    let off_centre = MOST_OFF_CENTRE * part.radius_px;
    let (least, least_share, least_over) = match explainer.cell_px() {
        Some(_) => (LEAST_PHASORS, LEAST_SHARE, 1.0),
        None => (LEAST_EVENTS, LEAST_EVENT_SHARE, EVENTS_OVER_CHANCE),
    };
    let believed = windings != 0
        && region.len() >= least
        && over_chance > least_over
        && share >= least_share
        && share - share_in_step >= LEAST_LEAD
        && part.distance2(&axis) <= off_centre * off_centre;
    let radius_px = explainer.rim_px();
    let disc_px2 = core::f32::consts::PI * radius_px * radius_px;
    let covering = region.iter().filter(|p| p.distance2(&axis) < radius_px * radius_px).count();
    // Both polarities of a cell are phasors of their own.
    let in_phasors =
        |cell_px: f32| 0.5 * covering as f32 * thinned * cell_px * cell_px / larger(disc_px2, 1.0);
    let cover = explainer.cell_px().map_or(1.0, in_phasors);
    (believed && cover > LEAST_COVER).then(|| Candidate {
        disc: Disc { radius_px, ..axis },
        omega_rad_s: line_hz * TAU / windings as f32,
        windings: windings.unsigned_abs(),
        line_hz,
        share,
        cover,
        explained: share * region.iter().map(|p| p.amplitude).sum::<f32>() * thinned,
    })
}

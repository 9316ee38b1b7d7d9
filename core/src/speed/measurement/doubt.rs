//! A harmonic in doubt: where the second best keeps step almost as well as the best, or so many blades stand on so small a
//! radius that a centre is never known well enough, the centre may be off or the harmonic wrong. About a wrong centre a
//! neighbour of the right harmonic fits one side of the rotor, and Newton's steps lead it there; while a hand moves the axis
//! by as much, it may even keep step better than the right one. So each place about the centre is asked for its own best
//! harmonic, by a moment in the middle of the window, and the best of all places is believed.

use super::{Measurement, Stage};
use crate::math::{TAU, larger};
use crate::reading::{Reason, Status};
use crate::rotors::{Disc, Found};
use crate::speed::angular::AngularSums;
use crate::speed::phase::scan;
use crate::speed::polar::{Annulus, PolarTrack, track};
use crate::store::{Even, Window};

/// Share in step of the second best harmonic over that of the best from which on they are in doubt.
const DOUBTFUL: f32 = 0.3;
/// The same where a centre that is off by little leads to another harmonic, which then shows as well; and of blurred edges.
const SMALL_DOUBTFUL: f32 = 0.15;
/// The same after the look about the centre, from which on nothing but sharp edges tells them apart.
const IN_DOUBT: f32 = 0.6;
/// The same of another harmonic at its own best place, from which on not even edges do.
const MOST_RIVAL: f32 = 0.9;
/// Blur of the edges in windings, where there is an overtone, below which it settles any doubt. In random scenes of small rotors in a
/// hand that of wrong harmonics was from 0.44, that of right ones mostly 0.1 to 0.4.
const SETTLED_BLUR: f32 = 0.35;
/// The same from which on it settles none of a larger rotor's, either: of a wrong one it was 0.66, of right ones 0.4 at most but for one of 66.
const UNSETTLED_BLUR: f32 = 0.5;
/// Radius in pixels below which a centre that is off by two or three pixels fits the overtone as well.
pub(super) const SMALL_PX: f32 = 20.0;
/// Pixels that a hand may move the axis by within a window. About a centre that is off by R / m, a harmonic m looks like its
/// neighbour on one side of the rotor.
const OFF_CENTRE_PX: f32 = 4.0;
/// Places to each side of the centre, and how far they are apart in radii; then the same about the best of them.
const PLACES: i8 = 3;
const SPACING: f32 = 0.1;
const FINE_PLACES: i8 = 1;
const FINE_SPACING: f32 = 0.05;
/// What is collected about the centre, in radii, so that a place at the corner has its events too.
const COLLECTED: f32 = 1.3;
/// Events that are collected, of which about half are seen from a place; and those of a moment.
const MOST_EVENTS: usize = 1_024;
const MOMENT_EVENTS: usize = 512;
/// A moment is no longer than this part of the window, where it then has so many events.
const MOMENT_SHARE: usize = 3;
const LEAST_IN_MOMENT: usize = 192;

/// The look about the centre, place by place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    disc: Disc,
    line_hz: f32,
    /// Whether a centre that is off by little leads to another harmonic.
    small: bool,
    /// Whether this is the second look, about the best place of the first, which lay at its border.
    again: bool,
    /// Whether the events are collected.
    collected: bool,
    /// Centre of the places, how far they are apart, and how many there are to each side.
    from: Disc,
    spacing_px: f32,
    places: i8,
    row: i8,
    column: i8,
    /// Share in step at the best place with its best harmonic, and that of the best place of another.
    share: f32,
    rival_share: f32,
    best: (Disc, i32),
    /// Best place of the rival.
    rival: (Disc, i32),
}

impl Doubt {
    pub(super) fn new(disc: Disc, line_hz: f32, harmonic: u32) -> Self {
        Self {
            disc,
            line_hz,
            small: is_small(disc, harmonic),
            again: false,
            collected: false,
            from: disc,
            spacing_px: SPACING * disc.radius_px,
            places: PLACES,
            row: -PLACES,
            column: -PLACES,
            share: 0.0,
            rival_share: 0.0,
            best: (disc, 0),
            rival: (disc, 0),
        }
    }

    /// Collects a segment's events, or asks a place; `true` once all are asked.
    fn step(
        &mut self,
        window: &Window<'_>,
        polar: &mut PolarTrack,
        angular: &mut AngularSums,
        even: &mut Even,
    ) -> bool {
        if !self.collected {
            let around = Disc { radius_px: COLLECTED * self.disc.radius_px, ..self.disc };
            if track(window, around, polar, even) {
                *even = Even::EMPTY;
                // While a hand moves the axis by little, where that tells one harmonic from the next.
                keep(polar, self.small);
                self.collected = true;
            }
            return false;
        }
        let x_px = self.from.x_px + f32::from(self.column) * self.spacing_px;
        let y_px = self.from.y_px + f32::from(self.row) * self.spacing_px;
        // The fine places lie about one that was asked before.
        let known = self.places == FINE_PLACES && (self.column, self.row) == (0, 0);
        if !known {
            self.ask(Disc { x_px, y_px, ..self.disc }, polar, angular);
        }
        self.column += 1;
        if self.column > self.places {
            self.column = -self.places;
            self.row += 1;
        }
        if self.row <= self.places {
            return false;
        }
        let last = self.places == FINE_PLACES;
        let (best, harmonic) = self.best;
        let border_px = (f32::from(PLACES) - 0.5) * self.spacing_px;
        let off_px = larger((best.x_px - self.from.x_px).abs(), (best.y_px - self.from.y_px).abs());
        if !last && !self.again && off_px > border_px {
            // What lies beyond may be better still.
            *self = Self { again: true, ..Self::new(best, self.line_hz, harmonic.unsigned_abs()) };
            return false;
        }
        self.from = best;
        self.spacing_px = FINE_SPACING * self.disc.radius_px;
        self.places = FINE_PLACES;
        (self.row, self.column) = (-FINE_PLACES, -FINE_PLACES);
        last
    }

    /// Asks a place for its best harmonic.
    fn ask(&mut self, place: Disc, polar: &mut PolarTrack, angular: &mut AngularSums) {
        let (dx_px, dy_px) = (place.x_px - self.disc.x_px, place.y_px - self.disc.y_px);
        // What is seen from there goes behind what is seen from the centre.
        let (collected, annulus) = (polar.len(), Annulus::of(place));
        for index in 0..collected {
            let Some(event) = polar.get(index) else { break };
            if let Some(event) = event.seen_from(dx_px, dy_px, &annulus) {
                polar.push(event).ok();
            }
        }
        let seen = polar.get(collected..).unwrap_or(&[]);
        let found = scan(angular, seen, place, self.line_hz);
        polar.truncate(collected);
        let mut less = (found.share, (place, found.best));
        if found.share > self.share {
            less = (self.share, self.best);
            self.share = found.share;
            self.best = (place, found.best);
        }
        // Whoever is not the best is its rival.
        if less.1.1 != self.best.1 && less.0 > self.rival_share {
            (self.rival_share, self.rival) = less;
        }
    }
}

/// Whether blades stand so close together that a hand moves the axis from one harmonic to the next.
fn is_small(disc: Disc, harmonic: u32) -> bool {
    disc.radius_px < OFF_CENTRE_PX * harmonic as f32
}

/// Keeps events of all of the window, or of a moment in its middle.
fn keep(polar: &mut PolarTrack, moment: bool) {
    let in_moment = (polar.len() / MOMENT_SHARE).clamp(LEAST_IN_MOMENT, MOMENT_EVENTS);
    let (before, stride) = if moment {
        (polar.len().saturating_sub(in_moment) / 2, 1)
    } else {
        (0, polar.len().div_ceil(MOST_EVENTS).max(1))
    };
    let mut index = 0;
    polar.retain(|_| {
        index += 1;
        index > before && index % stride == 0
    });
    polar.truncate(if moment { in_moment } else { MOST_EVENTS });
}

impl Measurement {
    /// The rival of what is refused as ambiguous, about its own best place: it may be the right one. It has none itself.
    // Not inlined: flash is short.
    #[inline(never)]
    #[must_use]
    pub fn rival(&self, ignores_polarity: bool) -> Option<Found> {
        let doubt = self.doubt.as_ref()?;
        let (disc, harmonic) = doubt.rival;
        let omega_rad_s = doubt.line_hz * TAU / harmonic as f32;
        let windings = harmonic.unsigned_abs();
        let other = harmonic != 0 && harmonic != doubt.best.1 && !doubt.small;
        let ambiguous = self.status == Status::Refused(Reason::Ambiguous);
        (ambiguous && other && !self.faint).then_some(Found {
            disc,
            omega_rad_s,
            windings,
            ignores_polarity,
            rival: true,
            ..Found::default()
        })
    }

    /// Whether another harmonic keeps step almost as well wherever the centre is thought to be, and no overtone settles it: only a sharp
    /// one does where a centre that is off by little leads from one to the next.
    pub(super) fn in_doubt(&self) -> bool {
        if self.has_overtone_within(SETTLED_BLUR) {
            return false;
        }
        let settled = self.has_overtone_within(UNSETTLED_BLUR) && self.disc.radius_px >= SMALL_PX;
        let rivalled = |doubt: &Doubt| {
            (doubt.small || !settled) && doubt.rival_share > MOST_RIVAL * doubt.share
        };
        !settled && (self.is_rival || self.closely_rivalled())
            || self.doubt.as_ref().is_some_and(rivalled)
    }

    /// Whether the centre is to be looked about, as another harmonic keeps step too.
    pub(super) fn is_to_be_doubted(&self, rival: f32) -> bool {
        let doubtful = if is_small(self.disc, self.harmonic) { SMALL_DOUBTFUL } else { DOUBTFUL };
        self.doubt.is_none() && !self.is_rival && rival > doubtful
    }

    /// Whether there is any doubt: too much where no lock tells a harmonic from its neighbour.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn doubted(&self) -> bool {
        self.standing() > DOUBTFUL
    }

    /// Whether another harmonic keeps step almost as well.
    pub(super) fn closely_rivalled(&self) -> bool {
        self.standing() > IN_DOUBT
    }

    /// Whether another harmonic keeps step at all, so that the centre may be off.
    pub(super) fn rivalled(&self) -> bool {
        self.standing() > SMALL_DOUBTFUL
    }

    /// Share in step of another harmonic over that of the best.
    pub(super) fn standing(&self) -> f32 {
        self.evidence.scan_standing.unwrap_or(0.0)
    }

    /// Looks about the centre, then begins again with what was found there.
    pub(super) fn doubt(
        &mut self,
        window: &Window<'_>,
        polar: &mut PolarTrack,
        angular: &mut AngularSums,
        even: &mut Even,
    ) {
        let Some(doubt) = &mut self.doubt else { return };
        if !doubt.step(window, polar, angular, even) {
            return;
        }
        let (place, harmonic) = doubt.best;
        if harmonic != 0 {
            self.disc = place;
            self.omega_rad_s = doubt.line_hz * TAU / harmonic as f32;
            self.harmonic = harmonic.unsigned_abs();
        }
        self.turn = 0;
        self.stage = Stage::Track;
    }
}

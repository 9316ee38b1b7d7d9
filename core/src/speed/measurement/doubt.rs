//! A harmonic in doubt: where the second best keeps step almost as well as the best, the centre is off or the harmonic is
//! wrong. About a wrong centre a neighbour of the right harmonic fits one side of the rotor, and Newton's steps lead it
//! there. So each place about the centre is asked for its own best harmonic, and the best of all places is believed.

use super::{Measurement, Stage};
use crate::math::TAU;
use crate::rotors::Disc;
use crate::speed::angular::AngularSums;
use crate::speed::phase::{harmonics, scan};
use crate::speed::polar::{PolarTrack, track};
use crate::store::{Even, Window};

/// Share in step of the second best harmonic over that of the best from which on they are in doubt.
pub(super) const DOUBTFUL: f32 = 0.3;
/// The same after the look about the centre, from which on nothing but edges tells them apart.
const IN_DOUBT: f32 = 0.6;
/// Radius in pixels below which a centre that is off by two or three pixels fits the overtone as well.
pub(super) const SMALL_PX: f32 = 20.0;
/// Places to each side of the centre, and how far they are apart in radii.
const PLACES: i8 = 3;
const SPACING: f32 = 0.1;
/// Events that a place is judged by.
const MOST_EVENTS: usize = 512;

/// The look about the centre, place by place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    disc: Disc,
    line_hz: f32,
    row: i8,
    column: i8,
    /// Share in step at the best place with its best harmonic.
    share: f32,
    best: (Disc, i32),
}

impl Doubt {
    pub(super) const fn new(disc: Disc, line_hz: f32) -> Self {
        Self { disc, line_hz, row: -PLACES, column: -PLACES, share: 0.0, best: (disc, 0) }
    }

    /// Collects a segment's events about a place, or asks the place; `true` once all are asked.
    fn step(
        &mut self,
        window: &Window<'_>,
        polar: &mut PolarTrack,
        angular: &mut AngularSums,
        even: &mut Even,
    ) -> bool {
        let spacing_px = SPACING * self.disc.radius_px;
        let x_px = self.disc.x_px + f32::from(self.column) * spacing_px;
        let y_px = self.disc.y_px + f32::from(self.row) * spacing_px;
        let place = Disc { x_px, y_px, ..self.disc };
        if !track(window, place, polar, even) {
            return false;
        }
        *even = Even::EMPTY;
        let stride = polar.len().div_ceil(MOST_EVENTS).max(1);
        let mut index = 0;
        polar.retain(|_| {
            index += 1;
            index % stride == 0
        });
        angular.clear();
        scan(angular, polar, place, self.line_hz);
        let found = harmonics(angular);
        if found.share > self.share {
            self.share = found.share;
            self.best = (place, found.best);
        }
        self.column += 1;
        if self.column > PLACES {
            self.column = -PLACES;
            self.row += 1;
        }
        self.row > PLACES
    }
}

impl Measurement {
    /// Whether another harmonic keeps step almost as well wherever the centre is thought to be, and no overtone settles it.
    pub(super) fn in_doubt(&self) -> bool {
        let settled = self.pose.has_overtone() && self.disc.radius_px >= SMALL_PX;
        self.standing() > IN_DOUBT && !settled
    }

    /// Whether there is any doubt: too much where no lock tells a harmonic from its neighbour.
    pub(super) fn doubted(&self) -> bool {
        self.standing() > DOUBTFUL
    }

    fn standing(&self) -> f32 {
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

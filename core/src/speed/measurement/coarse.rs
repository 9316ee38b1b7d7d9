//! What is known of a rotor before its pose is followed: centre and speed by the polar phase, the harmonic that keeps step (first
//! coarse witness), the angle of symmetry; and after, the initial alignment (second coarse witness).

use super::baselines::REFINEMENT_PERIODS;
use super::doubt::Doubt;
use super::{LEAST_EVENTS, Measurement, Stage};
use crate::math::TAU;
use crate::reading::{Reason, Speed, Status};
use crate::registration::Icp;
use crate::settings::Settings;
use crate::speed::angular::AngularSums;
use crate::speed::around::Around;
use crate::speed::baseline::Estimate;
use crate::speed::initial::{Ladder, median};
use crate::speed::path::Path;
use crate::speed::phase::{newton, scan};
use crate::speed::polar::{PolarEvent, PolarTrack};
use crate::speed::symmetry::{LEAST_ALIKE, mark_harmonic, symmetry, turn_back};
use crate::store::{WINDOW_SEGMENTS, Window};

/// Steps of centre and speed by the polar phase.
const NEWTON_STEPS: u8 = 6;
/// A step that moves the centre, and the rim at the window's ends, by less than this is the last.
const LAST_STEP_PX: f32 = 0.1;
/// Share in step of the second best harmonic over that of the best: beyond this the pattern stands, or the centre is off.
const MOST_STANDING: f32 = 0.8;
/// The same of the rival of what shows on less than half of its way around: that of half has 0.64. So has one whose blades show more there than
/// elsewhere, against what is behind or to a busy readout, but what there is of it keeps step all around.
const RIVAL_OF_ARC: f32 = 0.7;
/// The same from which on a rotor may be tilted so much that another harmonic than its own keeps step best: those have 0.49 and more.
const RIVAL_OF_TILT: f32 = 0.4;
/// Pixels along the rim from one blade to the next below which there are none to be seen: what keeps step is a lamp's light.
const LEAST_APART_PX: f32 = 5.0;
/// Two coarse speeds contradict each other when they differ by more than half the way to the next speed that the line
/// could also mean (its frequency over one winding more), but within these shares: registration of thin
/// slices falls short of the turn by up to a tenth.
pub(super) const COARSE_AGREEMENT: f32 = 0.15;
const MOST_COARSE_AGREEMENT: f32 = 0.25;
/// Two harmonics of one line differ by a fifteenth or more.
const SCAN_AGREEMENT: f32 = 0.04;
/// Events that a look at their harmonics takes in in one step: half a million instructions.
const EVENTS_A_STEP: usize = 768;
/// Share of a symmetry period below which not even a coarse reading stands.
const COARSE_PERIODS: f32 = 0.8;
/// Symmetry below which parts differ so much that baselines are whole revolutions.
const ALIKE_SCORE: f32 = 0.85;
/// Segments that the initial alignment looks at.
const LADDERS: usize = 3;
/// Where there are more events than this, more segments are looked at.
const LADDER_EVENTS: usize = 4_096;
/// Error of a coarse reading, relative, for one symmetry period in the window.
const COARSE_SIGMA: f32 = 0.01;
/// Fastest shaft, and fastest passing of blades, in revolutions a minute.
const MOST_RPM: f32 = 60_000.0;
const MOST_BLADE_RPM: f32 = 150_000.0;

impl Measurement {
    /// Centre and speed by the polar phase, a Newton step at a time.
    pub(super) fn newton(&mut self, window: &Window<'_>, polar: &PolarTrack) {
        self.evidence.events = self.events as u32;
        if self.events < LEAST_EVENTS {
            return self.refuse(Reason::TooFewEvents);
        }
        if self.turn < NEWTON_STEPS {
            let Some(last) = self.step_centre(window, polar) else {
                return self.refuse(Reason::NoRotation);
            };
            self.turn = if last { NEWTON_STEPS } else { self.turn + 1 };
            self.stage = Stage::Track;
            return;
        }
        let (coherence, reach) = self.coherence(polar, self.omega_rad_s, self.harmonic);
        self.evidence.coherence = Some(coherence);
        if coherence < self.least_coherence() {
            return self.refuse(Reason::NoRotation);
        }
        // Found about an axis that was far off, it reached farther from there. Never 0: where nothing keeps step, it is refused above.
        if reach < 1.0 {
            self.disc.radius_px *= reach;
            self.stage = Stage::Track;
            return;
        }
        self.faint = self.is_faint(coherence);
        self.turn = 0;
        self.stage = Stage::Scan;
    }

    /// One Newton step of centre and speed: whether it was so small that it is the last, or `None` when the phase gives none.
    fn step_centre(&mut self, window: &Window<'_>, polar: &PolarTrack) -> Option<bool> {
        let step = newton(polar, self.disc, self.omega_rad_s, self.harmonic, window.duration_us)?;
        let reach_px = 0.3 * self.disc.radius_px;
        // Not `clamp`, whose panic on a wrong order of bounds pulls float formatting into the image.
        self.disc.x_px += step.dx_px.max(-reach_px).min(reach_px);
        self.disc.y_px += step.dy_px.max(-reach_px).min(reach_px);
        self.omega_rad_s += step.domega_rad_s;
        let half_s = 0.5e-6 * window.duration_us as f32;
        let turned_px = step.domega_rad_s * half_s * self.disc.radius_px;
        Some(step.dx_px.abs().max(step.dy_px.abs()).max(turned_px.abs()) < LAST_STEP_PX)
    }

    /// Which harmonic of the line turns about the refined centre: first coarse witness.
    pub(super) fn scan(&mut self, polar: &[PolarEvent], angular: &mut AngularSums) {
        let line_hz = self.omega_rad_s.abs() * self.harmonic as f32 / TAU;
        let scan = scan(angular, polar, self.disc, line_hz);
        let standing = scan.second_share / scan.share.max(1e-3);
        let rival = scan.rival_share / scan.share.max(1e-3);
        self.evidence.scan_rad_s = (scan.best != 0).then(|| line_hz * TAU / scan.best as f32);
        self.evidence.scan_score = Some(scan.share * scan.share * polar.len() as f32);
        self.evidence.scan_standing = Some(rival);
        if scan.best == 0 {
            return self.refuse(Reason::NoRotation);
        }
        if self.is_to_be_doubted(rival) {
            self.doubt = Some(Doubt::new(self.disc, line_hz, self.harmonic));
            self.stage = Stage::Doubt;
            return;
        }
        let omega_rad_s = line_hz * TAU / scan.best as f32;
        if (omega_rad_s - self.omega_rad_s).abs() > SCAN_AGREEMENT * omega_rad_s.abs() {
            if self.second_look {
                return self.refuse(Reason::Ambiguous);
            }
            self.second_look = true;
            self.omega_rad_s = omega_rad_s;
            self.harmonic = scan.best.unsigned_abs();
            self.stage = Stage::Track;
            return;
        }
        if standing > MOST_STANDING {
            return self.refuse(Reason::Ambiguous);
        }
        if TAU * self.disc.radius_px < LEAST_APART_PX * self.harmonic as f32 {
            return self.refuse(Reason::NoRotation);
        }
        self.other_windings =
            [scan.still_share, scan.mirror_share].map(|share| share / scan.share.max(1e-3));
        self.windings = self.harmonic;
        self.stage = if rival > RIVAL_OF_TILT { Stage::Around } else { Stage::Symmetry };
    }

    /// Whether it shows on less than half of its way around: then it may be part of something larger. And whether it is tilted so much that
    /// the harmonic is that of some sides of it, where its blades seem slow and close together, or fast and far apart: then the phases
    /// make other turns all around. One that is not seen well enough in every direction is believed.
    pub(super) fn around(&mut self, settings: &Settings, polar: &[PolarEvent]) {
        let around = Around::learn(polar, self.disc, self.omega_rad_s, self.harmonic);
        let arc = self.standing() > RIVAL_OF_ARC && around.is_arc(settings.view());
        let tilted = around.turns_beyond().is_some_and(|turns| turns != 0);
        if arc || tilted {
            return self.refuse(Reason::Ambiguous);
        }
        self.stage = Stage::Symmetry;
    }

    /// Angle of symmetry, some events a step.
    pub(super) fn symmetry(
        &mut self,
        settings: &Settings,
        polar: &[PolarEvent],
        angular: &mut AngularSums,
    ) {
        if self.turn == 0 {
            angular.clear();
        }
        let from = usize::from(self.turn) * EVENTS_A_STEP;
        let to = (from + EVENTS_A_STEP).min(polar.len());
        turn_back(angular, polar.get(from..to).unwrap_or(&[]), self.disc, self.omega_rad_s);
        self.turn += 1;
        if to < polar.len() {
            return;
        }
        let symmetry = symmetry(angular);
        self.parts = settings.blades.or(symmetry.parts);
        // What was not counted is many parts, unless they are as little alike as the edges of one.
        let least = if self.parts.is_some() { ALIKE_SCORE } else { LEAST_ALIKE };
        self.alike = self.parts == Some(1) || settings.blades.is_none() && symmetry.score >= least;
        self.evidence.symmetry_score = Some(symmetry.score);
        self.stage = Stage::Overtone;
    }

    /// Whether the line is an overtone of the blades' own.
    pub(super) fn overtone(&mut self, polar: &[PolarEvent], angular: &AngularSums) {
        let omega_rad_s = self.omega_rad_s;
        let mut share = self.in_step(polar, omega_rad_s, self.harmonic);
        if let Some(parts) = self.parts.map(u32::from).filter(|parts| *parts > 0) {
            let of_parts = self.in_step(polar, omega_rad_s, parts);
            if of_parts > share {
                (self.harmonic, share) = (parts, of_parts);
            }
        }
        if let Some(harmonic) = mark_harmonic(angular).filter(|_| self.parts == Some(1)) {
            self.harmonic = harmonic;
            share = self.in_step(polar, omega_rad_s, harmonic);
        }
        self.evidence.coherence = Some(share);
        let rpm = self.omega_rad_s.abs() * Speed::RPM_PER_RAD_S;
        let blades = f32::from(self.parts.unwrap_or(1));
        if rpm > MOST_RPM || rpm * blades > MOST_BLADE_RPM {
            return self.refuse(Reason::TooFast);
        }
        self.turn = 0;
        self.stage = Stage::Recovery;
    }

    /// Initial alignment in every other segment: second coarse witness.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn initial(&mut self, window: &Window<'_>, icp: &mut Icp) {
        if let Some(ladder) = &mut self.ladder {
            if ladder.step(window, &Path::STILL, icp) {
                self.rates.extend(ladder.rate_rad_s());
                self.ladder = None;
                self.turn += 1;
            }
            return;
        }
        let segments = window.segments().min(WINDOW_SEGMENTS);
        let ladders = (self.events / LADDER_EVENTS).clamp(LADDERS, WINDOW_SEGMENTS);
        let segment = usize::from(self.turn) * segments.div_ceil(ladders).max(1);
        if segment < segments {
            self.ladder = Some(Ladder::new(segment, self.disc));
            return;
        }
        self.evidence.initial_rad_s = median(&mut self.rates);
        // A single mark has no symmetry to be mistaken for another, and registration less to go by.
        let rivals = if self.parts == Some(1) { 1 } else { self.windings };
        let half_way = 0.5 / (rivals as f32 + 1.0);
        let agreement =
            half_way.clamp(COARSE_AGREEMENT, MOST_COARSE_AGREEMENT) * self.omega_rad_s.abs();
        // Where the events are too few for slices, refinement and lock are the first registrations.
        let agrees = self
            .evidence
            .initial_rad_s
            .is_none_or(|initial| (initial - self.omega_rad_s).abs() < agreement);
        if !agrees && !self.sharp() {
            return self.refuse(Reason::Ambiguous);
        }
        let periods = self.count_periods(window);
        if periods < COARSE_PERIODS || self.is_mark_too_slow(window) {
            return self.refuse(Reason::TooSlow);
        }
        // Until something better: as good as the share of a period that the window shows.
        let spread = COARSE_SIGMA * self.omega_rad_s.abs() / periods;
        self.estimate = Estimate { omega_rad_s: self.omega_rad_s, sigma_rad_s: spread };
        self.status = Status::Coarse;
        if periods < 1.0 + REFINEMENT_PERIODS {
            self.stage = Stage::Queue;
            return;
        }
        self.plan_refinement(window);
    }
}

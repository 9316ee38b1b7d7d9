//! The measurement of one rotor in one window, step by step: the paper's stages and the lock beyond them.

mod baselines;
mod doubt;
mod verdict;

use super::angular::AngularSums;
use super::baseline::{Estimate, Pairs};
use super::initial::{Ladder, Rates, median};
use super::path::Path;
use super::phase::{Pattern, harmonics, newton, scan};
use super::polar::{PolarEvent, PolarTrack, track};
use super::pose::{Pose, Sums};
use super::symmetry::{symmetry, turn_back};
use crate::math::TAU;
use crate::reading::{Evidence, Frame, Reason, Speed, Status};
use crate::registration::Icp;
use crate::rotors::{Disc, Found};
use crate::store::{Even, WINDOW_SEGMENTS, Window};
use baselines::{REFINEMENT, REFINEMENT_PERIODS};
use doubt::{DOUBTFUL, Doubt};

/// Steps of centre and speed by the polar phase.
const NEWTON_STEPS: u8 = 6;
/// A step that moves the centre, and the rim at the window's ends, by less than this is the last.
const LAST_STEP_PX: f32 = 0.1;
/// Relative error of the speed of a rotor that is followed from window to window.
const FOLLOWING_SIGMA: f32 = 1e-3;
/// Share in step of the second best harmonic over that of the best: beyond this the pattern stands, or the centre is off.
const MOST_STANDING: f32 = 0.8;
/// Two coarse speeds contradict each other when they differ by more than half the way to the next speed that the line
/// could also mean (its frequency over one winding more), but within these shares: registration of thin
/// slices falls short of the turn by up to a tenth.
const COARSE_AGREEMENT: f32 = 0.15;
const MOST_COARSE_AGREEMENT: f32 = 0.25;
/// Two harmonics of one line differ by a fifteenth or more.
const SCAN_AGREEMENT: f32 = 0.04;
/// Events that a look at their harmonics takes in in one step: half a million instructions.
const EVENTS_A_STEP: usize = 768;
/// Fewest events of a rotor that are measured.
const LEAST_EVENTS: usize = 300;
/// Symmetry periods and revolutions that a lock needs in the window.
const LOCK_PERIODS: f32 = 3.0;
const LOCK_REVOLUTIONS: f32 = 2.0;
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

/// What the person stated.
#[derive(Clone, Copy, Debug)]
pub struct Stated {
    /// Blade count, when given.
    pub blades: Option<u8>,
    /// One standard deviation of the clock's error in ppm.
    pub clock_sigma_ppm: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    /// Collecting the rotor's events.
    Track,
    Newton,
    Scan,
    Doubt,
    Symmetry,
    Overtone,
    Pose,
    Initial,
    Refinement,
    Further,
    Lock,
    Fractional,
    Verdict,
    Done,
}

/// Memory that the stages work in.
#[derive(Debug)]
pub struct Bench {
    icp: Icp,
    sums: Sums,
    angular: AngularSums,
    /// How the events of the window are gone through.
    even: Even,
}

impl Bench {
    /// Nothing on it. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self =
        Self { icp: Icp::EMPTY, sums: Sums::EMPTY, angular: AngularSums::EMPTY, even: Even::EMPTY };

    /// Makes ready for another measurement, whatever was left half done.
    pub const fn clear(&mut self) {
        self.even = Even::EMPTY;
    }
}

/// The measurement of one rotor.
#[derive(Debug)]
pub struct Measurement {
    stage: Stage,
    /// Repetitions of the stage.
    turn: u8,
    /// Whether the rotor was locked in the window before.
    follows: bool,
    /// Whether the scan has already sent the measurement back once.
    second_look: bool,
    /// Looks about the centre for a harmonic that keeps step better.
    doubt: Option<Doubt>,
    disc: Disc,
    omega_rad_s: f32,
    /// Angular harmonic whose phase is followed.
    harmonic: u32,
    pose: Pose,
    /// Frequency and angular harmonic of the line that the rotor was found by.
    line_hz: f32,
    windings: u32,
    events: usize,
    parts: Option<u8>,
    alike: bool,
    ladder: Option<Ladder>,
    rates: Rates,
    pairs: Option<Pairs>,
    estimate: Estimate,
    status: Status,
    /// Longest baseline of the lock.
    lock_baseline_s: f32,
    alpha_rad_s2: Option<f32>,
    drift_px_s: f32,
    roll_sigma_rad_s: f32,
    /// Window in microseconds that would do for a lock.
    wanted_us: f32,
    evidence: Evidence,
}

impl Measurement {
    /// Starts the measurement of a rotor that extraction found.
    #[must_use]
    pub fn new(found: &Found) -> Self {
        Self {
            stage: Stage::Track,
            turn: 0,
            follows: false,
            second_look: false,
            doubt: None,
            disc: found.disc,
            omega_rad_s: found.omega_rad_s,
            harmonic: found.windings,
            pose: Pose::new(found.disc, found.omega_rad_s, 1, found.windings, 0),
            line_hz: found.line_hz,
            windings: found.windings,
            events: 0,
            parts: None,
            alike: true,
            ladder: None,
            rates: Rates::new(),
            pairs: None,
            estimate: Estimate::default(),
            status: Status::Refused(Reason::Searching),
            lock_baseline_s: 0.0,
            alpha_rad_s2: None,
            drift_px_s: 0.0,
            roll_sigma_rad_s: 0.0,
            wanted_us: 0.0,
            evidence: Evidence::default(),
        }
    }

    /// Starts the measurement of a rotor that was locked in the window before: its speed and blade count are
    /// known, so that the lock follows at once. The witnesses of the lock must still agree.
    #[must_use]
    pub fn follow(found: &Found, parts: Option<u8>, alike: bool) -> Self {
        let mut following = Self::new(found);
        following.follows = true;
        following.stage = Stage::Pose;
        following.parts = parts;
        following.alike = alike;
        following
    }

    /// One bounded piece of work; `true` once the result stands.
    pub fn step(
        &mut self,
        window: &Window<'_>,
        stated: &Stated,
        polar: &mut PolarTrack,
        bench: &mut Bench,
    ) -> bool {
        let Bench { icp, sums, angular, even } = bench;
        match self.stage {
            Stage::Track => self.track(window, polar, even),
            Stage::Newton => self.newton(window, polar),
            Stage::Scan => self.scan(polar, angular),
            Stage::Doubt => self.doubt(window, polar, angular, even),
            Stage::Symmetry => self.symmetry(stated, polar, angular),
            Stage::Overtone => self.overtone(polar),
            Stage::Pose => self.pose(window, sums, even),
            Stage::Initial => self.initial(window, icp),
            Stage::Refinement => self.refinement(window, icp),
            Stage::Further => self.further(window, icp),
            Stage::Lock => self.lock(window, icp),
            Stage::Fractional => self.fractional(window, icp),
            Stage::Verdict => {
                self.verdict(window, stated);
                self.stage = Stage::Done;
            }
            Stage::Done => {}
        }
        self.stage == Stage::Done
    }

    /// Name of the stage that the next step belongs to.
    #[must_use]
    pub const fn stage(&self) -> &'static str {
        match self.stage {
            Stage::Track | Stage::Newton => "centre",
            Stage::Scan | Stage::Doubt => "scan",
            Stage::Symmetry | Stage::Overtone => "symmetry",
            Stage::Pose => "pose",
            Stage::Initial => "initial",
            Stage::Refinement => "refinement",
            Stage::Further => "further refinement",
            Stage::Lock => "lock",
            Stage::Fractional => "fractional test",
            Stage::Verdict => "verdict",
            Stage::Done => "done",
        }
    }

    fn refuse(&mut self, reason: Reason) {
        self.status = Status::Refused(reason);
        self.stage = Stage::Done;
    }

    /// Collects the rotor's events, a segment at a time.
    fn track(&mut self, window: &Window<'_>, polar: &mut PolarTrack, even: &mut Even) {
        if track(window, self.disc, polar, even) {
            self.events = core::mem::take(even).count();
            self.stage = Stage::Newton;
        }
    }

    /// Centre and speed by the polar phase, a Newton step at a time.
    fn newton(&mut self, window: &Window<'_>, polar: &PolarTrack) {
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
        let coherence =
            Pattern::learn(polar, self.disc, self.omega_rad_s, self.harmonic).coherence();
        self.evidence.coherence = Some(coherence);
        if coherence < self.least_coherence() {
            return self.refuse(Reason::NoRotation);
        }
        self.turn = 0;
        self.stage = Stage::Scan;
    }

    /// Symmetry periods in the window, and the window that a lock needs.
    fn count_periods(&mut self, window: &Window<'_>) -> f32 {
        let revolutions = self.omega_rad_s.abs() * window.duration_us as f32 * 1e-6 / TAU;
        let periods = revolutions * f32::from(self.parts.unwrap_or(1));
        self.evidence.periods = Some(periods);
        let short = (LOCK_PERIODS / periods).max(LOCK_REVOLUTIONS / revolutions);
        self.wanted_us = short * window.duration_us as f32;
        periods
    }

    /// Which harmonic of the line turns about the refined centre: first coarse witness.
    fn scan(&mut self, polar: &[PolarEvent], angular: &mut AngularSums) {
        let line_hz = self.omega_rad_s.abs() * self.harmonic as f32 / TAU;
        if self.turn == 0 {
            angular.clear();
        }
        let (events, all) = self.next_events(polar);
        scan(angular, events, self.disc, line_hz);
        if !all {
            return;
        }
        let scan = harmonics(angular);
        let standing = scan.second_share / scan.share.max(1e-3);
        let rival = scan.rival_share / scan.share.max(1e-3);
        self.evidence.scan_rad_s = (scan.best != 0).then(|| self.line_hz * TAU / scan.best as f32);
        self.evidence.scan_score = Some(scan.share * scan.share * polar.len() as f32);
        self.evidence.scan_standing = Some(rival);
        if scan.best == 0 {
            return self.refuse(Reason::NoRotation);
        }
        if rival > DOUBTFUL && self.doubt.is_none() {
            self.doubt = Some(Doubt::new(self.disc, line_hz));
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
            self.turn = 0;
            self.stage = Stage::Track;
            return;
        }
        if standing > MOST_STANDING {
            return self.refuse(Reason::Ambiguous);
        }
        self.windings = self.harmonic;
        self.turn = 0;
        self.stage = Stage::Symmetry;
    }

    /// The rotor's events of the next step, and whether they are the last.
    fn next_events<'p>(&mut self, polar: &'p [PolarEvent]) -> (&'p [PolarEvent], bool) {
        let from = usize::from(self.turn) * EVENTS_A_STEP;
        let to = (from + EVENTS_A_STEP).min(polar.len());
        self.turn += 1;
        (polar.get(from..to).unwrap_or(&[]), to == polar.len())
    }

    /// Angle of symmetry.
    fn symmetry(&mut self, stated: &Stated, polar: &[PolarEvent], angular: &mut AngularSums) {
        if self.turn == 0 {
            angular.clear();
        }
        let (events, all) = self.next_events(polar);
        turn_back(angular, events, self.disc, self.omega_rad_s);
        if !all {
            return;
        }
        let symmetry = symmetry(angular);
        self.parts = stated.blades.or(symmetry.parts);
        self.alike =
            self.parts == Some(1) || stated.blades.is_none() && symmetry.score >= ALIKE_SCORE;
        self.evidence.symmetry_score = Some(symmetry.score);
        self.stage = Stage::Overtone;
    }

    /// Whether the line is an overtone of the blades' own.
    fn overtone(&mut self, polar: &[PolarEvent]) {
        if let Some(parts) = self.parts.map(u32::from).filter(|parts| *parts > 0) {
            let at =
                |harmonic| Pattern::learn(polar, self.disc, self.omega_rad_s, harmonic).coherence();
            if at(parts) > at(self.harmonic) {
                self.harmonic = parts;
            }
        }
        let rpm = self.omega_rad_s.abs() * Speed::RPM_PER_RAD_S;
        let blades = f32::from(self.parts.unwrap_or(1));
        if rpm > MOST_RPM || rpm * blades > MOST_BLADE_RPM {
            return self.refuse(Reason::TooFast);
        }
        self.turn = 0;
        self.stage = Stage::Pose;
    }

    /// Follows the rotor's pose through the window, a round at a time: second witness of the lock.
    fn pose(&mut self, window: &Window<'_>, sums: &mut Sums, even: &mut Even) {
        if self.turn == 0 {
            self.turn = 1;
            let parts = if self.alike { u32::from(self.parts.unwrap_or(1)).max(1) } else { 1 };
            let pose =
                Pose::new(self.disc, self.omega_rad_s, parts, self.harmonic, window.duration_us);
            let pose = if self.alike { pose } else { pose.unlike(self.parts.unwrap_or(1)) };
            self.pose = if self.follows { pose.known() } else { pose };
        }
        if !self.pose.step(window, sums, even) {
            return;
        }
        self.turn = 0;
        self.disc = self.pose.disc();
        self.events = self.pose.events();
        self.evidence.events = self.events as u32;
        if self.events < LEAST_EVENTS {
            return self.refuse(Reason::TooFewEvents);
        }
        if let Some(found) = self.pose.slope() {
            self.evidence.phase_rad_s = Some(found.speed.omega_rad_s);
            self.evidence.phase_sigma_rad_s = Some(found.speed.sigma_rad_s);
            self.drift_px_s = found.drift_px_s;
            self.evidence.sharpness_px = Some(self.pose.sharpness_px());
            if found.alpha_rad_s2.abs() > 4.0 * found.alpha_sigma_rad_s2 {
                self.alpha_rad_s2 = Some(found.alpha_rad_s2);
            }
        }
        if !self.has_edges() {
            return self.refuse(Reason::Ambiguous);
        }
        if !self.follows {
            self.stage = Stage::Initial;
            return;
        }
        self.evidence.coherence = Some(self.pose.first_coherence());
        if self.pose.first_coherence() < self.least_coherence() {
            return self.refuse(Reason::NoRotation);
        }
        self.count_periods(window);
        self.plan_lock(window, self.omega_rad_s.abs() * FOLLOWING_SIGMA);
        self.stage = Stage::Lock;
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

    /// Initial alignment in every other segment: second coarse witness.
    fn initial(&mut self, window: &Window<'_>, icp: &mut Icp) {
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
        if periods < COARSE_PERIODS {
            return self.refuse(Reason::TooSlow);
        }
        // Until something better: as good as the share of a period that the window shows.
        let spread = COARSE_SIGMA * self.omega_rad_s.abs() / periods;
        self.estimate = Estimate { omega_rad_s: self.omega_rad_s, sigma_rad_s: spread };
        self.status = Status::Coarse;
        if periods < 1.0 + REFINEMENT_PERIODS {
            self.stage = Stage::Verdict;
            return;
        }
        self.plan(window, REFINEMENT_PERIODS, self.worth(REFINEMENT));
        self.stage = Stage::Refinement;
    }

    /// The result, once [`Self::step`] has returned `true`.
    #[must_use]
    pub fn result(&self) -> Outcome {
        let speed = self.status.reason().is_none().then_some(Speed {
            omega_rad_s: self.estimate.omega_rad_s,
            omega_sigma_rad_s: self.estimate.sigma_rad_s,
            alpha_rad_s2: self.alpha_rad_s2,
            frame: Frame::Camera,
        });
        let knot = self.pose.path().at(0.0);
        let (x_px, y_px) = (self.disc.x_px + knot.x_px, self.disc.y_px + knot.y_px);
        Outcome {
            status: self.status,
            found: Found {
                disc: Disc { x_px, y_px, ..self.disc },
                omega_rad_s: self.omega_rad_s,
                // Low enough that what a hand moves between windows does not lead astray.
                windings: if self.alike {
                    self.harmonic.max(self.pose.harmonic() / 4)
                } else {
                    self.harmonic
                },
                line_hz: self.line_hz,
                ..Found::default()
            },
            parts: self.parts,
            alike: self.alike,
            speed,
            roll_sigma_rad_s: self.roll_sigma_rad_s,
            evidence: self.evidence,
            wanted_us: self.wanted_us,
        }
    }
}

/// Result of a measurement.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// How far the measurement got.
    pub status: Status,
    /// Refined axis and speed, to follow the rotor from.
    pub found: Found,
    /// Equal parts, where known.
    pub parts: Option<u8>,
    /// Whether the parts are alike.
    pub alike: bool,
    /// Speed relative to the camera, unless refused; camera roll is not in its error.
    pub speed: Option<Speed>,
    /// Standard deviation of the camera's mean roll rate in rad/s, from how the centre wanders.
    pub roll_sigma_rad_s: f32,
    /// What each stage found.
    pub evidence: Evidence,
    /// Window in microseconds that a lock needs, 0 when the speed is not known.
    pub wanted_us: f32,
}

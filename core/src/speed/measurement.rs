//! The measurement of one rotor in one window, step by step: the paper's stages and the lock beyond them.

mod baselines;
mod coarse;
mod doubt;
mod edges;
mod error_bar;
mod recovery;
mod verdict;

use super::angular::AngularSums;
use super::baseline::{Estimate, Pairs};
use super::filling::{Filled, Filling};
use super::initial::{Ladder, Rates};
use super::path::Path;
use super::phase::Pattern;
use super::polar::{PolarEvent, PolarTrack, track};
use super::pose::{MOVING_PX_S, Pose, Sums, Tilt};
use super::statistics::root_mean_square;
use crate::math::TAU;
use crate::reading::{Evidence, Frame, Reason, Speed, Status};
use crate::registration::Icp;
use crate::rotors::{Disc, Found};
use crate::settings::Settings;
use crate::store::{Even, Window};
use doubt::Doubt;

/// Standard errors that an acceleration stands out by.
const ACCELERATION_SIGMAS: f32 = 4.0;
/// Fewest equal parts that tell a tilt from an uneven turn.
const TILTED_PARTS: u8 = 3;
/// Relative error of the speed of a rotor that is followed from window to window.
const FOLLOWING_SIGMA: f32 = 1e-3;
/// Fewest events of a rotor that are measured.
const LEAST_EVENTS: usize = 200;
/// Symmetry periods and revolutions that a lock needs in the window.
const LOCK_PERIODS: f32 = 3.0;
const LOCK_REVOLUTIONS: f32 = 2.0;
/// A window may be as much shorter than what is wanted.
pub const ENOUGH: f32 = 1.02;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    /// Collecting the rotor's events.
    Track,
    Newton,
    Scan,
    Doubt,
    Around,
    Symmetry,
    Overtone,
    Recovery,
    Pose,
    Initial,
    Refinement,
    Further,
    Lock,
    Fractional,
    Queue,
    Verdict,
    Done,
}

/// Memory that the stages work in.
#[derive(Debug)]
pub struct Bench {
    icp: Icp,
    sums: Sums,
    /// The way of an axis that may have stood still, until that is decided.
    walked: Path,
    angular: AngularSums,
    /// How the events of the window are gone through.
    even: Even,
    /// How a readout's queue filled, as far as the window was asked.
    filling: Filling,
}

impl Bench {
    /// Nothing on it. A constant, so that it is copied into place instead of being built on the stack.
    pub const EMPTY: Self = Self {
        icp: Icp::EMPTY,
        sums: Sums::EMPTY,
        walked: Path::UNSET,
        angular: AngularSums::EMPTY,
        even: Even::EMPTY,
        filling: Filling::EMPTY,
    };

    /// Makes ready for another measurement, whatever was left half done.
    pub const fn clear(&mut self) {
        self.even = Even::EMPTY;
        self.filling = Filling::EMPTY;
    }
}

/// The measurement of one rotor.
#[derive(Debug)]
pub struct Measurement {
    stage: Stage,
    /// Frequency at which all that is seen flickers, 0 for none.
    lamp_hz: f32,
    /// Whether a lamp lights it: this one, or one whose events are out of sight.
    by_lamp: bool,
    /// Repetitions of the stage.
    turn: u8,
    /// Whether the rotor was locked in the window before.
    follows: bool,
    /// Whether the scan has already sent the measurement back once.
    second_look: bool,
    /// Looks about the centre for a harmonic that keeps step better.
    doubt: Option<Doubt>,
    /// Whether it is the rival of what was refused.
    is_rival: bool,
    disc: Disc,
    omega_rad_s: f32,
    /// Whether few of its events keep step.
    faint: bool,
    /// Angular harmonic whose phase is followed.
    harmonic: u32,
    /// Whether polarities were the other way round in parts of it, in any window.
    sided: bool,
    tilt: Option<Tilt>,
    pose: Pose,
    /// Angular harmonic that the recovery is asked with.
    windings: u32,
    /// Share in step with that line without windings, and with as many the other way, over its own.
    other_windings: [f32; 2],
    events: usize,
    parts: Option<u8>,
    alike: bool,
    ladder: Option<Ladder>,
    rates: Rates,
    pairs: Option<Pairs>,
    estimate: Estimate,
    status: Status,
    /// How a readout's queue filled as the window began, and whether it is seen to have done so.
    filling: Filled,
    filled: bool,
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
    /// Starts the measurement of a rotor that extraction found, by the light of a lamp of this frequency, or of none that the search saw
    /// flicker: 0; `dark` where a lamp's events are out of sight.
    #[must_use]
    pub fn new(found: &Found, lamp_hz: f32, dark: bool) -> Self {
        Self {
            lamp_hz,
            by_lamp: dark || lamp_hz > 0.0,
            stage: Stage::Track,
            turn: 0,
            follows: false,
            second_look: found.rival,
            doubt: None,
            is_rival: found.rival,
            disc: found.disc,
            omega_rad_s: found.omega_rad_s,
            faint: false,
            harmonic: found.windings,
            pose: Pose::new(found.disc, found.omega_rad_s, 1, found.windings, 0),
            sided: found.sided,
            tilt: found.tilt,
            windings: found.windings,
            other_windings: [0.0; 2],
            events: 0,
            parts: None,
            alike: true,
            ladder: None,
            rates: Rates::new(),
            pairs: None,
            estimate: Estimate::default(),
            status: Status::Refused(Reason::Searching),
            filling: Filled::default(),
            filled: false,
            lock_baseline_s: 0.0,
            alpha_rad_s2: None,
            drift_px_s: found.drift_px_s,
            roll_sigma_rad_s: 0.0,
            wanted_us: 0.0,
            evidence: Evidence::default(),
        }
    }

    /// Starts the measurement of a rotor that was locked in the window before: its speed and blade count are
    /// known, so that the lock follows at once. The witnesses of the lock must still agree.
    #[must_use]
    pub fn follow(found: &Found, parts: Option<u8>, alike: bool) -> Self {
        let mut following = Self::new(found, 0.0, false);
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
        settings: &Settings,
        polar: &mut PolarTrack,
        bench: &mut Bench,
    ) -> bool {
        let Bench { icp, sums, walked, angular, even, filling } = bench;
        match self.stage {
            Stage::Track => self.track(window, polar, even),
            Stage::Newton => self.newton(window, polar),
            Stage::Scan => self.scan(polar, angular),
            Stage::Doubt => self.doubt(window, polar, angular, even),
            Stage::Around => self.around(settings, polar),
            Stage::Symmetry => self.symmetry(settings, polar, angular),
            Stage::Overtone => self.overtone(polar, angular),
            Stage::Recovery => self.recovery(window, polar),
            Stage::Pose => self.pose(window, sums, walked, even),
            Stage::Initial => self.initial(window, icp),
            Stage::Refinement => self.refinement(window, settings, icp),
            Stage::Further => self.further(window, icp),
            Stage::Lock => self.lock(window, icp),
            Stage::Fractional => self.fractional(window, icp),
            Stage::Queue => self.queue(window, filling, angular),
            Stage::Verdict => {
                self.verdict(window, settings);
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
            Stage::Scan | Stage::Doubt | Stage::Around => "scan",
            Stage::Symmetry | Stage::Overtone => "symmetry",
            Stage::Recovery => "recovery",
            Stage::Pose => "pose",
            Stage::Initial => "initial",
            Stage::Refinement => "refinement",
            Stage::Further => "further refinement",
            Stage::Lock => "lock",
            Stage::Fractional => "fractional test",
            Stage::Queue | Stage::Verdict => "verdict",
            Stage::Done => "done",
        }
    }

    /// Share of the events that keep step with a speed in an angular harmonic, 0 to 1.
    // Not inlined: flash is short.
    #[inline(never)]
    fn in_step(&self, polar: &[PolarEvent], omega_rad_s: f32, harmonic: u32) -> f32 {
        self.coherence(polar, omega_rad_s, harmonic).0
    }

    /// The same, and the share of the disc's radius within which they lie.
    // Not inlined: flash is short.
    #[inline(never)]
    fn coherence(&self, polar: &[PolarEvent], omega_rad_s: f32, harmonic: u32) -> (f32, f32) {
        Pattern::learn(polar, self.disc, omega_rad_s, harmonic).coherence()
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

    /// Symmetry periods in the window, and the window that a lock needs.
    // Not inlined: flash is short.
    #[inline(never)]
    fn count_periods(&mut self, window: &Window<'_>) -> f32 {
        let revolutions = self.omega_rad_s.abs() * window.duration_us as f32 * 1e-6 / TAU;
        let periods = revolutions * f32::from(self.parts.unwrap_or(1));
        self.evidence.periods = Some(periods);
        let short = (LOCK_PERIODS / periods).max(LOCK_REVOLUTIONS / revolutions);
        self.wanted_us = short * window.duration_us as f32;
        periods
    }

    /// Whether the axis moves in the picture, as far as was seen.
    fn moves(&self) -> bool {
        self.drift_px_s > MOVING_PX_S
    }

    /// Follows the rotor's pose through the window, a round at a time: second witness of the lock.
    fn pose(&mut self, window: &Window<'_>, sums: &mut Sums, walked: &mut Path, even: &mut Even) {
        if self.turn == 0 {
            self.turn = 1;
            let parts = if self.alike { u32::from(self.parts.unwrap_or(1)).max(1) } else { 1 };
            let pose =
                Pose::new(self.disc, self.omega_rad_s, parts, self.harmonic, window.duration_us);
            // Where parts were not counted, each winding of what keeps step may be one.
            let unlike = self.parts.map_or(self.windings, u32::from);
            let pose = if self.alike { pose } else { pose.unlike(unlike) };
            let tells = self.parts.is_some_and(|parts| parts >= TILTED_PARTS) && !self.doubted();
            let known = self.follows && (self.tilt.is_some() || !tells);
            let pose = if tells { pose.tilted(self.tilt.unwrap_or_default()) } else { pose };
            self.pose = if known { pose.known(self.moves(), self.sided) } else { pose };
        }
        if !self.pose.step(window, sums, walked, even) {
            return;
        }
        self.turn = 0;
        self.disc = self.pose.disc();
        self.sided |= self.pose.sided();
        self.events = self.pose.events();
        self.evidence.events = self.events as u32;
        if self.events < LEAST_EVENTS {
            return self.refuse(Reason::TooFewEvents);
        }
        if let Some(found) = self.pose.slope() {
            self.evidence.phase_rad_s = Some(found.speed.omega_rad_s);
            self.evidence.phase_sigma_rad_s = Some(found.speed.sigma_rad_s);
            self.evidence.swing_rad_s = Some(found.swing_rad_s);
            // A hand that holds still for a window trembles in the next.
            let before_px_s = if self.follows { self.drift_px_s } else { found.drift_px_s };
            self.drift_px_s = root_mean_square(before_px_s, found.drift_px_s);
            self.evidence.sharpness_px = Some(self.pose.sharpness_px());
            if found.alpha_rad_s2.abs() > ACCELERATION_SIGMAS * found.alpha_sigma_rad_s2 {
                self.alpha_rad_s2 = Some(found.alpha_rad_s2);
            }
        }
        if !self.has_edges(window.ignores_polarity) || self.strayed() {
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
        // The next window's middle lies about a third of this one later.
        let grown = 1.0 + self.pose.approach().growth / 3.0;
        let guessed = matches!(self.status, Status::Refused(Reason::Ambiguous | Reason::TooSlow));
        let nothing = self.faint && guessed;
        Outcome {
            status: if nothing { Status::Refused(Reason::NoRotation) } else { self.status },
            found: Found {
                disc: Disc { x_px, y_px, radius_px: self.disc.radius_px * grown },
                omega_rad_s: self.omega_rad_s,
                // Low enough that what a hand moves in a window does not lead astray.
                windings: if !self.alike {
                    self.harmonic
                } else if self.moves() {
                    self.parts.filter(|parts| *parts > 1).map_or(self.harmonic, u32::from)
                } else {
                    self.harmonic.max(self.pose.harmonic() / 4)
                },
                sided: self.sided,
                tilt: self.pose.tilt(),
                drift_px_s: self.drift_px_s,
                ..Found::default()
            },
            parts: self.parts,
            alike: self.alike,
            lapsed: self.pose.lapsed() && !self.filled,
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
    /// Whether it was out of step for a part of the window: then its speed holds for the rest, and is not told as that of the window.
    pub lapsed: bool,
    /// Speed relative to the camera, unless refused; camera roll is not in its error.
    pub speed: Option<Speed>,
    /// Standard deviation of the camera's mean roll rate in rad/s, from how the centre wanders.
    pub roll_sigma_rad_s: f32,
    /// What each stage found.
    pub evidence: Evidence,
    /// Window in microseconds that a lock needs, 0 when the speed is not known.
    pub wanted_us: f32,
}

//! Whether a rotor shows edges: by how many of its events keep step, by how sharply they show what turns, and by what jitter leaves of
//! that.

use super::Measurement;
use super::doubt::SMALL_PX;
use crate::math::TAU;

/// A rotor keeps at least this share of its events in step, if they have no jitter.
const LEAST_COHERENCE: f32 = 0.2;
/// One of fewer than so many times that is faint: unless it is read, nothing says that it turns.
const FAINT: f32 = 1.5;
/// Blur of the rotor's edges, as a share of its radius and in pixels for a small one, beyond which they are no edges;
/// and within which they are so sharp that a registration that went astray does not count against them, nor a doubtful harmonic
/// without polarity.
const MOST_BLUR: (f32, f32) = (0.1, 1.5);
const LEAST_BLUR: (f32, f32) = (0.06, 1.3);
/// Blur beyond which a single mark without polarity, whose axis moves little, shows no edges: its leading edge is matched with its trailing one,
/// half of its width from either. What a table shakes is spread over the whole radius.
const MOST_MARK_BLUR: (f32, f32) = (0.25, 1.5);
/// Blur, noise and all, beyond which they are none where another harmonic keeps step.
const MOST_RIVALLED_BLUR: (f32, f32) = (0.11, 1.65);
/// The same in windings, of what could not be counted and is in doubt: of wheels of nine to sixteen parts in a hand, small ones, wrong
/// harmonics had 0.49 to 0.9, nearly all more than 0.55. The same of what may be how a table shakes, which had 0.59 or more.
const MOST_UNCOUNTED_BLUR: f32 = 0.5;
/// The same below which parts that were counted and have an overtone have edges, however large a share of the radius that is: 0.1 of it
/// is this for four blades, and half of this for two.
const CLEAR_BLUR: f32 = 0.4;
/// Frequencies by which a table shakes by a pixel, or a few times its motor's, and a winding in pixels, see `winding_px`, in which edges that
/// shake are mistaken for the next ones.
const LEAST_SHAKING_HZ: f32 = 30.0;
const MOST_SHAKING_HZ: f32 = 600.0;
const SHAKEN_PX: f32 = 3.0;
/// Standard deviation of the events' times in dim light, and in bright light.
const MOST_JITTER_S: f32 = 200e-6;
const LEAST_JITTER_S: f32 = 40e-6;
/// Scatter of a phase by that jitter beyond which a registration is not believed where it contradicts.
const MOST_SCATTER_RAD: f32 = 0.8;
/// The same beyond which it leaves no edge: half an octave past the harmonic that it shows best.
const NO_EDGE_RAD: f32 = 1.41;
/// Share of the speed that it swings by within a window where a motor hunts: what a hand makes of a mark at 1500 rpm is half of that.
const HUNTING: f32 = 0.01;
/// Blur that a jitter of one pixel makes as the pose measures it, where the harmonic rises by doubling: up to half an octave
/// past the best, where 1 / (m exp(-m^2 / 2)) is 1.9.
const BLUR_OF_JITTER: f32 = 1.9;

impl Measurement {
    /// Whether jitter may scatter the blades' edges over so much of their distance that a registration matches noise: no overtone is
    /// left of them. Then the phase alone tells, by all events of the window; but not where a neighbour of the harmonic may keep
    /// step alone, as it does about the centre of a small rotor.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn registers(&self) -> bool {
        let in_step_alone = self.doubted() || self.disc.radius_px < SMALL_PX;
        self.scatter_rad() < MOST_SCATTER_RAD || self.pose.has_overtone() || in_step_alone
    }

    /// By how much the jitter of dim light scatters the phase that is followed: sigma scatters a phase of m w t by m w sigma.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn scatter_rad(&self) -> f32 {
        self.harmonic as f32 * self.omega_rad_s.abs() * MOST_JITTER_S
    }

    /// Share of the events that a rotor of this speed keeps in step at least.
    pub(super) fn least_coherence(&self) -> f32 {
        let scatter_rad = self.scatter_rad();
        // exp(-x^2 / 2) to a few percent, and never zero.
        let kept = 1.0 / (1.0 + 0.25 * scatter_rad * scatter_rad);
        LEAST_COHERENCE * kept * kept
    }

    /// Whether so few events keep step that only a reading shows a rotor.
    pub(super) fn is_faint(&self, coherence: f32) -> bool {
        coherence < FAINT * self.least_coherence()
    }

    /// Whether the rotor has edges: what merely keeps step with one frequency has none, and a wrong harmonic about a wrong centre has no
    /// overtone.
    ///
    /// A wrong harmonic blurs them, too: where another one keeps step at all, noise is no excuse, nor is the jitter of dim light where that
    /// of a rotor that is not small is in doubt. Without polarity leading edges are matched with trailing ones, and what could not be counted
    /// may be a winding more than there are blades: only sharp ones tell. Few blades have edges all the same that a share of the radius
    /// calls blurred.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn has_edges(&self, ignores_polarity: bool) -> bool {
        if self.in_doubt() || self.may_be_shaken() {
            return false;
        }
        let radius_px = self.disc.radius_px;
        let most_px = if !self.doubted() {
            self.blur_px(MOST_RIVALLED_BLUR, MOST_JITTER_S)
        } else if ignores_polarity {
            share_px(LEAST_BLUR, radius_px)
        } else if self.parts.is_none() {
            share_px(LEAST_BLUR, radius_px).min(MOST_UNCOUNTED_BLUR * self.winding_px())
        } else if radius_px >= SMALL_PX {
            self.blur_px(MOST_RIVALLED_BLUR, LEAST_JITTER_S)
        } else {
            self.blur_px(MOST_RIVALLED_BLUR, MOST_JITTER_S)
        };
        let sharp = !self.rivalled() || self.pose.sharpness_px() < most_px;
        let both_edges = ignores_polarity && self.parts == Some(1) && !self.moves();
        let most = if both_edges { MOST_MARK_BLUR } else { MOST_BLUR };
        self.too_fast_for_edges()
            || self.is_clear(ignores_polarity)
            || self.edges_px() < self.blur_px(most, MOST_JITTER_S) && sharp
    }

    /// Whether what keeps step may be how a table shakes a slow rotor: about a centre that is a little off, edges that go to and fro look as
    /// if the next ones came, and another harmonic shows as well. They are blurred by half the way to the next or more, which so close
    /// together is sharp in pixels all the same.
    fn may_be_shaken(&self) -> bool {
        let line_hz = self.omega_rad_s.abs() * self.harmonic as f32 / TAU;
        (LEAST_SHAKING_HZ..MOST_SHAKING_HZ).contains(&line_hz)
            && self.winding_px() < SHAKEN_PX
            && self.doubted()
            && !self.has_overtone_within(MOST_UNCOUNTED_BLUR)
    }

    /// Whether so many events keep step as do at this speed, which was asked before, and no more is to be seen.
    // Not inlined: flash is short.
    #[inline(never)]
    fn too_fast_for_edges(&self) -> bool {
        self.scatter_rad() > NO_EDGE_RAD && !self.doubted()
    }

    /// Whether the edges are so sharp that a registration that went astray does not count against them. Noise, which leads it
    /// astray, is no blur where no other harmonic keeps step.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn sharp(&self) -> bool {
        let blur_px = if self.doubted() { self.pose.sharpness_px() } else { self.edges_px() };
        self.too_fast_for_edges() || blur_px < self.blur_px(LEAST_BLUR, MOST_JITTER_S)
    }

    /// The same with noise and jitter as no excuse.
    pub(super) fn clearly_sharp(&self) -> bool {
        self.pose.sharpness_px() < share_px(LEAST_BLUR, self.disc.radius_px)
    }

    /// Whether the path of a motor that hunts, which is followed, leaves its edges blurred, and the finer harmonic that the window before
    /// kept step with out of step: it went astray. Measured afresh, the rotor is found again.
    pub(super) fn strayed(&self) -> bool {
        let least_rad_s = HUNTING * self.omega_rad_s.abs();
        self.follows
            && self.evidence.swing_rad_s.unwrap_or_default() > least_rad_s
            && !(self.sharp() && self.pose.has_overtone())
    }

    /// Whether parts that were counted show edges between one and the next, noise and all; a single mark has no next one. Two that differ may
    /// be one, but no mark in a hand is known that was told wrong by its clear edges, and two blades of few turns look different.
    fn is_clear(&self, ignores_polarity: bool) -> bool {
        self.parts.is_some_and(|parts| parts > 1)
            && self.harmonic > 1
            && !(ignores_polarity && self.doubted())
            && self.has_overtone_within(CLEAR_BLUR)
    }

    /// Whether there is an overtone, blurred by less than so many windings.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn has_overtone_within(&self, windings: f32) -> bool {
        self.pose.has_overtone() && self.pose.sharpness_px() < windings * self.winding_px()
    }

    /// Radius over the harmonic in pixels: what is from one blade to the next half-way to the rim, over pi.
    pub(super) fn winding_px(&self) -> f32 {
        self.disc.radius_px / self.harmonic as f32
    }

    /// How sharp the edges are. A single mark is told from its axis's shaking by its sharpness alone, so noise counts against it.
    // Not inlined: flash is short.
    #[inline(never)]
    fn edges_px(&self) -> f32 {
        if self.parts == Some(1) { self.pose.sharpness_px() } else { self.pose.blur_px() }
    }

    // Not inlined: flash is short.
    #[inline(never)]
    fn blur_px(&self, most: (f32, f32), jitter_s: f32) -> f32 {
        let radius_px = self.disc.radius_px;
        let jitter_px = 0.5 * radius_px * self.omega_rad_s.abs() * jitter_s;
        share_px(most, radius_px) + BLUR_OF_JITTER * jitter_px
    }
}

/// A share of the radius, but at least so many pixels.
fn share_px((share, px): (f32, f32), radius_px: f32) -> f32 {
    (share * radius_px).max(px)
}

//! Rotors over a series of readings: identity and what is known of them.

use heapless::Vec;

use crate::limits::MAX_ROTORS;
use crate::math::sqrt;
use crate::reading::{Reason, Speed, Status};
use crate::rotors::{Disc, Found};
use crate::speed::measurement::Outcome;

/// Readings that a rotor's letter is kept for after it was last seen; then another may get it.
pub const LETTER_READINGS: u8 = 20;
/// A speed may differ from the one that the beginning of its window told by this much, relative, by so many standard errors, and by what both
/// accelerations make of the time between: what differs by more tells that one of them is wrong.
const MOST_JUMP: f32 = 0.02;
const JUMP_SIGMAS: f32 = 6.0;

/// A speed that was measured, and when: low bits of microseconds.
#[derive(Clone, Copy, Debug)]
struct Told {
    omega_rad_s: f32,
    sigma_rad_s: f32,
    alpha_rad_s2: f32,
    start_us: u32,
    middle_us: u32,
}

impl Told {
    /// Nothing, which contradicts nothing.
    const NOTHING: Self = Self {
        omega_rad_s: 0.0,
        sigma_rad_s: f32::INFINITY,
        alpha_rad_s2: 0.0,
        start_us: 0,
        middle_us: 0,
    };

    fn new(speed: Speed, start_us: u64, duration_us: u32) -> Self {
        let start_us = start_us as u32;
        Self {
            omega_rad_s: speed.omega_rad_s,
            sigma_rad_s: speed.omega_sigma_rad_s,
            alpha_rad_s2: speed.alpha_rad_s2.unwrap_or(0.0),
            start_us,
            middle_us: start_us.wrapping_add(duration_us / 2),
        }
    }

    /// Whether the speed of a longer window that began with this one's events cannot be right if this one is. Not where the window has
    /// moved on: a motor may hunt.
    fn contradicts(&self, longer: &Self) -> bool {
        let apart_s = longer.middle_us.wrapping_sub(self.middle_us) as f32 * 1e-6;
        let alpha_rad_s2 = self.alpha_rad_s2.abs() + longer.alpha_rad_s2.abs();
        let (a, b) = (self.sigma_rad_s, longer.sigma_rad_s);
        let most_rad_s = MOST_JUMP * self.omega_rad_s.abs()
            + JUMP_SIGMAS * sqrt(a * a + b * b)
            + alpha_rad_s2 * apart_s;
        self.start_us == longer.start_us
            && (longer.omega_rad_s - self.omega_rad_s).abs() > most_rad_s
    }
}

/// A rotor that was seen.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Identity: 0 is shown as "A".
    pub id: u8,
    /// Axis and speed when last seen.
    pub found: Found,
    /// Equal parts.
    pub parts: Option<u8>,
    /// Whether the parts are alike.
    pub alike: bool,
    /// How far its measurement got when it was last seen.
    status: Status,
    /// Readings since it was last seen; 0 = in the last one.
    missed: u8,
    /// Its speed when that was last measured.
    told: Told,
}

impl Known {
    /// Whether the last reading saw it.
    #[must_use]
    pub const fn is_seen(&self) -> bool {
        self.missed == 0
    }

    /// Whether the last reading saw it and could not tell its speed.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        self.is_seen() && self.status == Status::Refused(Reason::Ambiguous)
    }

    /// Whether the last reading locked it, so that it can be followed: what was only suspected is not.
    #[must_use]
    pub fn can_be_followed(&self) -> bool {
        self.is_seen() && self.status == Status::Locked
    }

    /// What is measured afresh where the last reading saw a rotor and this window has none in its place, even if a search misses
    /// it: by its parts, which keep step also where its speed is not known so well yet.
    #[must_use]
    pub fn afresh(&self) -> Option<Found> {
        let windings = self.parts.map_or(self.found.windings, u32::from);
        self.is_seen().then_some(Found { windings, ..self.found })
    }

    /// What is measured again in the very next window, search or not: a speed that was told must not come and go.
    #[must_use]
    pub fn told(&self) -> Option<Found> {
        self.afresh().filter(|_| self.status == Status::Coarse)
    }
}

/// The rotors seen so far.
#[derive(Debug, Default)]
pub struct Tracker {
    known: Vec<Known, MAX_ROTORS>,
}

impl Tracker {
    /// The rotors seen so far.
    #[must_use]
    pub fn known(&self) -> &[Known] {
        &self.known
    }

    /// Starts a new reading: whoever is not seen in it has been missed once more.
    pub fn start_reading(&mut self) {
        for known in &mut self.known {
            known.missed = known.missed.saturating_add(1);
        }
        self.known.retain(|known| known.missed <= LETTER_READINGS);
    }

    /// The letter of a rotor: that of the nearest known one within half a radius, else the first free. Where its speed contradicts what the
    /// beginning of the same window told before, it is refused: which of the two is right, the next one tells.
    pub fn identify(&mut self, outcome: &mut Outcome, start_us: u64, duration_us: u32) -> u8 {
        let now = outcome.speed.map(|speed| Told::new(speed, start_us, duration_us));
        let disc = outcome.found.disc;
        let near = |known: &Disc| {
            let reach = 0.5 * disc.radius_px.max(known.radius_px);
            disc.distance2(known) < reach * reach
        };
        let nearest =
            self.known.iter_mut().filter(|known| near(&known.found.disc)).min_by(|a, b| {
                disc.distance2(&a.found.disc).total_cmp(&disc.distance2(&b.found.disc))
            });
        if let Some(known) = nearest {
            if now.is_some_and(|now| known.told.contradicts(&now)) {
                outcome.status = Status::Refused(Reason::Ambiguous);
                outcome.speed = None;
            }
            known.told = now.unwrap_or(known.told);
            known.found = outcome.found;
            known.parts = outcome.parts;
            known.alike = outcome.alike;
            known.status = outcome.status;
            known.missed = 0;
            return known.id;
        }
        let taken = |id: u8| self.known.iter().any(|known| known.id == id);
        let id = (0..=u8::MAX).find(|id| !taken(*id)).unwrap_or(u8::MAX);
        if self.known.is_full()
            && let Some(oldest) =
                self.known.iter().enumerate().max_by_key(|(_, k)| k.missed).map(|(i, _)| i)
        {
            self.known.swap_remove(oldest);
        }
        let told = now.unwrap_or(Told::NOTHING);
        let Outcome { found, parts, alike, status, .. } = *outcome;
        self.known.push(Known { id, found, parts, alike, status, missed: 0, told }).ok();
        id
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reading::Frame;

    fn told(omega_rad_s: f32, alpha_rad_s2: Option<f32>, start_us: u64, window_us: u32) -> Told {
        let speed =
            Speed { omega_rad_s, omega_sigma_rad_s: 0.01, alpha_rad_s2, frame: Frame::Camera };
        Told::new(speed, start_us, window_us)
    }

    /// Whether 100 rad/s, told of 150 ms, are contradicted by what is told of the 300 ms that begin so much later.
    fn contradicted(start_us: u64, later_us: u64, omega_rad_s: f32, alpha: Option<f32>) -> bool {
        let longer = told(omega_rad_s, alpha, start_us + later_us, 300_000);
        told(100.0, None, start_us, 150_000).contradicts(&longer)
    }

    #[test]
    fn a_window_that_holds_all_of_another_does_not_tell_another_speed() {
        // Also where the low bits of the time wrap meanwhile.
        for start_us in [0, u64::from(u32::MAX) - 100_000] {
            assert!(contradicted(start_us, 0, 103.0, None));
            assert!(contradicted(start_us, 0, -100.0, None));
            assert!(!contradicted(start_us, 0, 101.5, None));
            assert!(!contradicted(start_us, 50_000, 103.0, None));
        }
    }

    #[test]
    fn what_accelerates_may_differ() {
        // 7.5 rad/s within the 75 ms between the middles.
        assert!(contradicted(0, 0, 105.0, Some(20.0)));
        assert!(!contradicted(0, 0, 105.0, Some(100.0)));
    }

    #[test]
    fn what_is_rough_may_differ() {
        let rough = Told { sigma_rad_s: 1.0, ..told(105.0, None, 0, 300_000) };
        assert!(!told(100.0, None, 0, 150_000).contradicts(&rough));
        assert!(!Told::NOTHING.contradicts(&rough));
    }
}

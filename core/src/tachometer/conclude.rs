//! From outcomes to a reading, and on to the next window.

use heapless::Vec;

use super::beside::GROWTH;
use super::{BASE_WINDOW_US, Job, LONGEST_WINDOW_US, Stretch, Tachometer, segment_us};
use crate::limits::MAX_ROTORS;
use crate::math::larger;
use crate::order::sort_few;
use crate::reading::{Evidence, Frame, Reading, Reason, RotorReading, Status};
use crate::rotors::Disc;
use crate::speed::measurement::{ENOUGH, Outcome};
use crate::store::{Account, WINDOW_SEGMENTS};

/// Windows that an adapting window steps through.
const WINDOWS_US: [u32; 9] = [
    BASE_WINDOW_US,
    200_000,
    300_000,
    400_000,
    600_000,
    800_000,
    1_200_000,
    1_600_000,
    LONGEST_WINDOW_US,
];
/// Readings until the whole image is searched again, while a rotor is in view that is not locked.
const SEARCH_AGAIN: u8 = 2;
/// Fewest events in a window that are looked at.
const LEAST_EVENTS: u64 = 300;

/// Longest windows that are refused before the window begins short again, and that show nothing: two seconds show no blades that
/// pass more than 256 times a second. What turns slowly shows in part of one, and then has the next ones, which move on by a third.
const MOST_REFUSED: u8 = 3;
const MOST_NOTHING: u8 = 1;
/// Share of a window that grew while nothing turned, from which on it is as long as what turns there wants it.
const MOST_OF_GROWN: f32 = 0.5;
/// Segments that a window is measured in, at most, before it begins short again: two thirds of a second behind the longest, 140 million
/// instructions of a device.
const SEGMENTS_MEASURING: usize = 2;

/// How long a window rotors want, in microseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wants {
    /// Longest that any wants, that any wants that is not locked, and that any wants that has a speed.
    pub all_us: f32,
    pub unlocked_us: f32,
    pub read_us: f32,
    /// Whether all are locked.
    pub all_locked: bool,
}

impl Tachometer<'_> {
    /// Turns the outcomes into a reading and moves the window on. None comes of a window in which it was only caught up with what came
    /// while another was measured, and what is followed was not to be seen: that is sparser, and the next one tells. Nor of one that is
    /// long to look beside what is locked, and loses that, nor of one that grew before what turns in it came into view.
    pub(super) fn conclude(&mut self) -> Option<Reading> {
        if core::mem::take(&mut self.lost) {
            self.outcomes.clear();
            self.move_on(None);
            return None;
        }
        let segments = self.window_segments;
        let account = self.store.account(segments);
        let window = self.store.window(segments, self.window_end_us);
        let (start_us, window_us) = (window.start_us, window.duration_us);
        self.tracker.start_reading();
        let (offset_rad_s, sigma_rad_s) = account.rolled.offset(self.settings.gyro_sigma_rad_s);
        let roll = account.roll_rad_s().map(|heard| (heard - offset_rad_s, sigma_rad_s));
        let mut rotors = Vec::<RotorReading, MAX_ROTORS>::new();
        for outcome in &mut self.outcomes {
            let id = self.tracker.identify(outcome, start_us, window_us);
            rotors.push(rotor_reading(id, outcome, self.settings.blades, roll)).ok();
        }
        // What rested for a part of the window, or turned with another speed there, is followed all the same, but not told. Nor is what
        // few events are left of: those that go missing every so often leave another speed.
        let known = self.best_status(&account, &rotors);
        let mostly_lost = account.is_mostly_lost();
        let untold = if mostly_lost { Reason::Saturated } else { Reason::Ambiguous };
        for (rotor, outcome) in rotors.iter_mut().zip(&self.outcomes) {
            if (outcome.lapsed || mostly_lost) && rotor.speed.take().is_some() {
                rotor.status = Status::Refused(untold);
            }
        }
        sort_few(&mut rotors, |a, b| a.id < b.id);
        if self.dark && !rotors.iter().any(|rotor| rotor.status == Status::Locked) {
            // By the lamp's light the next window may show more: what passes about as often as it flickers, or makes few events.
            self.dark = false;
            self.store.lighten();
        }
        let status = self.best_status(&account, &rotors);
        // What was locked and does not lock in a window that is long for the sake of something else is told by the next short one.
        let lost_to_look = self.looks_beside() && known != Status::Locked;
        self.move_on(Some(known));
        // Of what came into view late this window may hold little, and much of what a hand moved there before, which leads path and
        // registrations astray together: the short one that begins now tells.
        let came_late = self.anew_us.is_some() && self.stretch == Stretch::Tried;
        self.satisfied &= !came_late;
        (!lost_to_look && !came_late).then_some(Reading {
            t_us: start_us + u64::from(window_us / 2),
            window_us,
            events: account.counted,
            thinned: account.counted - account.kept,
            lost: account.lost,
            status,
            rotors,
        })
    }

    /// The best status among the rotors, or why there is none.
    // Not inlined: flash is short.
    #[inline(never)]
    fn best_status(&self, account: &Account, rotors: &[RotorReading]) -> Status {
        let has = |status: Status| rotors.iter().any(|rotor| rotor.status == status);
        let told = rotors.iter().any(|rotor| rotor.speed.is_some());
        if account.is_mostly_lost() && !told {
            Status::Refused(Reason::Saturated)
        } else if account.counted == 0 {
            Status::Refused(Reason::NoEvents)
        } else if account.counted < LEAST_EVENTS && !told {
            Status::Refused(Reason::TooFewEvents)
        } else if has(Status::Locked) {
            Status::Locked
        } else if has(Status::Coarse) {
            Status::Coarse
        } else if let Some(first) = rotors.first() {
            first.status
        } else {
            Status::Refused(if self.too_fast {
                Reason::TooFast
            } else if self.lamp_hz > 0.0 {
                Reason::Flicker
            } else {
                Reason::NoRotation
            })
        }
    }

    /// Chooses the next window: longer while a rotor or the search needs it, else a hop further.
    fn move_on(&mut self, status: Option<Status>) {
        self.window_segments = 0;
        self.job = Job::Idle;
        let caught_up = core::mem::take(&mut self.catching_up);
        let goes_on = self.store.release();
        if !goes_on {
            self.fade(WINDOW_SEGMENTS);
        }
        let locked = status == Some(Status::Locked);
        let window_us = (segment_us(self.target_us) * WINDOW_SEGMENTS as u32) as f32;
        let adapts = self.settings.window_us.is_none();
        let longest = segment_us(self.target_us) >= segment_us(LONGEST_WINDOW_US);
        let short_again =
            adapts && status.is_some() && self.look_beside(window_us, locked, longest);
        let looks_beside = self.looks_beside();
        let wants = self.wants();
        // Not where another rotor would have been read in a longer one.
        self.satisfied = locked && !looks_beside && wants.unlocked_us <= window_us;
        if short_again {
            self.target_us = BASE_WINDOW_US;
        }
        if !wants.all_locked {
            self.until_search = self.until_search.min(SEARCH_AGAIN);
        }
        if self.overrun {
            // There is a hole behind what is stored.
            self.begin_anew(self.last_us);
            return;
        }
        if caught_up && !locked && self.is_behind() {
            // Else a rotor that does not lock in long windows would never be seen in a short one again.
            let segment_us = segment_us(self.target_us);
            self.ignored.overrun += self.store.restart(self.last_us, segment_us);
            return;
        }
        let mut wanted = wants.all_us;
        let refused = status.and_then(Status::reason).is_some();
        if refused && !caught_up && !self.too_fast {
            wanted = larger(wanted, 1.5 * window_us);
        }
        if looks_beside {
            wanted = larger(wanted, GROWTH * window_us);
        }
        let too_long = short_again
            || adapts
                && goes_on
                && status.is_some_and(|status| self.is_too_long(status, window_us, longest));
        if too_long && goes_on {
            // As late as measuring it ends, so that nothing depends on when it did.
            let segments = (WINDOW_SEGMENTS + SEGMENTS_MEASURING) as u64;
            let end_us = self.store.start_us() + segments * u64::from(self.store.segment_us());
            self.anew_us = Some(end_us);
        } else if adapts && !too_long && wanted > ENOUGH * window_us && !longest {
            let longer = WINDOWS_US.iter().find(|w| **w as f32 >= wanted);
            self.target_us = longer.copied().unwrap_or(LONGEST_WINDOW_US);
            if self.store.segment_us() < segment_us(self.target_us) {
                self.store.lengthen(segment_us(self.target_us));
            }
            // It is longer for a rotor that is not locked, and only those are followed.
            self.until_search = 0;
        } else if goes_on {
            let hop = self.rhythm.hop(self.store.segment_us());
            for _ in 0..hop {
                self.store.drop_oldest();
            }
            self.fade(hop);
        }
        self.begin();
    }

    /// Whether a window that grew before a still scene is to begin short again, because all that turns now does with less, or may
    /// do so and not be seen; and keeps what speaks for that.
    fn is_too_long(&mut self, status: Status, window_us: f32, longest: bool) -> bool {
        let blind = if let Stretch::Blind(times) = self.stretch { Some(times) } else { None };
        let grown = window_us > ENOUGH * BASE_WINDOW_US as f32;
        match status {
            Status::Locked if grown && blind.is_some() => {
                let Wants { all_locked, all_us, .. } = self.wants();
                if all_locked && all_us <= MOST_OF_GROWN * window_us {
                    self.stretch = Stretch::Tried;
                    return true;
                }
            }
            Status::Locked if !longest => self.stretch = Stretch::Wanted,
            Status::Refused(reason) => {
                let nothing = reason == Reason::NoRotation;
                if longest && (nothing || self.stretch != Stretch::Tried) {
                    let times = blind.unwrap_or(0) + 1;
                    let too_long = times >= if nothing { MOST_NOTHING } else { MOST_REFUSED };
                    self.stretch = if too_long { Stretch::Wanted } else { Stretch::Blind(times) };
                    return too_long;
                }
                if grown && nothing && self.stretch == Stretch::Wanted {
                    self.stretch = Stretch::Blind(0);
                }
            }
            _ => {}
        }
        false
    }

    /// What the rotors of the window want.
    #[inline(never)]
    pub(super) fn wants(&self) -> Wants {
        let mut wants = Wants { all_locked: true, ..Wants::default() };
        for Outcome { status, wanted_us, .. } in &self.outcomes {
            wants.all_us = larger(wants.all_us, *wanted_us);
            if *status != Status::Locked {
                wants.all_locked = false;
                wants.unlocked_us = larger(wants.unlocked_us, *wanted_us);
            }
            if status.reason().is_none() {
                wants.read_us = larger(wants.read_us, *wanted_us);
            }
        }
        wants
    }

    fn fade(&mut self, segments: usize) {
        self.heat.fade(segments, WINDOW_SEGMENTS as u16);
    }
}

/// What is told of a rotor; `stated` is its blade count as the person knows it, `roll` is the camera's roll by its gyro and the standard deviation of that, in rad/s.
fn rotor_reading(
    id: u8,
    outcome: &Outcome,
    stated: Option<u8>,
    roll: Option<(f32, f32)>,
) -> RotorReading {
    let mut speed = outcome.speed;
    if let Some(speed) = &mut speed {
        // The gyro serves where its offset is known better than what the hand may have rolled.
        let mut roll_sigma = outcome.roll_sigma_rad_s;
        if let Some((roll_rad_s, sigma_rad_s)) = roll.filter(|(_, sigma)| *sigma < roll_sigma) {
            speed.omega_rad_s -= roll_rad_s;
            speed.frame = Frame::Room;
            roll_sigma = sigma_rad_s;
        }
        let sigma = speed.omega_sigma_rad_s;
        speed.omega_sigma_rad_s = crate::math::sqrt(sigma * sigma + roll_sigma * roll_sigma);
    }
    let Disc { x_px, y_px, radius_px } = outcome.found.disc;
    let evidence: Evidence = outcome.evidence;
    let status = outcome.status;
    // Without polarity leading and trailing edges look alike: they may be twice as many.
    let blades = if outcome.found.ignores_polarity { stated } else { outcome.parts };
    RotorReading { id, x_px, y_px, radius_px, blades, status, speed, evidence }
}

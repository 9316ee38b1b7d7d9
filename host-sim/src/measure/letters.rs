//! A letter for each rotor of a whole series.

use evtach_core::tracker::LETTER_READINGS;
use evtach_core::{Reading, RotorReading};

/// Farther than so many radii from where it was last seen, the tracker takes nothing for the same rotor; a little is left for how places
/// are rounded on the way.
const REACH_RADII: f32 = 0.6;

/// Gives each rotor a letter that is no other's.
///
/// The tracker has few letters and gives one again once its rotor was gone for [`LETTER_READINGS`]. Over a recording that would be two
/// rotors with one mean; so what was told under a letter keeps it here, and what comes under it later gets the next.
#[derive(Debug)]
pub struct Letters {
    seen: Vec<Seen>,
    /// Letters under which a speed was told.
    spoken: [bool; 256],
    /// Letters that any rotor had.
    given: [bool; 256],
    readings: u64,
}

/// A rotor that the tracker knows.
#[derive(Clone, Copy, Debug)]
struct Seen {
    tracked: u8,
    letter: u8,
    place_px: (f32, f32),
    radius_px: f32,
    reading: u64,
}

impl Seen {
    fn is(&self, rotor: &RotorReading, reading: u64) -> bool {
        let missed = reading.saturating_sub(self.reading + 1);
        let apart_px = (rotor.x_px - self.place_px.0).hypot(rotor.y_px - self.place_px.1);
        let reach_px = REACH_RADII * self.radius_px.max(rotor.radius_px);
        self.tracked == rotor.id
            && (missed == 0 || missed < u64::from(LETTER_READINGS) && apart_px < reach_px)
    }
}

impl Default for Letters {
    fn default() -> Self {
        Self { seen: Vec::new(), spoken: [false; 256], given: [false; 256], readings: 0 }
    }
}

impl Letters {
    /// Says that what comes next is another recording: no rotor of it is one of those so far, nor has a letter of theirs.
    pub fn start_anew(&mut self) {
        self.seen.clear();
        self.spoken = self.given;
    }

    /// Puts the letters of the series in place of the tracker's.
    #[must_use]
    pub fn lettered(&mut self, mut reading: Reading) -> Reading {
        self.readings += 1;
        let now = self.readings;
        self.seen.retain(|seen| now - seen.reading <= u64::from(LETTER_READINGS));
        for rotor in &mut reading.rotors {
            let tracked = rotor.id;
            let known = self.seen.iter().position(|seen| seen.is(rotor, now));
            let letter = known.map_or_else(|| self.free(), |at| self.seen[at].letter);
            self.seen.retain(|seen| seen.tracked != tracked);
            let place_px = (rotor.x_px, rotor.y_px);
            let radius_px = rotor.radius_px;
            self.seen.push(Seen { tracked, letter, place_px, radius_px, reading: now });
            self.spoken[usize::from(letter)] |= rotor.speed.is_some();
            self.given[usize::from(letter)] = true;
            rotor.id = letter;
        }
        reading.rotors.sort_unstable_by_key(|rotor| rotor.id);
        reading
    }

    /// The first letter that nobody has and under which no speed was told. Where all were, the last is shared.
    fn free(&self) -> u8 {
        let has = |letter: u8| self.seen.iter().any(|seen| seen.letter == letter);
        (0..=u8::MAX)
            .find(|letter| !has(*letter) && !self.spoken[usize::from(*letter)])
            .unwrap_or(u8::MAX)
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::{Evidence, Frame, Reason, Speed, Status};

    use super::*;

    fn rotor(id: u8, x_px: f32, spoken: bool) -> RotorReading {
        let speed = Speed {
            omega_rad_s: 100.0,
            omega_sigma_rad_s: 0.01,
            alpha_rad_s2: None,
            frame: Frame::Camera,
        };
        let status = if spoken { Status::Locked } else { Status::Refused(Reason::Ambiguous) };
        RotorReading {
            id,
            x_px,
            y_px: 50.0,
            radius_px: 40.0,
            blades: None,
            status,
            speed: spoken.then_some(speed),
            evidence: Evidence::default(),
        }
    }

    /// The letters that so many readings with the same rotors get.
    fn after(letters: &mut Letters, readings: u8, rotors: &[RotorReading]) -> Vec<u8> {
        let mut told = Vec::new();
        for _ in 0..readings {
            let rotors = rotors.iter().cloned().collect();
            let status = Status::Locked;
            let empty = Reading {
                t_us: 0,
                window_us: 150_000,
                events: 0,
                thinned: 0,
                lost: 0,
                status,
                rotors,
            };
            told = letters.lettered(empty).rotors.iter().map(|rotor| rotor.id).collect();
        }
        told
    }

    #[test]
    fn what_the_tracker_gives_again_is_another_rotor() {
        let mut letters = Letters::default();
        let (a, b) = (rotor(0, 50.0, true), rotor(1, 200.0, true));
        assert_eq!(after(&mut letters, 3, &[a.clone(), b.clone()]), [0, 1]);
        // As long as the tracker remembers it, it is the same.
        assert_eq!(after(&mut letters, LETTER_READINGS - 1, std::slice::from_ref(&b)), [1]);
        assert_eq!(after(&mut letters, 1, &[a, b.clone()]), [0, 1]);
        assert_eq!(after(&mut letters, LETTER_READINGS + 1, std::slice::from_ref(&b)), [1]);
        let c = rotor(0, 300.0, true);
        assert_eq!(after(&mut letters, 2, &[c, b]), [1, 2]);
    }

    #[test]
    fn the_same_letter_elsewhere_is_another_rotor() {
        let mut letters = Letters::default();
        assert_eq!(after(&mut letters, 1, &[rotor(0, 50.0, true)]), [0]);
        // It moves as fast as it likes while it is seen.
        assert_eq!(after(&mut letters, 1, &[rotor(0, 90.0, true)]), [0]);
        assert!(after(&mut letters, 2, &[]).is_empty());
        assert_eq!(after(&mut letters, 1, &[rotor(0, 150.0, true)]), [1]);
    }

    #[test]
    fn rotors_of_another_recording_are_others() {
        let mut letters = Letters::default();
        let (a, silent) = (rotor(0, 50.0, true), rotor(1, 200.0, false));
        assert_eq!(after(&mut letters, 3, &[a.clone(), silent.clone()]), [0, 1]);
        letters.start_anew();
        assert_eq!(after(&mut letters, 3, &[a, silent]), [2, 3]);
    }

    #[test]
    fn what_was_never_told_uses_up_no_letter() {
        let mut letters = Letters::default();
        assert_eq!(after(&mut letters, 1, &[rotor(0, 50.0, false)]), [0]);
        assert!(after(&mut letters, LETTER_READINGS + 1, &[]).is_empty());
        assert_eq!(after(&mut letters, 1, &[rotor(0, 200.0, true)]), [0]);
    }
}

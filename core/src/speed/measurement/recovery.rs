//! Blades that pass faster than the pixels recover: a pixel that has just fired misses the next edges, and fires again at every
//! third of them, say. Where all pixels first fired at the same blade (a camera that was just switched on, a flash), the events
//! of all the rotor then come in bursts, and the pattern keeps step with a third of its speed as well as with its own, winding as
//! often around the axis. A rigid rotor's does not: of the harmonic m, it keeps step with its own speed alone.
//!
//! Jitter of half of its own period hides the true speed. But then the pattern keeps step with the frequency at hand with
//! other windings, too: with none, or as many the other way. A rigid rotor's does so only as far as it is seen unevenly around.
//!
//! So does what goes to and fro, slowly there and fast back, as if it turned on: on its way back each place sees as many events as on
//! its way there, in a burst that comes as often as blades would pass.
//!
//! A lamp that lights the blades in flashes does the same to their frequency: with its own added or taken off, the pattern keeps
//! step, too. Where it keeps more step so, the frequency at hand is not the blades'. Flashes make many such frequencies, alike in step; which
//! of them is the blades' own is told by nothing, but that more than half the flashes' is not seen to be. Of a lamp of whatever frequency,
//! blades that pass less than three times in the window are told by the step that their pattern keeps near standstill.

use super::{Measurement, Stage};
use crate::math::TAU;
use crate::reading::Reason;
use crate::speed::polar::PolarEvent;
use crate::store::Window;

/// Other speeds that are asked, over the one at hand: those that a refractory period of up to three blade periods mistakes
/// for each other. Jitter hides the higher ones more.
const SPEEDS: [f32; 15] = [
    8.0 / 7.0,
    7.0 / 6.0,
    6.0 / 5.0,
    5.0 / 4.0,
    9.0 / 7.0,
    4.0 / 3.0,
    7.0 / 5.0,
    3.0 / 2.0,
    5.0 / 3.0,
    2.0,
    3.0,
    1.0 / 3.0,
    1.0 / 2.0,
    3.0 / 5.0,
    2.0 / 3.0,
];
/// Of the frequencies that a lamp adds, or takes off, so many are those of lamps at the mains.
const MAINS: usize = 4;
/// Share in step with the lamp's frequency added or taken off over that with the one at hand, from which on that may be one that the lamp
/// makes: these have 0.6 and more, rotors of random scenes under lamps at the mains up to 0.16.
const MOST_BESIDE: f32 = 0.5;
/// Share in step with another speed over that with the one at hand from which on either may be the rotor's. With a higher one
/// rigid rotors of two blades or more reach 0.30 in random scenes, mistaken speeds 0.34 and more.
const MOST_HIGHER: f32 = 0.32;
const MOST_LOWER: f32 = 1.1;
/// The same with twice or thrice the speed where the parts differ or there is but one, which about an axis that is not found
/// exactly does not turn evenly: rigid ones reach 0.36, mistaken speeds 0.43 and more.
const MOST_UNEVEN: f32 = 0.4;
/// Share in step with twice or thrice the speed, beyond what uneven sight makes, up to which that is its reason.
const MOST_BEYOND_UNEVEN: f32 = 0.1;
/// Share in step with other windings over that with the ones at hand, less what uneven sight makes, from which on it is no rigid
/// rotor's: these reach 0.11 in random scenes, and 0.31 of a few hundred events; mistaken speeds 0.49 and more.
const MOST_OTHER_WINDINGS: f32 = 0.35;
/// The same of blades that are too slow for any pixel, where it tells what goes to and fro: slowly there, as a rotor does, and so fast back that
/// half of its events come in a burst, whatever their direction. Such motion that would be told as a rotor has 0.5 and more, rotors up to 0.32.
const MOST_TO_AND_FRO: f32 = 0.45;
/// Periods in the window from which on a burst in each is told from the end of the window.
const LEAST_BURSTS: f32 = 2.5;
/// Frequency of the harmonic in Hz below which no pixel takes so long to recover. A single mark's is asked lower: where half its speed
/// is told, nothing else speaks against that.
const SLOWEST_HZ: f32 = 200.0;
const SLOWEST_MARK_HZ: f32 = 100.0;
/// So many are asked of blades that are too slow to be told and that a lamp makes fast ones of: from one to three periods in the window,
/// either way. Fewer than one are not told from a rotor that is seen unevenly around.
const STILLS: usize = 10;
/// Share in step with these over that with the speed at hand from which on the blades are as slow: lamps make ratios of 0.9 and more,
/// rigid rotors in random scenes up to 0.73.
const MOST_STILL: f32 = 0.8;
/// Its periods in the window from which on speeds a seventh apart are told apart.
const LEAST_PERIODS: f32 = 14.0;

impl Measurement {
    /// Asks whether the pattern keeps step with other windings too, or with another speed, of the rotor's own or of a lamp's making: one a
    /// step. Cost: about 150 instructions an event and step.
    pub(super) fn recovery(&mut self, window: &Window<'_>, polar: &[PolarEvent]) {
        let line_hz = self.omega_rad_s.abs() * self.harmonic as f32 / TAU;
        let periods = line_hz * window.duration_us as f32 * 1e-6;
        let mark = self.parts == Some(1);
        let slowest_hz = if mark { SLOWEST_MARK_HZ } else { SLOWEST_HZ };
        let asked = line_hz > slowest_hz && periods > LEAST_PERIODS;
        let turn = usize::from(self.turn);
        self.turn += 1;
        if let Some(share) = self.other_windings.get(turn) {
            // How unevenly it is seen: the harmonics of where its events are, whenever they came.
            let harmonic = u32::from(self.turn) * self.windings;
            let unevenly = || self.in_step(polar, 0.0, harmonic);
            let (most, reason) = if asked {
                (MOST_OTHER_WINDINGS, Reason::TooFast)
            } else {
                (MOST_TO_AND_FRO, Reason::NoRotation)
            };
            let told = asked || periods > LEAST_BURSTS;
            if told && self.windings > 1 && share - unevenly() > most {
                self.refuse(reason);
            }
            return;
        }
        // However slow the blades are, a lamp is asked for: it makes fast ones of them.
        let number = turn - self.other_windings.len() + if asked { 0 } else { SPEEDS.len() };
        let (speed, most, reason) = if let Some(&speed) = SPEEDS.get(number) {
            let uneven = mark || !self.alike;
            let higher = if uneven && speed >= 2.0 { MOST_UNEVEN } else { MOST_HIGHER };
            (speed, if speed > 1.0 { higher } else { MOST_LOWER }, Reason::TooFast)
        } else {
            let lamp_hz = self.lamp_hz;
            let lamps_hz = [-120.0, -100.0, 100.0, 120.0, -lamp_hz, lamp_hz];
            let lamps = if lamp_hz > 0.0 { lamps_hz.len() } else { MAINS };
            let number = number - SPEEDS.len();
            if let Some(added_hz) = lamps_hz.get(number).filter(|_| number < lamps) {
                let is_found = number >= MAINS;
                let most =
                    if is_found && 2.0 * line_hz > lamp_hz { MOST_BESIDE } else { MOST_LOWER };
                (1.0 + added_hz / line_hz, most, Reason::Flicker)
            } else {
                // Whole periods and a half, either way.
                let number = number - lamps;
                if number >= STILLS || periods <= LEAST_PERIODS {
                    self.turn = 0;
                    self.stage = Stage::Pose;
                    return;
                }
                let still = 1.0 + 0.5 * (number / 2) as f32;
                let still = if number.is_multiple_of(2) { still } else { -still };
                (still / periods, MOST_STILL, Reason::Flicker)
            }
        };
        let omega_rad_s = speed * self.omega_rad_s;
        let share = self.in_step(polar, omega_rad_s, self.harmonic);
        // Where it is seen unevenly around, a mark keeps as much step with whole multiples of its speed as that is.
        let beyond = if reason == Reason::TooFast { (speed - 1.0) as u32 } else { 0 };
        if share > most * self.evidence.coherence.unwrap_or(0.0)
            && (beyond == 0
                || share - self.in_step(polar, 0.0, beyond * self.harmonic) > MOST_BEYOND_UNEVEN)
        {
            self.refuse(reason);
        }
    }
}

//! How a readout's queue fills as the stream begins, seen in a rotor's phase.
//!
//! A stream begins with an empty queue. Until it is full, events come ever later, and a rotor seems to turn more slowly by the share of
//! them that the readout cannot keep up with; from then on all are late alike. So against those of later on, the first ones are early
//! by all that the queue holds.

use heapless::Vec;
use microfft::Complex32;

use super::phase::Pattern;
use super::polar::{Annulus, PolarEvent};
use crate::math::{TAU, Turn, larger};
use crate::rotors::Disc;
use crate::store::{StoredEvent, Window};

/// Events whose phase is taken together: more where they come within an eighth of a symmetry period.
const LEAST: usize = 8;
const MOST: usize = 64;
const LONG: f32 = 0.125;
/// Most of a symmetry period from one group to the next, in time and in phase: an event is late by no more than time goes by.
const MOST_STEP: f32 = 0.25;

/// How a queue fills within the first quarter of a window, as seen in a rotor's phase against the rest of it: nowhere where the phase
/// cannot be followed from one end to the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Filled {
    /// How early the first event is, as a share of the window.
    pub early: f32,
    /// By how much the speed is higher, were it not for that, than the one asked with, relative.
    pub tilt: f32,
}

/// What is known of it meanwhile.
#[derive(Clone, Debug)]
pub struct Filling {
    /// Segment that is looked at next, and whether the phases of the later ones are known.
    segment: usize,
    follows: bool,
    /// Phase of a group, and until when it lasts.
    before: Option<(Turn, i32)>,
    /// By how much the phase is ahead of that of the first group.
    ahead_rad: f32,
    /// This summed over time in the quarters of the window, and the time.
    sums: [(f32, f32); 4],
}

impl Filling {
    /// Nothing asked yet.
    pub const EMPTY: Self =
        Self { segment: 0, follows: false, before: None, ahead_rad: 0.0, sums: [(0.0, 0.0); 4] };

    /// Asks a rotor whose phase at this angular harmonic advances evenly, a segment of the window at a time; `None` until all of it was
    /// asked. `later` keeps what the later ones look like. Cost: some 250 instructions for each event of the rotor.
    pub fn step(
        &mut self,
        window: &Window<'_>,
        disc: Disc,
        omega_rad_s: f32,
        harmonic: u32,
        later: &mut [Complex32],
    ) -> Option<Filled> {
        if self.segment == 0 && !self.follows {
            later.fill(Complex32::default());
        }
        let quarter_us = (window.duration_us / 4).max(1) as i32;
        let rad_per_us = harmonic as f32 * omega_rad_s * 1e-6;
        let period_us = TAU / rad_per_us.abs();
        let mut events = window.segment(self.segment).iter();
        while let Some((now_us, pattern)) =
            next(&mut events, LONG * period_us, window, disc, omega_rad_s, harmonic)
        {
            let quarter = (now_us / quarter_us).clamp(0, 3) as usize;
            if !self.follows {
                if quarter > 1 {
                    pattern.add_to(later);
                }
                continue;
            }
            let turn = pattern.ahead_of(later);
            if let Some((last, until_us)) = self.before {
                let step_us = (now_us - until_us) as f32;
                let step_rad = turn.minus(last).rad();
                if step_us > MOST_STEP * period_us || step_rad.abs() > MOST_STEP * TAU {
                    *self = Self::EMPTY;
                    return Some(Filled::default());
                }
                self.ahead_rad += step_rad;
                let (ahead_us, times_us) = &mut self.sums[quarter];
                *ahead_us += self.ahead_rad * step_us;
                *times_us += step_us;
            }
            self.before = Some((turn, now_us));
        }
        self.segment += 1;
        if self.segment < window.segments() {
            return None;
        }
        if !self.follows {
            (self.segment, self.follows) = (0, true);
            return None;
        }
        // What comes late has turned less far by then.
        let per_rad = -1.0 / (rad_per_us * window.duration_us as f32);
        let [_, a, b, c] = core::mem::replace(self, Self::EMPTY)
            .sums
            .map(|(ahead_us, times_us)| per_rad * ahead_us / larger(times_us, 1.0));
        // A parabola through their means, back to the start; of one, the mean slope is that at the middle.
        Some(Filled { early: 4.375 * a - 5.25 * b + 1.875 * c, tilt: 4.0 * (a - b) })
    }
}

/// The next group of events of the rotor, the time of its last, and its phases.
// Not inlined: flash is short.
#[inline(never)]
fn next(
    events: &mut core::slice::Iter<'_, StoredEvent>,
    long_us: f32,
    window: &Window<'_>,
    disc: Disc,
    omega_rad_s: f32,
    harmonic: u32,
) -> Option<(i32, Pattern)> {
    let annulus = Annulus::of(disc);
    let mut group = Vec::<PolarEvent, MOST>::new();
    for event in events {
        let Some(place) = annulus.place(*event) else { continue };
        let event = PolarEvent::new(*event, place, window, 0);
        group.push(event).ok();
        let lasts_us = (event.t_us - group[0].t_us) as f32;
        if group.is_full() || group.len() >= LEAST && lasts_us > long_us {
            return Some((event.t_us, Pattern::learn(&group, disc, omega_rad_s, harmonic)));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{PackedEvent, Polarity};
    use crate::store::{MOST_SEGMENTS, MOST_SPARE, Store};

    const DISC: Disc = Disc { x_px: 60.0, y_px: 60.0, radius_px: 40.0 };
    const BLADES: u32 = 5;
    const WINDOW_US: u64 = 150_000;
    const OMEGA_RAD_S: f32 = 300.0;

    /// What is seen of a rotor whose events come from a queue that fills by so much of the time, until they are so late, as it is asked
    /// with such a speed.
    fn of(pace: f32, most_us: f32, grows_per_s: f32, asked_rad_s: f32) -> Filled {
        at_harmonic(BLADES, pace, most_us, grows_per_s, asked_rad_s)
    }

    fn at_harmonic(
        harmonic: u32,
        pace: f32,
        most_us: f32,
        grows_per_s: f32,
        asked_rad_s: f32,
    ) -> Filled {
        let mut memory = vec![StoredEvent::default(); MOST_SEGMENTS * 16_384];
        let mut store = Store::new(&mut memory, MOST_SPARE, 25_000);
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        for t_us in (0..WINDOW_US).step_by(3) {
            while t_us >= store.open_end_us() {
                store.close_segment();
            }
            let late_us = (pace * t_us as f32).min(most_us);
            let t_s = 1e-6 * (t_us as f32 - late_us);
            let blade = (BLADES as f32 * random()) as u32 as f32 * (TAU / BLADES as f32);
            let turn_rad = OMEGA_RAD_S * t_s * (1.0 + 0.5 * grows_per_s * t_s) + blade;
            let (sin, cos) = Turn::from_rad(turn_rad.rem_euclid(TAU)).sin_cos();
            let r_px = DISC.radius_px * (0.4 + 0.6 * random());
            let (x, y) = (DISC.x_px + r_px * cos + 0.5, DISC.y_px + r_px * sin + 0.5);
            let event = PackedEvent::new(t_us as u32, x as u16, y as u16, Polarity::On);
            store.push(&[event], 0, |_, _| {});
        }
        let window = store.window(6, u64::MAX);
        let mut filling = Filling::EMPTY;
        let mut later = [Complex32::default(); 64];
        loop {
            if let Some(filled) = filling.step(&window, DISC, asked_rad_s, harmonic, &mut later) {
                return filled;
            }
        }
    }

    #[test]
    fn the_first_events_are_early_by_what_the_queue_holds() {
        for (pace, late_us) in [(0.9, 4_000.0), (0.5, 4_000.0), (0.2, 4_000.0), (0.3, 1_500.0)] {
            let Filled { early, tilt } = of(pace, late_us, 0.0, OMEGA_RAD_S);
            let right = late_us / WINDOW_US as f32;
            assert!((early / right - 1.0).abs() < 0.1, "{pace} {late_us}: {early} {right}");
            assert!(tilt.abs() < 5e-4, "{pace} {late_us}: {tilt}");
        }
        let none = of(0.0, 0.0, 0.0, OMEGA_RAD_S);
        assert!(none.early.abs() < 2e-3 && none.tilt.abs() < 5e-4, "{none:?}");
    }

    #[test]
    fn neither_a_change_of_speed_nor_what_the_filling_took_of_it_hides_that() {
        let right = 4_000.0 / WINDOW_US as f32;
        // Asked with the mean speed.
        let faster = of(0.5, 4_000.0, 0.1, OMEGA_RAD_S * (1.0 + 0.5 * 0.1 * 0.146));
        assert!((faster.early / right - 1.0).abs() < 0.2, "{faster:?} {right}");
        let tilted = of(0.5, 4_000.0, 0.0, OMEGA_RAD_S / 1.004);
        assert!((tilted.early / right - 1.0).abs() < 0.1, "{tilted:?} {right}");
        assert!((tilted.tilt - 0.004).abs() < 5e-4, "{tilted:?}");
    }

    #[test]
    fn a_phase_that_cannot_be_followed_shows_nothing() {
        let Filled { early, tilt } = at_harmonic(BLADES - 1, 0.5, 4_000.0, 0.0, OMEGA_RAD_S);
        assert_eq!((early, tilt), (0.0, 0.0));
    }
}

//! A lamp's events, put out of sight.
//!
//! As its light rises and falls, pixels fire all over what it lights: they become brighter in one half of each flicker and darker in
//! the other. What moves makes events of both polarities at any time. So what becomes brighter in the half in which most does, and
//! darker in the other, is not looked at: of the lamp's events hardly any are left, of what moves about half, at any time.

use super::{Store, StoredEvent};
use crate::math::{TAU, TurnRate};

/// Flicker of lamps at the mains in Hz.
const MAINS_HZ: [f32; 2] = [100.0, 120.0];
/// Flickers in a segment from which on a lamp is told from a rate that changes.
const LEAST_FLICKERS: f32 = 2.0;
/// Square of the share of a segment's events in step with the lamp, the darker ones half a flicker later, from which on it lights what is
/// seen, and what unrelated events never reach beyond it, times their number.
const LEAST_SHARE2: f32 = 0.04;
const CHANCE: f32 = 16.0;

impl Store<'_> {
    /// Puts the events of a segment out of sight that a lamp makes, where one lights what is seen, and those back into sight that were put
    /// out of it before; whether there is one. Asked are the lamps at the mains, and one of this frequency, 0 for none. Cost: about 250
    /// instructions an event.
    pub fn darken(&mut self, index: usize, lamp_hz: f32) -> bool {
        let slot = self.slot(index);
        let base = slot * self.capacity;
        let events = self.events.get_mut(base..base + self.segments[slot].len);
        let events = events.unwrap_or_default();
        let [start, .., last] = *events else { return false };
        let span_s = 1e-6 * last.after_us(start) as f32;
        let by_chance = CHANCE / events.len() as f32;
        let mut lamp = Flicker { share2: LEAST_SHARE2 + by_chance, ..Flicker::default() };
        for hz in [MAINS_HZ[0], MAINS_HZ[1], lamp_hz] {
            let found = Flicker::of(events, start, TurnRate::from_rad_s(TAU * hz));
            if hz * span_s > LEAST_FLICKERS && found.share2 > lamp.share2 {
                lamp = found;
            }
        }
        for event in events {
            *event = event.out_of_sight(lamp.makes(*event, start));
        }
        lamp.rate != TurnRate::default()
    }

    /// Puts all events back into sight.
    pub fn lighten(&mut self) {
        for event in self.events.iter_mut() {
            *event = event.out_of_sight(false);
        }
    }
}

/// How events keep step with a flicker.
#[derive(Clone, Copy, Debug, Default)]
struct Flicker {
    rate: TurnRate,
    /// Sum of where in it they came, the darker ones half of it later.
    re: f32,
    im: f32,
    /// Square of the share in step.
    share2: f32,
}

impl Flicker {
    // Not inlined: flash is short.
    #[inline(never)]
    fn of(events: &[StoredEvent], start: StoredEvent, rate: TurnRate) -> Self {
        let (mut re, mut im, mut all) = (0.0, 0.0, 0.0);
        for event in events {
            let (sin, cos) = place(*event, start, rate);
            let stands_for = (1_u32 << event.weight_log2()) as f32;
            (re, im) = (re + stands_for * cos, im + stands_for * sin);
            all += stands_for;
        }
        Self { rate, re, im, share2: (re * re + im * im) / (all * all) }
    }

    /// Whether an event is as the flicker would make it.
    fn makes(&self, event: StoredEvent, start: StoredEvent) -> bool {
        let (sin, cos) = place(event, start, self.rate);
        self.re * cos + self.im * sin > 0.0
    }
}

/// Where in a flicker an event came, a darker one half of it later: sine and cosine.
// Not inlined: flash is short.
#[inline(never)]
fn place(event: StoredEvent, start: StoredEvent, rate: TurnRate) -> (f32, f32) {
    let (sin, cos) = rate.after(event.after_us(start)).sin_cos();
    if event.is_on() { (sin, cos) } else { (-sin, -cos) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{PackedEvent, Polarity};
    use crate::store::{MOST_SEGMENTS, MOST_SPARE};

    /// How many events are in sight of a lamp, and of what moves, in the dark and then after it: of a lamp that flickers so often in the half second
    /// of a segment, brighter ones and, half a flicker later, as many darker ones; of what moves 400 at any time, brighter and darker in turn.
    fn in_sight(flickers: u64, asked_hz: f32) -> [(usize, usize); 2] {
        let mut memory = vec![StoredEvent::default(); 4_096 * MOST_SEGMENTS];
        let mut store = Store::new(&mut memory, MOST_SPARE, 500_000);
        let half_us = 250_000 / flickers.max(1);
        let lamp = (0..16 * flickers).map(|n| (n / 8 * half_us + 90 * (n % 8), 1, n / 8 % 2 == 0));
        let moving = (0..400).map(|n| (n * 1_249, 2, n % 2 == 0));
        let mut events: Vec<(u64, u16, bool)> = lamp.chain(moving).collect();
        events.sort_unstable();
        for (t_us, x, on) in events {
            let polarity = if on { Polarity::On } else { Polarity::Off };
            store.push(&[PackedEvent::new(t_us as u32, x, 5, polarity)], 0, |_, _| {});
        }
        let count = |store: &Store<'_>| {
            let seen = |x: u16| store.window(1, u64::MAX).events().filter(|e| e.x() == x).count();
            (seen(1), seen(2))
        };
        store.darken(0, asked_hz);
        let dark = count(&store);
        store.lighten();
        [dark, count(&store)]
    }

    #[test]
    fn a_lamps_events_go_and_half_of_what_moves_stays() {
        // At the mains, and one that was found.
        for (flickers, asked_hz) in [(50, 0.0), (60, 0.0), (87, 174.0)] {
            let [(lamp, moving), after] = in_sight(flickers, asked_hz);
            assert!(lamp == 0 && (150..250).contains(&moving), "{flickers}: {lamp}, {moving}");
            assert_eq!(after, (16 * flickers as usize, 400));
        }
    }

    #[test]
    fn where_no_lamp_is_known_all_stays() {
        assert_eq!(in_sight(0, 0.0)[0], (0, 400));
        assert_eq!(in_sight(87, 0.0)[0], (16 * 87, 400));
    }
}

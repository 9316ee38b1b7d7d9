//! Blades that go to and fro by nearly the angle from one to the next, slowly there and fast back: on the way there they pass as
//! those of a rotor do, again and again, and nothing turns.

use std::f64::consts::TAU;

use evtach_core::{Event, Geometry, Polarity, Settings};
use evtach_host::measure::{Capacity, measure_events};

const RADIUS_PX: f64 = 40.0;
const CENTRE_PX: (f64, f64) = (173.0, 130.0);
/// Share of the angle from blade to blade that a blade takes.
const WIDTH: f64 = 0.4;
const JITTER_US: f64 = 50.0;

/// Blades that step to and fro, so often a second, by this share of the angle between them, there in this share of the time.
#[derive(Clone, Copy, Debug)]
struct Steps {
    blades: u32,
    rate_hz: f64,
    amplitude: f64,
    there: f64,
}

impl Steps {
    /// When an edge passes what lies by so much of the angle from blade to blade ahead of where it turns back, in shares of a step: on
    /// its way there and on its way back.
    fn passes(&self, ahead: f64) -> Option<[f64; 2]> {
        let way = ahead / self.amplitude;
        let back = self.there + (1.0 - way) * (1.0 - self.there);
        (way < 1.0).then_some([way * self.there, back])
    }

    /// One event for each edge that passes a pixel.
    fn events(&self, duration_s: f64) -> Vec<Event> {
        let mut events = Vec::new();
        let mut lot = 1_u32;
        let mut jitter_us = || {
            lot = lot.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(lot >> 8) / f64::from(1 << 24) * JITTER_US
        };
        let reach = RADIUS_PX as u16;
        let (left, top) = (CENTRE_PX.0 as u16 - reach, CENTRE_PX.1 as u16 - reach);
        for (x, y) in
            (0..=2 * reach).flat_map(|x| (0..=2 * reach).map(move |y| (x + left, y + top)))
        {
            let (dx, dy) = (f64::from(x) - CENTRE_PX.0, f64::from(y) - CENTRE_PX.1);
            if !(4.0..RADIUS_PX).contains(&dx.hypot(dy)) {
                continue;
            }
            let place = dy.atan2(dx) / TAU * f64::from(self.blades);
            for (edge, sign) in [(0.0, true), (WIDTH, false)] {
                let Some(passes) = self.passes((place - edge).rem_euclid(1.0)) else { continue };
                for step in 0..(duration_s * self.rate_hz) as u32 {
                    for (share, forth) in passes.into_iter().zip([true, false]) {
                        let t_s = (f64::from(step) + share) / self.rate_hz;
                        let t_us = (t_s * 1e6 + jitter_us()) as u64;
                        let polarity = if sign == forth { Polarity::On } else { Polarity::Off };
                        events.push(Event { t_us, x, y, polarity });
                    }
                }
            }
        }
        events.sort_by_key(|event| event.t_us);
        events
    }
}

#[test]
fn what_goes_to_and_fro_is_no_rotor() {
    let geometry = Geometry::new(346, 260).expect("a sensor in range");
    let mut told = Vec::new();
    for blades in [2, 4, 5] {
        for (amplitude, there) in [(0.9, 0.85), (0.8, 0.9)] {
            let steps = Steps { blades, rate_hz: 19.0, amplitude, there };
            let events = steps.events(0.6);
            for capacity in Capacity::ALL {
                let (readings, _) = measure_events(&events, &[], Settings::new(geometry), capacity);
                let rotors = readings.iter().flat_map(|reading| &reading.rotors);
                let speeds = rotors.filter_map(|rotor| rotor.speed);
                told.extend(speeds.map(|speed| (steps, capacity, speed.rpm())));
            }
        }
    }
    assert!(told.is_empty(), "{told:?}");
}

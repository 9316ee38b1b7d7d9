//! A lamp that flickers, as dimmed LEDs do at any rate: each flash shows the blades where they are, so that many speeds explain what is
//! seen alike.

use evtach_core::{Event, Geometry, Polarity, Settings};
use evtach_host::measure::{Capacity, measure_events};
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

const SIDE_PX: u16 = 120;
const RADIUS_PX: f64 = 45.0;
/// Share of the pixels on a blade that fire where the light goes on or off.
const FIRE: f64 = 0.22;

struct Lit {
    rpm: f64,
    blades: f64,
    lamp_hz: f64,
    /// Share of the time that the lamp is on.
    duty: f64,
}

/// What a sensor sees of a bright fan before the dark whenever the light goes on or off.
fn events(lit: &Lit, seed: u64) -> Vec<Event> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut events = Vec::new();
    let half_px = f64::from(SIDE_PX) / 2.0;
    for flash in 0..(0.3 * lit.lamp_hz) as u32 {
        for (polarity, later) in [(Polarity::On, 0.0), (Polarity::Off, lit.duty)] {
            let t_s = (f64::from(flash) + later) / lit.lamp_hz;
            for (x, y) in (0..SIDE_PX).flat_map(|y| (0..SIDE_PX).map(move |x| (x, y))) {
                let (dx_px, dy_px) = (f64::from(x) - half_px, f64::from(y) - half_px);
                let turns = dy_px.atan2(dx_px) / std::f64::consts::TAU - lit.rpm / 60.0 * t_s;
                let is_blade = (turns * lit.blades).rem_euclid(1.0) < 0.4
                    && (8.0..RADIUS_PX).contains(&dx_px.hypot(dy_px));
                if is_blade && rng.random_bool(FIRE) {
                    let jitter_us = 40.0 * (rng.random::<f64>() + rng.random::<f64>());
                    let t_us = (t_s * 1e6 + jitter_us) as u64;
                    events.push(Event { t_us, x, y, polarity });
                }
            }
        }
    }
    events.sort_by_key(|event| event.t_us);
    events
}

/// As 10 795 rpm backwards for 1097 were, 7474 for 256, 11 652 for 483, 5124 for 1296 and 14 164 for 2296.
#[test]
fn what_a_lamp_makes_of_blades_is_not_told() {
    let geometry = Geometry::new(SIDE_PX, SIDE_PX).expect("a sensor in range");
    for (seed, (rpm, blades, lamp_hz, duty)) in [
        (1097.0, 5.0, 991.0, 0.8),
        (256.0, 6.0, 773.0, 0.5),
        (483.0, 4.0, 809.0, 0.5),
        (1296.0, 5.0, 535.0, 0.5),
        (2296.0, 3.0, 823.0, 0.5),
    ]
    .into_iter()
    .enumerate()
    {
        let events = events(&Lit { rpm, blades, lamp_hz, duty }, seed as u64);
        for capacity in Capacity::ALL {
            let (readings, _) = measure_events(&events, &[], Settings::new(geometry), capacity);
            let told = readings.iter().flat_map(|reading| &reading.rotors).filter_map(|r| r.speed);
            for speed in told {
                let told_rpm = f64::from(speed.omega_rad_s * evtach_core::Speed::RPM_PER_RAD_S);
                let case = format!("{rpm} rpm, lamp of {lamp_hz} Hz, {capacity:?}: {told_rpm}");
                assert!((told_rpm / rpm - 1.0).abs() < 0.01, "{case}");
            }
        }
    }
}

//! Slow rotors by the light of a lamp that flickers: it makes most of the events.

use evtach_core::{Speed, Status};
use evtach_host::measure::Capacity;
use evtach_host::synth::scene::{Background, Lamp};
use evtach_host::synth::{Rotor, Scene};
use evtach_tests::{Loaded, made, measure, show};

/// Largest error in standard errors, and in permille.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
const LARGEST_ERROR_PERMILLE: f64 = 1.0;

/// Before a wall whose light changes by three tenths, 15 to 37 times a turn: with all its events, each was refused as `flicker`.
#[test]
fn slow_rotors_are_read_without_what_a_lamp_makes() {
    for (seed, blades, rpm, frequency_hz) in
        [(2, 3, 164.0, 100.0), (4, 5, 238.0, 120.0), (6, 1, 312.0, 100.0), (8, 3, -386.0, 100.0)]
    {
        let mut scene = Scene { seed, duration_ms: 1_000.0, ..Scene::default() };
        scene.rotors = vec![Rotor { blades, rpm, ..Rotor::default() }];
        scene.background = Background { contrast: 0.3, boxes: 4, ..Background::default() };
        scene.sensor.threshold = 0.3;
        scene.lamp = Some(Lamp { frequency_hz, depth: 0.3, harmonics: Vec::new(), spot_px: None });
        let geometry = evtach_core::Geometry::new(scene.width_px, scene.height_px);
        let geometry = geometry.expect("a sensor in range");
        let loaded = Loaded { geometry, events: made(&scene).events.clone() };
        let (readings, _) = measure(&loaded, Capacity::Full);
        let mut locked = 0;
        for read in readings.iter().flat_map(|reading| &reading.rotors) {
            let Some(speed) = read.speed else { continue };
            let off_rpm = f64::from(speed.omega_rad_s) * f64::from(Speed::RPM_PER_RAD_S) - rpm;
            let off_permille = 1e3 * off_rpm / rpm;
            let off_sigma = off_rpm / f64::from(speed.rpm_sigma());
            let told = format!(
                "{blades} blades, {rpm} rpm by {frequency_hz} Hz: {off_permille:+.3} permille, {off_sigma:+.1} sigma"
            );
            assert!(
                off_permille.abs() < LARGEST_ERROR_PERMILLE
                    && off_sigma.abs() < LARGEST_ERROR_SIGMA,
                "{told}"
            );
            assert!(read.blades.is_none_or(|counted| counted == blades), "{told}: {read:#?}");
            show(&told);
            locked += usize::from(read.status == Status::Locked);
        }
        assert!(locked > 0, "{blades} blades, {rpm} rpm: {readings:#?}");
    }
}

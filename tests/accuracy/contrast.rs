//! Blades before what is brighter than they are on one side and darker on the other: an edge changes its polarity on the way round.

use evtach_core::{Event, Geometry, Polarity, Speed, Status};
use evtach_host::measure::Capacity;
use evtach_host::synth::presets::hand;
use evtach_host::synth::scene::Shape;
use evtach_host::synth::{Motion, Rotor, Scene};
use evtach_tests::{Loaded, made, measure, show};

/// Largest error in standard errors, and in permille.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
const LARGEST_ERROR_PERMILLE: f64 = 1.0;

/// As if what is behind a rotor were brighter than its blades right of a column, and darker left of it.
fn before_two_tones(mut event: Event, column_px: f64) -> Event {
    if f64::from(event.x) < column_px {
        event.polarity = match event.polarity {
            Polarity::On => Polarity::Off,
            Polarity::Off => Polarity::On,
        };
    }
    event
}

/// How often a rotor before an edge that lies so far right of its axis, in radii, is locked, with the memory lent.
fn locks(rotor: Rotor, edge: f64, from_hand: bool, capacity: Capacity) -> usize {
    let mut scene =
        Scene { seed: 31, duration_ms: 450.0, rotors: vec![rotor.clone()], ..Scene::default() };
    if from_hand {
        scene.camera = hand();
    }
    let made = made(&scene);
    let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
    let column_px = rotor.x_px + edge * rotor.radius_px;
    let events = made.events.iter().map(|event| before_two_tones(*event, column_px)).collect();
    let (readings, _) = measure(&Loaded { geometry, events }, capacity);
    let name = format!(
        "{} blades, {} rpm, edge at {edge} radii, {}, {} memory",
        rotor.blades,
        rotor.rpm,
        if from_hand { "hand" } else { "tripod" },
        capacity.as_str()
    );
    let mut locked = 0;
    for reading in &readings {
        let half_s = 0.5e-6 * f64::from(reading.window_us);
        let middle_s = reading.t_us as f64 * 1e-6;
        let right_rpm = Motion::new(&scene).rpm_camera(0, middle_s - half_s, middle_s + half_s);
        let right_rpm = right_rpm.expect("a rotor");
        for read in &reading.rotors {
            let Some(speed) = read.speed else { continue };
            let rpm = f64::from(speed.omega_rad_s) * f64::from(Speed::RPM_PER_RAD_S);
            let off_rpm = rpm - right_rpm;
            let off_permille = 1e3 * off_rpm / right_rpm;
            let off_sigma = off_rpm / f64::from(speed.rpm_sigma());
            let told = format!("{name}: {off_permille:+.3} permille, {off_sigma:+.1} sigma");
            assert!(
                off_permille.abs() < LARGEST_ERROR_PERMILLE
                    && off_sigma.abs() < LARGEST_ERROR_SIGMA,
                "{told}"
            );
            show(&told);
            // Without polarity they cannot be counted: leading and trailing edges look alike.
            assert!(read.blades.is_none_or(|blades| blades == rotor.blades), "{read:#?}");
            let off_px =
                (f64::from(read.x_px) - rotor.x_px).hypot(f64::from(read.y_px) - rotor.y_px);
            assert!(off_px < 0.25 * rotor.radius_px, "{read:#?}");
            locked += usize::from(read.status == Status::Locked);
        }
    }
    show(&format!("{name}: {locked} locked"));
    locked
}

#[test]
fn a_background_of_two_tones_does_not_hide_a_rotor() {
    let (mut hidden_from_device, mut shown) = (0, 0);
    for (blades, rpm) in [(4, 620.0), (5, -1480.0), (6, 2900.0)] {
        for edge in [0.0, 0.4] {
            // Blades as wide as the gaps: leading and trailing edges are half a period apart, and cancel.
            let rotor = Rotor { blades, rpm, shape: Shape::Swept, ..Rotor::default() };
            for from_hand in [false, true] {
                let locked = locks(rotor.clone(), edge, from_hand, Capacity::Full);
                assert!(locked > 0, "{rotor:?}, edge at {edge} radii, from the hand: {from_hand}");
            }
            shown += 1;
            let locked = locks(rotor, edge, true, Capacity::Device);
            hidden_from_device += usize::from(locked == 0);
        }
    }
    // What is left of the events there does not always show a path through the tremor.
    assert!(3 * hidden_from_device <= shown, "{hidden_from_device} of {shown}");
}

#[test]
fn eight_blades_before_two_tones_are_not_read_as_nine() {
    for (rpm, radius_px, edge) in
        [(2899.0, 62.0, -0.29), (-2522.0, 68.0, -0.3), (9713.0, 53.0, -0.55)]
    {
        let rotor = Rotor { blades: 8, rpm, radius_px, shape: Shape::Swept, ..Rotor::default() };
        for capacity in Capacity::ALL {
            // Each of the speeds told is right.
            locks(rotor.clone(), edge, true, capacity);
        }
    }
}

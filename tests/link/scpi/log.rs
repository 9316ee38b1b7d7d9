//! The log: each reading in a line of its own.

use evtach_core::{Frame, Reading, Reason, RotorReading, Speed, Status};
use evtach_firmware::scpi::LogLine;
use proptest::prelude::*;

use super::{Session, reading, rotor};
use crate::bench::drain;

#[test]
fn the_log_tells_each_reading_once_between_answers() {
    let mut session = Session::new();
    assert_eq!(session.ask("SYST:LOG ON"), "");
    let Session { link, bench } = &mut session;
    bench.first_us = 1_000_000;
    bench.show(reading(&[rotor(0, 3000.0)]));
    let line = drain(link, bench, 0);
    assert!(line.starts_with(b"{\"t_s\":0.234567,") && line.ends_with(b"}\n"));
    assert_eq!(drain(link, bench, 0), b"", "once");
    link.receive(b"*OPC?;*OPC?\n");
    bench.show(reading(&[rotor(0, 3000.0)]));
    let both = drain(link, bench, 0);
    assert!(both.starts_with(b"1;1\n{\"t_s\""), "{}", both.escape_ascii());
    // Measuring took so long that the sensor is silent by now.
    bench.stale = true;
    bench.show(reading(&[rotor(0, 3000.0)]));
    assert!(drain(link, bench, 0).starts_with(b"{\"t_s\""));
    bench.stale = false;
    assert_eq!(session.ask("SYST:LOG OFF"), "");
    session.bench.show(reading(&[rotor(0, 3000.0)]));
    assert_eq!(session.ask(""), "");
}

#[test]
fn the_longest_log_line_and_answer_fit() {
    let mut session = Session::new();
    let rotors: Vec<RotorReading> = (0..8)
        .map(|index| {
            let speed = Speed {
                omega_rad_s: -12_345.678,
                omega_sigma_rad_s: 1.234_567_8e-3,
                alpha_rad_s2: Some(-9_876.543),
                frame: Frame::Camera,
            };
            RotorReading {
                x_px: 1_234.567_9,
                y_px: 1_234.567_9,
                radius_px: 1_234.567_9,
                status: Status::Coarse,
                speed: Some(speed),
                ..rotor(index + 100, 1.0)
            }
        })
        .collect();
    session.ask("SYST:LOG ON");
    session.bench.show(Reading { t_us: u64::MAX, ..reading(&rotors) });
    assert!(session.ask("").ends_with("}\n"));
    assert!(session.ask("FETC:ALL?").len() > 300);
    assert_eq!(session.error(), 0);
}

/// What JSON numbers are compared with.
fn any_rotor() -> impl Strategy<Value = RotorReading> {
    let float = || -1e5_f32..1e5;
    let speed = (float(), 1e-6_f32..10.0, prop::option::of(float())).prop_map(
        |(omega_rad_s, omega_sigma_rad_s, alpha_rad_s2)| Speed {
            omega_rad_s,
            omega_sigma_rad_s,
            alpha_rad_s2,
            frame: Frame::Room,
        },
    );
    (any::<u8>(), float(), float(), prop::option::of(speed), prop::sample::select(&Reason::ALL))
        .prop_map(|(id, x_px, radius_px, speed, reason)| RotorReading {
            x_px,
            radius_px,
            status: if speed.is_some() { Status::Coarse } else { Status::Refused(reason) },
            speed,
            ..rotor(id, 0.0)
        })
}

proptest! {
    #[test]
    fn a_log_line_is_an_element_of_the_json_of_measure(
        rotors in prop::collection::vec(any_rotor(), 0..=8),
        t_us in 0_u64..1 << 50,
        first_us in 0_u64..1 << 50,
        window_us in any::<u32>(),
    ) {
        let reading = Reading { t_us, window_us, ..reading(&rotors) };
        let line = LogLine { reading: &reading, first_us }.to_string();
        let on_device: serde_json::Value = serde_json::from_str(&line).expect("JSON");
        let row = evtach_host::measure::ReadingRow::new(&reading, first_us);
        let on_pc: serde_json::Value =
            serde_json::from_str(&serde_json::to_string(&row).expect("JSON")).expect("JSON");
        prop_assert_eq!(on_device, on_pc);
    }
}

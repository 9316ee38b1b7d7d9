//! The link: any bytes, in any piecing, to a device whose state changes under it.
#![no_main]

#[path = "../../tests/link/bench.rs"]
#[allow(dead_code)]
mod bench;

use bench::{Bench, exchange};
use evtach_core::{Event, Evidence, Frame, Polarity, Reading, Reason, RotorReading, Speed, Status};
use evtach_firmware::instrument::{Fault, Sensor};
use evtach_firmware::scpi::{LINE_BYTES, Link};
use libfuzzer_sys::fuzz_target;

/// A reading that is as odd as its seed.
fn reading(seed: u8) -> Reading {
    let rotors = (0..seed % 9)
        .map(|index| RotorReading {
            id: index.wrapping_mul(seed),
            x_px: f32::from(seed),
            y_px: -0.0,
            radius_px: f32::MIN_POSITIVE,
            blades: (seed & 1 == 0).then_some(seed),
            status: if index & 1 == 0 {
                Status::Coarse
            } else {
                Status::Refused(Reason::Ambiguous)
            },
            speed: (index & 1 == 0).then_some(Speed {
                omega_rad_s: [0.0, f32::INFINITY, -1e38, 1e-38, 314.0][usize::from(seed) % 5],
                omega_sigma_rad_s: f32::NAN,
                alpha_rad_s2: Some(f32::from(seed)),
                frame: Frame::Room,
            }),
            evidence: Evidence::default(),
        })
        .collect();
    Reading {
        t_us: u64::from(seed) << 56,
        window_us: u32::MAX,
        events: u64::MAX,
        thinned: 0,
        lost: u64::from(seed),
        status: Status::Locked,
        rotors,
    }
}

fuzz_target!(|data: &[u8]| {
    let (mut link, mut bench) = (Link::new(), Bench::new(8 * 64));
    let mut now_us = 0;
    let mut rest = data;
    // A byte that says what happens to the device and how many bytes come next.
    while let Some((&step, behind)) = rest.split_first() {
        let (bytes, behind) = behind.split_at(behind.len().min(usize::from(step)));
        rest = behind;
        match step % 8 {
            0 => bench.show(reading(step)),
            1 => bench.reading = None,
            2 => bench.fault = Some((Fault::Panic, "\"\u{e4}\n".to_owned())),
            3 => bench.sensor = if step & 8 == 0 { Sensor::Absent } else { Sensor::Present },
            4 => {
                let event = Event { t_us: now_us, x: 1, y: 2, polarity: Polarity::On };
                bench.record(&[event; 9]);
            }
            5 => now_us += 400_000,
            6 => bench.alarm = !bench.alarm,
            _ => {}
        }
        exchange(&mut link, &mut bench, bytes, now_us);
        now_us += 1;
    }
    // Whatever came, a device clear brings it back.
    let long = [b' '; LINE_BYTES - 1];
    // A log line may come before it.
    let last = exchange(&mut link, &mut bench, b"\x03SYST:LOG OFF\n*OPC?\n", now_us);
    assert!(last.ends_with(b"1\n"));
    let line = [b"\x03".as_slice(), &long, b"\n*OPC?\n"].concat();
    assert_eq!(exchange(&mut link, &mut bench, &line, now_us), b"1\n");
});

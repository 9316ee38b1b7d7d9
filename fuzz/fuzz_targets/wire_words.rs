//! The wire-word decoders of the core, as the device feeds them.
#![no_main]

use evtach_core::decode::{Davis, Dvxplorer, Evt2, Evt3, Evt21, Mounting};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let (mut evt2, mut evt21, mut evt3) = (Evt2::new(), Evt21::new(), Evt3::new());
    let mounting = Mounting { swap_xy: data.len() % 2 == 0, flip_gyro_z: data.len() % 3 == 0 };
    let (mut davis, mut dvxplorer) = (Davis::new(mounting), Dvxplorer::new(mounting));
    for word in data.as_chunks().0 {
        evt2.decode(u32::from_le_bytes(*word), |event| assert!(event.x < 2048 && event.y < 2048));
    }
    for word in data.as_chunks().0 {
        evt21.decode(u64::from_le_bytes(*word), |event| {
            assert!(event.x < 2048 + 32 && event.y < 2048)
        });
    }
    for word in data.as_chunks().0 {
        let word = u16::from_le_bytes(*word);
        evt3.decode(word, |event| assert!(event.y < 2048));
        let samples = [
            davis.decode(word, |event| assert!(event.x < 4096 && event.y < 4096)),
            dvxplorer.decode(word, |event| {
                let (x, y) = if mounting.swap_xy { (event.y, event.x) } else { (event.x, event.y) };
                assert!(x < 1024 && y < 480);
            }),
        ];
        for sample in samples.into_iter().flatten() {
            assert!(sample.roll_rad_s.abs() < 40.0);
        }
    }
});

use Module::{Aps, Chip, Dvs, Imu, Input, Mux, System, Usb};
use Transfer::{ClearHalt, Read, Write};

use super::*;

/// What was asked of a camera until its first event.
fn asked(camera: Camera) -> Vec<Transfer> {
    let port = World::begin(vec![(0, plug(camera))]);
    let heard = run(&port, ANY, 3_000, |now, _| now.camera.is_some());
    assert!(heard.acquired.camera.is_some(), "{:?}", heard.stands);
    let world = port.0.borrow();
    world.camera().expect("a camera").log.clone()
}

fn writes(module: Module, values: &[(u16, u32)]) -> Vec<Transfer> {
    values
        .iter()
        .map(|&(parameter, value)| Write(Register::new(module, parameter), value))
        .collect()
}

fn reads(registers: &[(Module, u16)]) -> Vec<Transfer> {
    registers.iter().map(|&(module, parameter)| Read(Register::new(module, parameter))).collect()
}

/// The order of the DAVIS346 as libcaer and neuromorphic-drivers document it, written down apart from the driver's tables.
#[test]
fn a_davis_is_started_in_the_documented_order() {
    let questions = [
        (System, 0),
        (System, 7),
        (Dvs, 0),
        (Dvs, 1),
        (Dvs, 2),
        (Imu, 1),
        (Dvs, 50),
        (Dvs, 40),
        (Mux, 80),
        // What was dropped before: upper half, lower half, and the upper again.
        (Mux, 83),
        (Mux, 84),
        (Mux, 83),
    ];
    let order = [
        reads(&questions),
        writes(Dvs, &[(3, 0)]),
        writes(Aps, &[(4, 0)]),
        writes(Imu, &[(2, 0), (3, 0), (4, 0)]),
        writes(Input, &[(0, 0), (11, 0)]),
        writes(Mux, &[(0, 0), (1, 0)]),
        writes(Usb, &[(0, 0)]),
        writes(Mux, &[(3, 0)]),
        vec![ClearHalt(0x82)],
        // Voltages, then currents: type in the low four bits, fine value, coarse value.
        writes(Chip, &[(0, 0x19b), (1, 0x195), (2, 0x1e0), (3, 0x1c1), (4, 0x1d5)]),
        writes(
            Chip,
            &[
                (8, 0x5a4f),
                (9, 0x7d7e),
                (10, 0x427f),
                (11, 0x5fff),
                (12, 0x401f),
                (13, 0x690f),
                (14, 0x23ad),
                (15, 0x110d),
                (16, 0x419d),
                (17, 0x614d),
                (18, 0x6dbf),
                (19, 0x514d),
                (20, 0x001f),
                (21, 0x63cd),
                (22, 0x531f),
                (23, 0x65bf),
                (24, 0x450d),
                (25, 0x798d),
                (26, 0x5fff),
                (27, 0x5fff),
                (34, 0x5fef),
                (35, 0x8410),
                (36, 0x8410),
            ],
        ),
        (128..136).flat_map(|parameter| writes(Chip, &[(parameter, 0)])).collect(),
        writes(Chip, &[(136, 1), (137, 0), (138, 1), (140, 0), (141, 0), (143, 1), (144, 0)]),
        writes(Dvs, &[(52, 1), (51, 0), (41, 0), (42, 0), (43, 345), (44, 259)]),
        writes(Mux, &[(3, 1)]),
        reads(&[(System, 5), (System, 6)]),
        // 1 ms of an 80 MHz clock.
        writes(Usb, &[(1, 80_000), (0, 1)]),
        writes(Mux, &[(5, 1), (4, 1), (1, 1), (0, 1)]),
        writes(Dvs, &[(4, 0), (5, 0), (3, 1)]),
        writes(Imu, &[(5, 0), (6, 1)]),
        reads(&[(Imu, 0)]),
        writes(Imu, &[(9, 1), (10, 1), (3, 1)]),
    ];
    assert_eq!(asked(Camera::new(Model::Davis346, vec![])), order.concat());
}

#[test]
fn filters_and_a_gyro_that_a_davis_lacks_are_left_alone() {
    let mut camera = Camera::new(Model::Davis346, vec![]);
    camera.set(Register::new(Dvs, 40), 0);
    camera.set(Register::new(Dvs, 50), 0);
    camera.set(Register::new(Imu, 0), 1);
    let asked = asked(camera);
    let touched = |module, parameters: &[u16]| {
        asked.iter().any(|transfer| {
            matches!(transfer, Write(at, _) if at.module == module && parameters.contains(&at.parameter))
        })
    };
    assert!(!touched(Dvs, &[41, 42, 43, 44, 51, 52]));
    assert!(!touched(Imu, &[9]));
    assert!(touched(Imu, &[10]));
}

#[test]
fn a_dvxplorer_is_started_in_the_documented_order() {
    let chip = |values: &[(u16, u32)]| writes(Chip, values);
    let order = [
        reads(&[(System, 0), (System, 7), (Dvs, 0), (Dvs, 1), (Dvs, 2), (Imu, 1)]),
        reads(&[(Mux, 80), (Mux, 83), (Mux, 84), (Mux, 83)]),
        writes(Dvs, &[(3, 0)]),
        chip(&[(0x3000, 0)]),
        writes(Imu, &[(2, 0), (3, 0), (4, 0)]),
        writes(Input, &[(0, 0), (11, 0)]),
        writes(Mux, &[(0, 0), (1, 0)]),
        writes(Usb, &[(0, 0)]),
        writes(Mux, &[(3, 0)]),
        vec![ClearHalt(0x82)],
        writes(Mux, &[(3, 1)]),
        chip(&[(0x0d, 0x24), (0x0f, 0), (0x10, 0), (0x13, 3), (0x14, 0x7f), (0x15, 0)]),
        chip(&[(0x0b, 0), (0x0c, 0x14), (0x12, 0x6f), (0x18, 4), (0x1c, 8), (0x1e, 8)]),
        chip(&[(0x3011, 0xa0), (0x3019, 0), (0x301e, 1), (0x3067, 0x80)]),
        chip(&[(0x3255, 0x0c), (0x3266, 8)]),
        // 999 over two bytes, the upper one first.
        chip(&[(0x3235, 3), (0x3236, 0xe7), (0x3234, 49), (0x323d, 50)]),
        chip(&[(0x3243, 50), (0x3247, 50), (0x3259, 50)]),
        chip(&[(0x3244, 0), (0x3245, 0), (0x3246, 0), (0x3256, 0), (0x3257, 0), (0x3258, 1)]),
        chip(&[
            (0x323c, 4),
            (0x324c, 6),
            (0x324e, 4),
            (0x324f, 6),
            (0x3253, 8),
            (0x3254, 10),
            (0x324b, 4),
        ]),
        chip(&[(0x3500, 1), (0x3600, 1), (0x3260, 0), (0x3248, 0), (0x3200, 2), (0x3202, 0)]),
        chip(&[(0x3255, 0x0d), (0x3204, 0), (0x3201, 0), (0x325c, 0)]),
        // 45 000.
        chip(&[(0x325d, 0xaf), (0x325e, 0xc8), (0x3240, 0), (0x3241, 0), (0x3242, 7), (0x3201, 1)]),
        // All columns and rows.
        chip(&[
            (0x3300, 1),
            (0x3305, 0),
            (0x3306, 0),
            (0x3307, 2),
            (0x3308, 0x7f),
            (0x3301, 0),
            (0x3302, 0xff),
            (0x3303, 59),
            (0x3304, 0xff),
            (0x3300, 0),
        ]),
        chip(&[(0x3201, 2)]),
        writes(Mux, &[(4, 1), (5, 0)]),
        reads(&[(System, 5), (System, 6)]),
        writes(Usb, &[(1, 80_000), (0, 1)]),
        writes(Mux, &[(1, 1), (0, 1)]),
        writes(Dvs, &[(3, 1)]),
        // Gyro: 800 Hz, normal filter, 500 deg/s.
        writes(Imu, &[(8, 5), (9, 2), (10, 2), (3, 1)]),
        chip(&[(0x3000, 2)]),
    ];
    assert_eq!(asked(Camera::new(Model::Dvxplorer, vec![])), order.concat());
}

#[test]
fn the_camera_gets_the_time_it_needs() {
    for (model, needed_ms) in
        [(Model::Davis346, 100 + 10 + 200 + 50), (Model::Dvxplorer, 100 + 10 + 10)]
    {
        let port = World::begin(vec![(0, plug(Camera::new(model, vec![])))]);
        let heard = run(&port, ANY, 3_000, |now, _| now.camera.is_some());
        let needed = Duration::from_millis(needed_ms);
        assert!(
            (needed..needed + Duration::from_millis(20)).contains(&heard.took),
            "{}",
            heard.took
        );
    }
}

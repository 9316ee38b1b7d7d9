//! What goes wrong ends in a state with a name, and the device goes on.

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::RgbColor as _;
use evtach_firmware::instrument::{Fault, Instrument, Preferences, Sensor};
use evtach_firmware::sensor::usb::Trouble;
use evtach_tests::Loaded;

use super::boot::{differing, drawn};
use super::rig::{Board, Camera, Unplug};
use super::{DAVIS346, one_rotor};

const SENSOR: &str = "SYST:SENS?";

/// A device that reads events.
fn reading(sees: &Loaded) -> Option<Board> {
    let mut board = Board::switch_on()?;
    board.run(0.5);
    board.plug_camera(Camera::Davis346, sees);
    board.wait_for(3.0, SENSOR, |answer| answer.starts_with("\"present\""));
    Some(board)
}

/// The device comes to tell this speed.
fn reads(board: &mut Board, rpm: f64) {
    let speed = board.wait_for(8.0, "FETC?", |answer| !answer.starts_with("9.91"));
    let told: f64 = speed.parse().expect("a number");
    assert!((told / rpm - 1.0).abs() < 0.01, "{speed}");
}

/// The plug is pulled, and put in again: events come as before.
fn unplug_and_replug(how: Unplug) {
    let Some(mut board) = reading(&one_rotor(1500.0, 3000.0)) else { return };
    board.run(0.3);
    let before = board.camera()["seen"].as_u64().unwrap_or(0);
    assert!(before > 1000, "{before} events");
    board.unplug(how);
    board.wait_for(4.0, SENSOR, |answer| !answer.starts_with("\"present\""));
    assert_eq!(board.query("FETC:REAS?"), "\"no_sensor\"");
    assert!(board.query("FETC?").starts_with("9.91"));
    board.plug_again();
    board.wait_for(4.0, SENSOR, |answer| answer.starts_with("\"present\""));
    board.run(0.3);
    let after = board.camera()["seen"].as_u64().unwrap_or(0);
    assert!(after > before + 1000, "{before} events before, {after} after");
    reads(&mut board, 1500.0);
    assert_eq!(board.report()["faults"], serde_json::json!([]));
}

#[test]
fn unplugged_in_mid_stream() {
    unplug_and_replug(Unplug::Plain);
}

#[test]
fn unplugged_with_no_other_sign_than_the_ports() {
    unplug_and_replug(Unplug::Quiet);
}

#[test]
fn unplugged_without_a_word_from_the_port() {
    unplug_and_replug(Unplug::ErrorsOnly);
}

/// The PC's cable is pulled while the device sends, and put in again.
#[test]
fn a_pc_that_goes_while_it_is_told_something_is_answered_when_it_comes_back() {
    let Some(mut board) = reading(&one_rotor(1500.0, 3000.0)) else { return };
    reads(&mut board, 1500.0);
    board.serial("SYST:LOG ON");
    board.run(0.5);
    board.break_("pc unplug");
    board.run(1.5);
    board.break_("pc plug");
    board.run(1.0);
    board.read();
    board.wait_for(3.0, "SYST:LOG OFF;*IDN?", |answer| answer.starts_with("EV-Tach,"));
    assert_eq!(board.report()["faults"], serde_json::json!([]));
}

#[test]
fn a_stalled_endpoint_is_cleared() {
    let Some(mut board) = reading(&one_rotor(1500.0, 3000.0)) else { return };
    board.run(0.3);
    board.break_("fault halt");
    board.run(0.5);
    let before = board.camera()["seen"].as_u64().unwrap_or(0);
    board.run(0.3);
    let camera = board.camera();
    assert!(camera["seen"].as_u64() > Some(before), "{camera}");
    assert!(camera["waiting_bytes"].as_u64() < Some(16_384), "{camera}");
    assert!(board.query(SENSOR).starts_with("\"present\""));
    reads(&mut board, 1500.0);
}

#[test]
fn an_endpoint_that_stays_stalled_is_told() {
    let Some(mut board) = reading(&one_rotor(1500.0, 3000.0)) else { return };
    board.break_("fault dead");
    let told = board.wait_for(4.0, SENSOR, |answer| answer.starts_with("\"refused\""));
    assert!(told.contains("stops again and again"), "{told}");
    // Another camera is read.
    board.unplug(Unplug::Plain);
    board.wait_for(4.0, SENSOR, |answer| answer.starts_with("\"absent\""));
    board.plug_camera(Camera::Davis346, &one_rotor(1800.0, 3000.0));
    reads(&mut board, 1800.0);
}

#[test]
fn another_device_is_refused_by_name() {
    let Some(mut board) = Board::switch_on() else { return };
    board.run(0.5);
    board.plug_stick();
    let told = board.wait_for(3.0, SENSOR, |answer| answer.starts_with("\"refused\""));
    assert!(told.contains("0781:5567"), "{told}");
    board.run(0.5);
    let mut instrument = Instrument::new(Preferences::default());
    instrument.set_trouble(Some(Trouble::Foreign { vendor_id: 0x0781, product_id: 0x5567 }));
    instrument.show_picture(&super::walk::empty_picture());
    assert_eq!(differing(&board.lcd(), &drawn(&instrument)), 0, "pixels that differ from the PC's");
    board.unplug(Unplug::Plain);
    board.wait_for(2.0, SENSOR, |answer| answer.starts_with("\"absent\""));
    // And a camera in its place is read.
    board.plug_camera(Camera::Davis346, &one_rotor(1500.0, 3000.0));
    reads(&mut board, 1500.0);
    board.assert_sound();
}

/// The screen shows a fault, the link tells it, and the device goes on when it has been read.
fn shown_after_the_reset(crash: &str, seconds: f64, fault: Fault, name: &str) {
    let Some(mut board) = Board::switch_on() else { return };
    board.run(1.0);
    board.break_(crash);
    board.run(seconds);
    let said = board.wait_for(4.0, "SYST:FAULT?", |answer| !answer.contains("none"));
    assert!(said.starts_with(&format!("\"{name}\"")), "{said}");
    let mut instrument = Instrument::new(Preferences::default());
    instrument.fail(fault);
    instrument.show_picture(&super::walk::empty_picture());
    assert_eq!(differing(&board.lcd(), &drawn(&instrument)), 0, "pixels that differ from the PC's");
    board.query("SYST:FAULT:CLE;*OPC?");
    assert_eq!(board.query("FETC:REAS?"), "\"no_sensor\"");
    board.plug_camera(Camera::Davis346, &one_rotor(1500.0, 3000.0));
    reads(&mut board, 1500.0);
    assert_eq!(board.report()["resets"].as_array().map(Vec::len), Some(2));
}

#[test]
fn a_panic_is_shown_after_the_reset() {
    for handler in ["UART4", "UART5", "UART7"] {
        shown_after_the_reset(&format!("crash panic {handler}"), 1.0, Fault::Panic, "panic");
    }
}

#[test]
fn a_fault_of_the_processor_is_shown_after_the_reset() {
    shown_after_the_reset("crash undefined UART5", 1.0, Fault::Exception, "exception");
}

#[test]
fn a_task_that_hangs_is_caught_by_the_watchdog() {
    for handler in ["UART4", "UART5", "UART7"] {
        shown_after_the_reset(&format!("crash hang {handler}"), 6.0, Fault::Watchdog, "watchdog");
    }
}

#[test]
fn power_that_goes_while_settings_are_written_leaves_the_old_ones() {
    let Some(mut board) = Board::switch_on() else { return };
    board.run(1.0);
    assert_eq!(board.query("UNIT HZ;UNIT?"), "HZ");
    board.run(2.0);
    board.break_("power_cut_writing");
    assert_eq!(board.query("UNIT RADS;UNIT?"), "RADS");
    board.run(2.0);
    assert_eq!(board.report()["resets"], serde_json::json!(["Power", "Power"]));
    assert_eq!(board.query("UNIT?"), "HZ");
    assert!(board.query("SYST:FAULT?").contains("none"));
    // And with power.
    assert_eq!(board.query("UNIT RADS;UNIT?"), "RADS");
    board.run(2.0);
    board.break_("power_cut");
    board.run(1.0);
    assert_eq!(board.query("UNIT?"), "RADS");
}

#[test]
fn sdram_that_fails_its_test_is_told() {
    let Some(mut board) = Board::switch_on() else { return };
    board.break_("break_sdram 74564");
    board.break_("power_cut");
    board.run(1.0);
    let said = board.wait_for(2.0, "SYST:FAULT?", |answer| answer.starts_with("\"memory\""));
    assert!(said.contains("0xc0012344"), "{said}");
    assert!(board.defmt_log().iter().any(|line| line.contains("0xc0012344")));
    // The screen has moved into other memory, with eight bits a pixel.
    let mut instrument = Instrument::new(Preferences::default());
    instrument.fail(Fault::Memory);
    let (lcd, pc) = (board.lcd(), drawn(&instrument));
    let coarse = |pixel: &Rgb565| (pixel.r() >> 2, pixel.g() >> 3, pixel.b() >> 3);
    let wrong =
        lcd.pixels().iter().zip(pc.pixels()).filter(|(a, b)| coarse(a) != coarse(b)).count();
    assert_eq!(wrong, 0, "pixels that differ from the PC's");
    measures_once_mended(board);
}

/// What was broken is mended, and power comes again: the device measures as if nothing had been.
fn measures_once_mended(mut board: Board) {
    board.break_("mend");
    board.break_("power_cut");
    board.run(1.0);
    assert!(board.query("SYST:FAULT?").contains("none"));
    board.plug_camera(Camera::Davis346, &one_rotor(1500.0, 3000.0));
    reads(&mut board, 1500.0);
}

#[test]
fn a_crystal_that_does_not_swing_is_told() {
    let Some(mut board) = Board::switch_on() else { return };
    board.run(1.0);
    assert_eq!(board.report()["on_crystal"], true);
    // In the middle of something: the non-maskable interrupt ends the program, and the next start finds no crystal.
    board.break_("stop_crystal");
    board.run(1.5);
    let report = board.report();
    assert_eq!((&report["on_crystal"], &report["resets"][1]), (&false.into(), &"Software".into()));
    let mut instrument = Instrument::new(Preferences::default());
    instrument.fail(Fault::Crystal);
    assert_eq!(differing(&board.lcd(), &drawn(&instrument)), 0, "pixels that differ from the PC's");
    // Nothing takes that away.
    board.press(0.1);
    board.tap(240, 254);
    assert_eq!(differing(&board.lcd(), &drawn(&instrument)), 0, "pixels that differ from the PC's");
    board.run(10.0);
    assert_eq!(board.report()["resets"].as_array().map(Vec::len), Some(2), "the watchdog is fed");
    measures_once_mended(board);
}

#[test]
fn a_camera_that_sees_nothing_for_a_minute_starves_nobody() {
    let still = Loaded { geometry: DAVIS346, events: Vec::new() };
    let Some(mut board) = reading(&still) else { return };
    let before = board.report();
    board.run(60.0);
    let after = board.report();
    assert_eq!(board.query("FETC:REAS?"), "\"no_events\"");
    assert!(board.query("*IDN?").starts_with("EV-Tach"));
    let spent = |report: &serde_json::Value| {
        report["instructions"]
            .as_object()
            .map_or(0, |by| by.values().filter_map(|n| n.as_u64()).sum())
    };
    let per_s = (spent(&after) - spent(&before)) / 60;
    evtach_tests::show(&format!("idle camera: {per_s} instructions a second"));
    // A tenth of the processor, most of it for the screen.
    assert!(per_s < 21_600_000, "{per_s} instructions a second");
    let mut instrument = Instrument::new(Preferences::default());
    instrument.set_sensor(Sensor::Present);
    instrument.show_picture(&super::walk::empty_picture());
    assert_eq!(differing(&board.lcd(), &drawn(&instrument)), 0, "pixels that differ from the PC's");
    board.assert_sound();
}

//! No camera: the button is held while power comes, and a recording in the serial flash is played.

use evtach_firmware::sensor::spi::{Bridge, Kind};

use super::one_rotor;
use super::rig::Board;

/// Where the recording begins in the flash.
const REPLAY: u32 = 1 << 20;

#[test]
fn a_recording_in_the_serial_flash_is_replayed() {
    let Some(mut board) = Board::switch_on() else { return };
    let sees = one_rotor(1500.0, 3000.0);
    let mut bridge = Bridge::new(Kind::Evt2, sees.geometry, "a fan");
    let mut stream = Vec::new();
    for event in &sees.events {
        bridge.push(event, |frame| stream.extend_from_slice(frame));
    }
    bridge.end(|frame| stream.extend_from_slice(frame));
    board.flash(REPLAY, &stream);
    board.hold_button();
    board.break_("power_cut");
    board.run(0.5);
    board.break_("release");
    let read = |answer: &str| !answer.starts_with("9.91");
    let speed = board.wait_for(6.0, "FETC?", read);
    let rpm: f64 = speed.parse().expect("a number");
    assert!((rpm / 1500.0 - 1.0).abs() < 0.01, "{speed}");
    assert!(board.defmt_log().iter().any(|line| line.contains("serial flash is played")));
    // Nor was the button taken for HOLD, which it is later.
    let time = board.query("FETC:TIME?");
    board.wait_for(1.0, "FETC:TIME?", |answer| *answer != time);
    // Three seconds later it has begun anew, like a camera that was plugged in again.
    board.run(3.0);
    board.wait_for(6.0, "FETC?", read);
    assert_eq!(board.report()["faults"], serde_json::json!([]));
}

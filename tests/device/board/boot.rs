//! Switched on with nothing plugged in.

use evtach_firmware::instrument::{Instrument, Preferences};
use evtach_firmware::ui::Screen;
use evtach_host::frame::Frame;

use super::rig::Board;

/// The screen as the PC draws it.
pub fn drawn(instrument: &Instrument) -> Frame {
    let mut frame = Frame::default();
    let Ok(()) = Screen::new().draw(&mut frame, instrument);
    frame
}

/// Pixels that differ.
pub fn differing(a: &Frame, b: &Frame) -> usize {
    a.pixels().iter().zip(b.pixels()).filter(|(a, b)| a != b).count()
}

#[test]
fn boots_draws_and_answers() {
    let Some(mut board) = Board::switch_on() else { return };
    board.run(1.5);
    let report = board.report();
    assert_eq!(
        (report["hclk_hz"].as_u64(), report["on_crystal"].as_bool()),
        (Some(216_000_000), Some(true))
    );
    assert_eq!(report["panel_on"], true);
    assert_eq!(report["serial_names"][0], "EV-Tach");
    assert!(
        board.defmt_log().iter().any(|line| line.contains("EV-Tach")),
        "{:?}",
        board.defmt_log()
    );
    assert!(board.query("*IDN?").starts_with("EV-Tach,"));
    assert_eq!(board.query("FETC:REAS?"), "\"no_sensor\"");
    let lcd = board.lcd();
    let mut instrument = Instrument::new(Preferences::default());
    instrument.show_picture(&super::walk::empty_picture());
    assert_eq!(differing(&lcd, &drawn(&instrument)), 0, "pixels that differ from the PC's");
    board.assert_sound();
}

#[test]
fn ten_runs_are_one() {
    let (mut first, sees) = (None, super::one_rotor(1500.0, 200.0));
    for _ in 0..10 {
        let Some(mut board) = Board::switch_on() else { return };
        board.run(0.3);
        board.plug_camera(super::rig::Camera::Davis346, &sees);
        board.run(1.0);
        let this = (board.report().to_string(), board.defmt_log(), board.lcd());
        let first = first.get_or_insert_with(|| this.clone());
        assert_eq!(first.0, this.0);
        assert_eq!(first.1, this.1);
        assert!(first.2 == this.2, "another picture");
    }
}

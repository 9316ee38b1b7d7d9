//! Touch and button through every mode and page: the panel shows what the PC draws for the same actions, and what is in the tree.

use std::path::Path;

use evtach_core::Geometry;
use evtach_core::limits::DEVICE_HEAT_CELLS;
use evtach_core::rotors::HeatMap;
use evtach_firmware::instrument::{Action, Instrument, Page, Picture, Preferences};
use evtach_firmware::ui::{Press, action_at, button};
use evtach_host::frame::Frame;

use super::boot::{differing, drawn};
use super::rig::Board;

/// The sensor that the measurement is set up for until it knows better.
const BEFORE: Geometry = Geometry { width_px: 320, height_px: 320 };

/// What the measurement hands out before the first event.
pub fn empty_picture() -> Picture {
    let (mut counts, mut picture) = ([0; DEVICE_HEAT_CELLS], Picture::EMPTY);
    picture.take(&HeatMap::new(&mut counts, BEFORE));
    picture
}

/// A device and a PC that do the same.
struct Pair {
    board: Board,
    instrument: Instrument,
    steps: Vec<String>,
}

impl Pair {
    fn new() -> Option<Self> {
        let mut board = Board::switch_on()?;
        board.run(1.0);
        let mut instrument = Instrument::new(Preferences::default());
        instrument.show_picture(&empty_picture());
        Some(Self { board, instrument, steps: Vec::new() })
    }

    /// Taps the screen; what is there is worked out by the code that the device has.
    fn tap(&mut self, x: u16, y: u16) -> Option<Action> {
        let at = embedded_graphics::geometry::Point::new(x.into(), y.into());
        let action = action_at(&self.instrument.view(), at);
        if let Some(action) = action {
            self.instrument.act(action);
        }
        self.board.tap(x, y);
        self.compare(&format!("tap_{x}_{y}"));
        action
    }

    fn press(&mut self, press: Press) {
        self.instrument.act(button(&self.instrument.view(), press));
        self.board.press(if press == Press::Long { 0.8 } else { 0.1 });
        self.compare(if press == Press::Long { "press_long" } else { "press" });
    }

    fn compare(&mut self, step: &str) {
        self.steps.push(step.to_owned());
        let (lcd, pc) = (self.board.lcd(), drawn(&self.instrument));
        assert_eq!(
            differing(&lcd, &pc),
            0,
            "pixels that differ from the PC's after {:?}",
            self.steps
        );
        let name = format!("walk_{:02}_{step}.png", self.steps.len());
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("screens/board").join(name);
        if std::env::var_os("EVTACH_RENEW_SCREENS").is_some() {
            lcd.write_png(&path).expect("a file");
        }
        let golden = Frame::read_png(&path).expect("a picture of this step in the tree");
        assert_eq!(differing(&lcd, &golden), 0, "pixels that differ from {}", path.display());
    }
}

#[test]
fn touch_and_button_walk_through_everything() {
    let Some(mut pair) = Pair::new() else { return };
    const HOLD: (u16, u16) = (44, 253);
    const MODE: (u16, u16) = (122, 253);
    const UNIT: (u16, u16) = (278, 253);
    const SETUP: (u16, u16) = (434, 253);
    assert_eq!(pair.tap(HOLD.0, HOLD.1), Some(Action::ToggleHold));
    assert_eq!(pair.tap(HOLD.0, HOLD.1), Some(Action::ToggleHold));
    // Live, max, min, mean, and live again.
    for _ in 0..4 {
        assert_eq!(pair.tap(MODE.0, MODE.1), Some(Action::NextMode));
    }
    for _ in 0..4 {
        assert_eq!(pair.tap(UNIT.0, UNIT.1), Some(Action::NextUnit));
    }
    // The picture is a key: for aiming, and back.
    assert_eq!(pair.tap(69, 190), Some(Action::Page(Page::Aim)));
    assert_eq!(pair.tap(60, 253), Some(Action::Page(Page::Main)));
    assert_eq!(pair.tap(SETUP.0, SETUP.1), Some(Action::Page(Page::Settings)));
    assert_eq!(pair.tap(240, 253), Some(Action::Page(Page::Main)));
    pair.press(Press::Short);
    pair.press(Press::Short);
    for _ in 0..4 {
        pair.press(Press::Long);
    }
    // Where nothing is, nothing happens.
    assert_eq!(pair.tap(240, 90), None);
    pair.board.assert_sound();
}

#[test]
fn every_setting_can_be_reached() {
    let Some(mut pair) = Pair::new() else { return };
    pair.tap(434, 253);
    let mut tapped = 0;
    // Wherever a key is on the page; the one that leaves it is below.
    for y in (40..230).step_by(24) {
        for x in (20..480).step_by(40) {
            let at = embedded_graphics::geometry::Point::new(i32::from(x), i32::from(y));
            if action_at(&pair.instrument.view(), at).is_some() {
                tapped += 1;
                if tapped % 3 == 1 {
                    pair.tap(x, y);
                }
            }
        }
    }
    assert!(tapped > 9, "{tapped} keys");
}

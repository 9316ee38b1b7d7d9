//! Far more events than the port carries: it says so, reads all the same, and every event is accounted for.

use evtach_host::measure::ReadingRow;
use evtach_host::synth::{Model, Rotor, Scene};

use super::rig::{Board, Camera};
use super::synthesise;

/// Time after which the recording comes again.
const PERIOD_S: f64 = 0.96;

/// Events a second of which, every second one left out, the port carries the rest.
const CARRIED_EV_S: f64 = 3.0e6;

/// Rotations a minute of what turns so often in that time.
const fn rpm(turns: i32) -> f64 {
    turns as f64 * 60.0 / PERIOD_S
}

/// Each speed that is told is that of a rotor in view, and `read` of them are told in one reading, within so many seconds.
fn flood(rotors: Vec<Rotor>, least_ev_s: f64, read: usize, patience_s: usize) {
    let speeds: Vec<f64> = rotors.iter().map(|rotor| rotor.rpm).collect();
    let mut sees = synthesise(&Scene {
        rotors,
        duration_ms: PERIOD_S * 1e3,
        model: Model::Edge,
        ..Scene::default()
    });
    sees.events.retain(|event| event.t_us < (PERIOD_S * 1e6) as u64);
    let ev_s = sees.events.len() as f64 / PERIOD_S;
    assert!(ev_s > least_ev_s, "{ev_s}");
    let Some(mut board) = Board::switch_on() else { return };
    board.run(0.5);
    board.plug_camera_for_good(Camera::Davis346, &sees, PERIOD_S);
    board.wait_for(3.0, "SYST:SENS?", |answer| answer.starts_with("\"present\""));
    if least_ev_s > CARRIED_EV_S {
        board.wait_for(5.0, "FETC:REAS?", |answer| answer == "\"saturated\"");
    }
    board.serial("SYST:LOG ON");
    let (mut said, mut rows) = (String::new(), Vec::<ReadingRow>::new());
    let told = |row: &ReadingRow| row.rotors.iter().filter_map(|rotor| rotor.rpm).count();
    for _ in 0..10 * patience_s {
        board.run(0.1);
        said.push_str(&board.read());
        // The last line may be on its way.
        let rest = said.split_off(said.rfind('\n').map_or(0, |end| end + 1));
        let lines = std::mem::replace(&mut said, rest);
        rows.extend(
            lines.lines().map(|line| serde_json::from_str(line).expect("a line of the log")),
        );
        if rows.iter().any(|row| told(row) >= read) {
            break;
        }
    }
    board.serial("SYST:LOG OFF");
    let most = rows.iter().map(told).max();
    assert_eq!(most, Some(read), "of {speeds:?}: {rows:#?}");
    for told in rows.iter().flat_map(|row| &row.rotors).filter_map(|rotor| rotor.rpm) {
        let right = speeds.iter().any(|rpm| (told / rpm.abs() - 1.0).abs() < 0.01);
        assert!(right, "{told} is none of {speeds:?}");
    }
    board.run(0.1);
    board.read();
    assert!(board.query("*IDN?").starts_with("EV-Tach"));
    board.cover();
    // Ten times a second the camera is asked what it dropped, as long as it has something to say.
    board.run(1.2);
    // The camera's own filters leave out most of what the device could not use, its FIFO drops the rest, and both count.
    let camera = board.camera();
    let counted = |name: &str| camera[name].as_u64().unwrap_or(0);
    assert!(counted("filtered") > counted("seen") / 3, "{camera}");
    assert!(counted("dropped") < counted("seen") / 4, "{camera}");
    let fate = board.query("SYST:EVEN?");
    let fates: Vec<u64> = fate.split(',').filter_map(|count| count.parse().ok()).collect();
    let [used, thinned, late, lost_before, overrun] = fates[..] else { unreachable!("{fate}") };
    evtach_tests::show(&format!("a flood: {read} rotors; {fate}; {camera}"));
    // What the camera skips by order it does not count: one for each that comes. Whenever it is told to, up to 8192 events stand in
    // its FIFO and three transfers of 512 are under way, which are taken for some that were let through. Nor does it count what is
    // outside of the region, and nobody else does.
    const UNDER_WAY: u64 = 8_192 + 3 * 512;
    let outside = counted("filtered") - counted("skipped");
    let told = used + thinned + late + lost_before + overrun;
    let all = counted("seen") - outside;
    let under_way = UNDER_WAY * counted("skip_orders");
    assert!(told.abs_diff(all) < under_way, "{told} of {all}, {fate}; {camera}");
    assert!(used > 100_000, "{fate}; {camera}");
    assert_eq!(lost_before, counted("dropped"), "{fate}; {camera}");
    board.assert_sound();
}

/// Four times as many events as the device uses: the camera is told to leave out every second one, and all but the middle.
#[test]
fn one_rotor() {
    flood(vec![Rotor { rpm: rpm(112), ..Rotor::default() }], 4.0e6, 1, 10);
}

/// Less, so that what is left of the picture has all four in view.
#[test]
fn four_rotors() {
    let at = |x_px, y_px, turns| Rotor {
        x_px,
        y_px,
        rpm: rpm(turns),
        radius_px: 21.0,
        ..Rotor::default()
    };
    let rotors = vec![
        at(90.0, 70.0, 104),
        at(250.0, 70.0, -110),
        at(90.0, 190.0, -98),
        at(250.0, 190.0, 107),
    ];
    flood(rotors, 2.0e6, 4, 20);
}

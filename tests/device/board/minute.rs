//! A minute before a rotor that gives a million events a second: where they go, and what each part of the program costs.

use evtach_host::synth::{Model, Rotor, Scene};
use evtach_tests::{Loaded, show};
use serde_json::Value;

use super::rig::{Board, Camera};
use super::synthesise;

/// Seconds of the minute.
const SECONDS: u32 = 60;

/// Rotations a minute: 48 ms a turn.
const RPM: f64 = 1250.0;

/// Most that all handlers may take together, in million instructions a second, of 216.
const MOST_LOAD: f64 = 200.0;

/// Time after which the recording comes again: 20 turns.
const PERIOD_S: f64 = 0.96;

/// One rotor, a million events a second, for as many turns as it takes to begin again.
fn a_million_a_second() -> Loaded {
    let rotor = Rotor { rpm: RPM, ..Rotor::default() };
    let scene = Scene {
        rotors: vec![rotor],
        duration_ms: PERIOD_S * 1e3,
        model: Model::Edge,
        ..Scene::default()
    };
    let mut sees = synthesise(&scene);
    sees.events.retain(|event| event.t_us < (PERIOD_S * 1e6) as u64);
    sees
}

/// Instructions of each handler between two reports, in millions a second.
fn loads(before: &Value, after: &Value) -> Vec<(String, f64)> {
    let of = |report: &Value, name: &str| report["instructions"][name].as_f64().unwrap_or(0.0);
    let seconds = |report: &Value| report["seconds"].as_f64().unwrap_or(0.0);
    let took_s = seconds(after) - seconds(before);
    let names = after["instructions"].as_object().into_iter().flatten();
    names
        .map(|(name, _)| (name.clone(), (of(after, name) - of(before, name)) / took_s * 1e-6))
        .collect()
}

/// Answers that are numbers.
fn counts(answer: &str) -> Vec<u64> {
    answer.split(',').filter_map(|count| count.parse().ok()).collect()
}

/// What lies outside of the part that is looked at costs little, and none of the time for measuring.
#[test]
fn a_part_of_the_picture_is_looked_at_beside_a_million_events_a_second() {
    let Some(mut board) = Board::switch_on() else { return };
    let sees = a_million_a_second();
    board.run(0.5);
    board.plug_camera_for_good(Camera::Davis346, &sees, PERIOD_S);
    board.wait_for(3.0, "SYST:SENS?", |answer| answer.starts_with("\"present\""));
    assert_eq!(board.query("ROI 0,0,20,20;ROI?"), "0,0,20,20");
    // What was in the window then is in none.
    board.run(0.5);
    let before = counts(&board.query("SYST:EVEN?"));
    board.run(2.0);
    assert_eq!(board.query("SYST:FAUL?"), "\"none\",\"\"");
    let after = counts(&board.query("SYST:EVEN?"));
    assert_eq!(before.get(2), after.get(2), "events late: {before:?} {after:?}");
    // A half of the rotor.
    assert_eq!(board.query("ROI 173,70,90,120;ROI?"), "173,70,90,120");
    board.wait_for(4.0, "FETC?", |answer| {
        answer.parse::<f64>().is_ok_and(|rpm| (rpm / RPM - 1.0).abs() < 0.01)
    });
    assert_eq!(board.report()["faults"], serde_json::json!([]));
}

#[test]
fn a_minute_of_a_million_events_a_second_is_accounted_for_and_none_is_lost() {
    let Some(mut board) = Board::switch_on() else { return };
    let sees = a_million_a_second();
    board.run(0.5);
    board.plug_camera_for_good(Camera::Davis346, &sees, PERIOD_S);
    board.wait_for(3.0, "SYST:SENS?", |answer| answer.starts_with("\"present\""));
    board.wait_for(2.0, "FETC?", |answer| !answer.starts_with("9.91"));
    let searched = counts(&board.query("SYST:EVEN?"));
    let before = board.report();
    board.serial("SYST:LOG ON");
    let (mut readings, mut far, mut said) = (0, Vec::new(), String::new());
    for _ in 0..SECONDS {
        board.run(1.0);
        said.push_str(&board.read());
        // The last line may be on its way.
        let rest = said.split_off(said.rfind('\n').map_or(0, |end| end + 1));
        for line in std::mem::replace(&mut said, rest).lines() {
            let reading: Value = serde_json::from_str(line).expect("a line of the log");
            readings += 1;
            for rotor in reading["rotors"].as_array().into_iter().flatten() {
                let rpm = rotor["rpm"].as_f64().unwrap_or(0.0);
                if (rpm / RPM - 1.0).abs() > 2e-3 {
                    far.push(reading.to_string());
                }
            }
        }
    }
    let after = board.report();
    board.serial("SYST:LOG OFF");
    board.cover();
    // Ten times a second the camera is asked what it dropped.
    board.run(1.2);
    board.read();
    let camera = board.camera();
    let fate = counts(&board.query("SYST:EVEN?"));
    let [used, thinned, late, lost_before, overrun] = fate[..] else { unreachable!("{fate:?}") };
    let seen = camera["seen"].as_u64().unwrap_or(0);
    let mut table = format!(
        "{seen} events in {SECONDS} s, {readings} readings: {used} used, {thinned} thinned, {late} late, {lost_before} \
         lost by the camera, {overrun} lost for want of room; before the first reading {searched:?}; million instructions a second:"
    );
    for (handler, load) in loads(&before, &after) {
        table.push_str(&format!("\n  {handler:16} {load:7.2}"));
    }
    show(&table);
    // Taking in, the front, measuring, both USB cores, time: each is there, and together they leave some of the processor.
    let loads = loads(&before, &after);
    for name in ["UART4", "UART5", "UART7", "OTG_HS", "OTG_FS", "TIM8_BRK_TIM12"] {
        assert!(
            loads.iter().any(|(handler, load)| handler == name && *load > 0.0),
            "{name}: {loads:?}"
        );
    }
    let together: f64 = loads.iter().map(|(_, load)| load).sum();
    assert!(together < MOST_LOAD, "{together} million instructions a second");
    assert!(seen > 1_000_000 * u64::from(SECONDS), "{camera}");
    assert_eq!((&camera["filtered"], &camera["dropped"]), (&0.into(), &0.into()), "{camera}");
    assert_eq!(used + thinned + late + lost_before + overrun, seen);
    assert_eq!((lost_before, overrun), (0, 0));
    // All are in a window that was measured, also while the rotor was searched for, and when a measurement took longer than others.
    assert_eq!(late, 0, "{fate:?} of {seen}; before the first reading {searched:?}");
    assert!(used > seen / 5 * 4 && thinned < seen / 10, "{fate:?} of {seen}");
    assert!(readings > 10 * SECONDS, "{readings}");
    assert_eq!(far, Vec::<String>::new(), "speeds that are far off");
    board.assert_sound();
}

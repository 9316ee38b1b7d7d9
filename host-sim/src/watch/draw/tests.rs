use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::super::Told;
use super::*;

fn rotor(id: &str, rpm: Option<f64>, reason: Option<&'static str>) -> RotorRow {
    RotorRow {
        id: id.into(),
        x_px: 167.5,
        y_px: 146.0,
        radius_px: 55.0,
        rpm,
        rpm_sigma: rpm.map(|rpm| rpm * 5e-4),
        direction: rpm.map(|_| "cw".into()),
        blades: rpm.map(|_| 5),
        accel_rpm_per_s: None,
        frame: rpm.map(|_| "camera".into()),
        status: if rpm.is_some() { "locked" } else { "refused" }.into(),
        reason: reason.map(Into::into),
    }
}

fn reading(t_s: f64, rotors: Vec<RotorRow>) -> Told {
    let refused = rotors.iter().all(|rotor| rotor.rpm.is_none());
    Told::Reading(ReadingRow {
        t_s,
        window_s: 0.15,
        status: if refused { "refused" } else { "locked" }.into(),
        reason: refused.then(|| "no_rotation".into()),
        rotors,
    })
}

fn drawn(monitor: &Monitor, now_s: f64) -> String {
    let mut terminal = Terminal::new(TestBackend::new(72, 20)).expect("a buffer has no errors");
    let now = Duration::from_secs_f64(now_s);
    terminal.draw(|frame| draw(frame, monitor, now)).expect("a buffer has no errors");
    terminal.backend().to_string()
}

#[test]
fn before_the_first_reading() {
    insta::assert_snapshot!(drawn(&Monitor::new("/dev/ttyACM0".into()), 0.0));
}

#[test]
fn two_rotors_and_a_trend() {
    let mut monitor = Monitor::new("fan.raw".into());
    for i in 0..40 {
        let t_s = 0.1 * f64::from(i);
        let rpm = 1180.0 + 3.0 * (0.3 * f64::from(i)).sin();
        let rotors = vec![rotor("A", Some(rpm), None), rotor("B", None, Some("too_few_events"))];
        monitor.take(reading(t_s, rotors), Duration::from_secs_f64(t_s));
    }
    insta::assert_snapshot!(drawn(&monitor, 4.0));
}

#[test]
fn refused_shows_dashes_and_no_digit_of_a_speed() {
    let mut monitor = Monitor::new("wall.raw".into());
    monitor.take(reading(0.5, vec![rotor("A", None, Some("no_rotation"))]), Duration::ZERO);
    monitor.take(Told::End, Duration::ZERO);
    insta::assert_snapshot!(drawn(&monitor, 60.0));
    assert!(!monitor.seen_speed());
}

#[test]
fn a_device_that_falls_silent_is_held() {
    let mut monitor = Monitor::new("/dev/ttyACM0".into());
    monitor.take(reading(0.5, vec![rotor("A", Some(1180.3), None)]), Duration::from_secs(1));
    assert!(drawn(&monitor, 2.9).contains("0.5 s   locked"));
    assert!(drawn(&monitor, 3.1).contains("0.5 s   held"));
    assert!(drawn(&monitor, 4.9).contains("1180.3"));
    assert!(drawn(&monitor, 5.1).contains("-----"));
}

#[test]
fn tab_goes_round_the_rotors() {
    let mut monitor = Monitor::new("fan.raw".into());
    monitor.choose_next();
    let both = vec![rotor("A", Some(1180.0), None), rotor("B", Some(2400.0), None)];
    monitor.take(reading(0.1, both), Duration::ZERO);
    let shown = |monitor: &Monitor| monitor.rotor().map(|rotor| rotor.id.clone());
    assert_eq!(shown(&monitor).as_deref(), Some("A"));
    monitor.choose_next();
    assert_eq!(shown(&monitor).as_deref(), Some("B"));
    assert_eq!(monitor.trend(), [(0.1, 2400.0, 1.2)]);
    // B is gone.
    monitor.take(reading(0.2, vec![rotor("A", Some(1180.0), None)]), Duration::ZERO);
    assert_eq!(shown(&monitor).as_deref(), Some("A"));
    monitor.choose_next();
    assert_eq!(shown(&monitor).as_deref(), Some("A"));
}

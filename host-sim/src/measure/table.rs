//! The table of `evtach measure` for people.

use std::fmt::Write as _;

use evtach_core::{Frame, Reading, RotorReading, Speed, Status};

use super::json::{FileFacts, letter};
use super::summary::{OneWay, Summary};

/// Formats the result of one recording.
#[must_use]
pub fn table(facts: &FileFacts, summary: &Summary, readings: &[Reading]) -> String {
    let mut text = String::new();
    let (width, height) = facts.size_px;
    let _ = writeln!(
        text,
        "{}: {} {width}x{height}, {:.3} s, {} events ({} thinned, {} lost), {} reading{}",
        facts.file,
        facts.format,
        facts.duration_s(),
        facts.events,
        facts.thinned,
        facts.lost,
        readings.len(),
        if readings.len() == 1 { "" } else { "s" }
    );
    for rotor in &summary.rotors {
        let _ = writeln!(text, "  {}{}", row(rotor), stretch(facts, readings, rotor));
    }
    let is_told = |letter: &u8| summary.rotors.iter().any(|rotor| rotor.id == *letter);
    let spoken = readings.iter().flat_map(|reading| &reading.rotors).filter(|r| r.speed.is_some());
    let mut brief: Vec<u8> = spoken.map(|rotor| rotor.id).collect();
    brief.sort_unstable();
    brief.dedup();
    brief.retain(|letter| !is_told(letter));
    if !brief.is_empty() {
        let letters: Vec<String> = brief.into_iter().map(letter).collect();
        let _ = writeln!(text, "  for a short time only, see --json: {}", letters.join(", "));
    }
    if let Status::Refused(reason) = summary.status {
        let _ = writeln!(text, "  no reading: {} ({})", reason.as_str(), reason.advice());
    }
    text
}

/// From when to when a rotor was as well measured as it is told, where that leaves more of the recording open than a window, where it
/// turned round meanwhile, or where there are several recordings.
fn stretch(facts: &FileFacts, readings: &[Reading], told: &RotorReading) -> String {
    let is_it = |rotor: &RotorReading| (rotor.id, rotor.status) == (told.id, told.status);
    let mut of_it: Vec<&Reading> =
        readings.iter().filter(|reading| reading.rotors.iter().any(is_it)).collect();
    let all = of_it.len();
    if told.status == Status::Locked {
        let one_way = OneWay::of(readings, told.id, &(facts.first_us..facts.last_us));
        of_it = one_way.rows.into_iter().map(|(reading, _)| reading).collect();
    }
    let (Some(first), Some(last)) = (of_it.first(), of_it.last()) else { return String::new() };
    let half_us = |reading: &Reading| u64::from(reading.window_us) / 2;
    let start_us = first.t_us.saturating_sub(half_us(first));
    let end_us = last.t_us.saturating_add(half_us(last));
    let open_us = start_us.saturating_sub(facts.first_us).max(facts.last_us.saturating_sub(end_us));
    let is_whole = of_it.len() == all && facts.streams_us.len() <= 1;
    if is_whole && open_us <= u64::from(first.window_us.max(last.window_us)) {
        return String::new();
    }
    format!("  from {:.2} to {:.2} s", facts.t_s(start_us), facts.t_s(end_us))
}

/// One rotor in one line.
fn row(rotor: &RotorReading) -> String {
    let place = format!("at ({:.0}, {:.0}) r {:.0} px", rotor.x_px, rotor.y_px, rotor.radius_px);
    let Some(speed) = &rotor.speed else {
        let reason = rotor.status.reason().map_or("", evtach_core::Reason::as_str);
        return format!("{}  ----- rpm  {reason}  {place}", letter(rotor.id));
    };
    let blades = match rotor.blades {
        Some(1) => "1 mark or blade".to_owned(),
        Some(n) => format!("{n} blades"),
        None => "blades unknown".to_owned(),
    };
    let frame = match speed.frame {
        Frame::Camera => "",
        Frame::Room => " in the room",
    };
    let mut line = format!(
        "{}  {} rpm {}{frame}  {blades}  {}  {place}",
        letter(rotor.id),
        with_error(speed),
        speed.direction().as_str(),
        rotor.status.as_str()
    );
    if let Some(acceleration) = speed.accel_rpm_per_s() {
        let _ = write!(line, "  {acceleration:+.1} rpm/s");
    }
    line
}

/// Speed and error bar with as many digits as the error supports: its first two.
fn with_error(speed: &Speed) -> String {
    let sigma = f64::from(speed.rpm_sigma());
    let digits = (1.0 - sigma.max(1e-6).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{:.digits$} ± {:.digits$}", speed.rpm(), sigma)
}

/// What each stage found, for `-v`.
#[must_use]
pub fn evidence(facts: &FileFacts, readings: &[Reading]) -> String {
    let mut text = String::new();
    let rpm = |value: Option<f32>| {
        value.map_or_else(|| "-".to_owned(), |v| format!("{:.2}", v * Speed::RPM_PER_RAD_S))
    };
    let plain = |value: Option<f32>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
    for reading in readings {
        let _ = writeln!(
            text,
            "  t {:.3} s, window {:.0} ms, {} events: {}{}",
            facts.t_s(reading.t_us),
            f64::from(reading.window_us) * 1e-3,
            reading.events,
            reading.status.as_str(),
            reading.status.reason().map_or_else(String::new, |r| format!(" ({})", r.as_str()))
        );
        for rotor in &reading.rotors {
            let e = &rotor.evidence;
            let _ = writeln!(text, "    {}", row(rotor));
            let _ = writeln!(
                text,
                "      events {}  in step {}  scan {} rpm, score {}, standing {}  symmetry {}  periods {}",
                e.events,
                plain(e.coherence),
                rpm(e.scan_rad_s),
                plain(e.scan_score),
                plain(e.scan_standing),
                plain(e.symmetry_score),
                plain(e.periods)
            );
            let _ = writeln!(
                text,
                "      initial {}  refined {} ± {}  further {}  lock {} ± {}  phase {} ± {}  swing {}  fractional {}  sharp to {} px",
                rpm(e.initial_rad_s),
                rpm(e.refined_rad_s),
                rpm(e.refined_sigma_rad_s),
                rpm(e.further_rad_s),
                rpm(e.lock_rad_s),
                rpm(e.lock_sigma_rad_s),
                rpm(e.phase_rad_s),
                rpm(e.phase_sigma_rad_s),
                rpm(e.swing_rad_s),
                plain(e.fractional_deviation),
                plain(e.sharpness_px)
            );
        }
    }
    text
}

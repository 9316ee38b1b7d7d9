//! The reading over a whole recording, from the series.

use std::ops::Range;

use evtach_core::{Reading, Reason, RotorReading, Status};

use super::mean::{Piece, mean_speed};

/// A rotor must be measured in this share of the readings that the most seen one is measured in, else it
/// stands in the series only.
const LEAST_SHARE: f64 = 0.25;
/// The same for a rotor that was found but never measured, among all readings.
const LEAST_SHARE_REFUSED: f64 = 0.5;

/// The reading over a whole recording.
#[derive(Clone, Debug)]
pub struct Summary {
    /// The best status among the rotors.
    pub status: Status,
    /// Rotors in the order of their letters; mean speed over the recording.
    pub rotors: Vec<RotorReading>,
}

impl Summary {
    /// Whether any rotor has a speed.
    #[must_use]
    pub fn has_speed(&self) -> bool {
        self.rotors.iter().any(|rotor| rotor.speed.is_some())
    }
}

/// Sums up a series; `span_us` is from the first event of the recording to the last, in sensor time.
#[must_use]
pub fn summarise(readings: &[Reading], span_us: &Range<u64>, clock_sigma_ppm: f32) -> Summary {
    let mut ids: Vec<u8> = readings.iter().flat_map(|r| r.rotors.iter().map(|r| r.id)).collect();
    ids.sort_unstable();
    ids.dedup();
    let measured =
        |id: u8| rows(readings, id).filter(|(_, rotor)| rotor.speed.is_some()).count() as f64;
    let most = ids.iter().map(|id| measured(*id)).fold(0.0, f64::max);
    let rotors: Vec<RotorReading> = ids
        .iter()
        .filter(|id| {
            let seen = measured(**id);
            if seen > 0.0 {
                seen >= LEAST_SHARE * most
            } else {
                // Found but never measured: told when it is there all the time.
                rows(readings, **id).count() as f64 >= LEAST_SHARE_REFUSED * readings.len() as f64
            }
        })
        .filter_map(|id| over_recording(readings, *id, span_us, clock_sigma_ppm))
        .collect();
    let has = |status: Status| rotors.iter().any(|rotor| rotor.status == status);
    let status = if has(Status::Locked) {
        Status::Locked
    } else if has(Status::Coarse) {
        Status::Coarse
    } else {
        refusal(readings)
    };
    Summary { status, rotors }
}

fn rows(readings: &[Reading], id: u8) -> impl Iterator<Item = (&Reading, &RotorReading)> {
    readings.iter().flat_map(move |reading| {
        reading.rotors.iter().filter(move |rotor| rotor.id == id).map(move |rotor| (reading, rotor))
    })
}

/// The reason of the longest window that was refused: it had the most to go by.
fn refusal(readings: &[Reading]) -> Status {
    let longest = readings.iter().max_by_key(|reading| reading.window_us);
    longest.map_or(Status::Refused(Reason::NoEvents), |reading| match reading.status {
        Status::Refused(_) => reading.status,
        Status::Locked | Status::Coarse => Status::Refused(Reason::Ambiguous),
    })
}

/// One rotor over the recording: from its locked readings, else its sharpest coarse one, else its last refusal.
fn over_recording(
    readings: &[Reading],
    id: u8,
    span_us: &Range<u64>,
    clock_sigma_ppm: f32,
) -> Option<RotorReading> {
    let locked: Vec<_> =
        rows(readings, id).filter(|(_, rotor)| rotor.status == Status::Locked).collect();
    if let Some((_, last)) = locked.last() {
        let mut rotor = (*last).clone();
        let pieces: Vec<Piece> = locked
            .iter()
            .filter_map(|(reading, rotor)| {
                Some(Piece::new(reading, rotor.speed?, rotor.evidence.swing_rad_s))
            })
            .collect();
        rotor.speed = mean_speed(&pieces, span_us, clock_sigma_ppm);
        let middle_us = span_us.start.midpoint(span_us.end);
        let middle = locked.iter().min_by_key(|(reading, _)| reading.t_us.abs_diff(middle_us));
        if let Some((_, middle)) = middle {
            (rotor.x_px, rotor.y_px) = (middle.x_px, middle.y_px);
        }
        return Some(rotor);
    }
    let sigma = |rotor: &RotorReading| rotor.speed.map_or(f32::MAX, |s| s.omega_sigma_rad_s);
    rows(readings, id)
        .filter(|(_, rotor)| rotor.speed.is_some())
        .min_by(|a, b| sigma(a.1).total_cmp(&sigma(b.1)))
        .or_else(|| rows(readings, id).last())
        .map(|(_, rotor)| rotor.clone())
}

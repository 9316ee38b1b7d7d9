//! The reading over a whole recording, from the series.

use std::ops::Range;

use evtach_core::{Reading, Reason, RotorReading, Status};

use super::mean::mean_speed;
use super::piece::{Piece, window_us};

/// A rotor must be measured in this share of the readings that the most seen one is measured in, else it
/// stands in the series only.
const LEAST_SHARE: f64 = 0.25;
/// The same for a rotor that was found but never measured, among all readings: where none is measured, each of them searches.
const LEAST_SHARE_REFUSED: f64 = 0.5;
/// And beside one that is measured: while it is followed, only every third reading searches.
const LEAST_SHARE_REFUSED_BESIDE: f64 = 0.25;

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

/// Sums up the series of recordings put behind each other, none of which shares a letter with another; `streams_us` are the span of each.
#[must_use]
pub fn summarise_all(
    readings: &[Reading],
    streams_us: &[Range<u64>],
    clock_sigma_ppm: f32,
) -> Summary {
    let (mut rest, mut rotors) = (readings, Vec::new());
    for (index, span_us) in streams_us.iter().enumerate() {
        let is_later = |reading: &Reading| {
            streams_us.get(index + 1).is_some_and(|next_us| reading.t_us >= next_us.start)
        };
        let of_it = rest.iter().position(is_later).unwrap_or(rest.len());
        rotors.extend(summarise(&rest[..of_it], span_us, clock_sigma_ppm).rotors);
        rest = &rest[of_it..];
    }
    rotors.sort_by_key(|rotor| rotor.id);
    Summary { status: best_status(&rotors, readings), rotors }
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
                let beside = most > 0.0;
                let share = if beside { LEAST_SHARE_REFUSED_BESIDE } else { LEAST_SHARE_REFUSED };
                rows(readings, **id).count() as f64 >= share * readings.len() as f64
            }
        })
        .filter_map(|id| over_recording(readings, *id, span_us, clock_sigma_ppm))
        .collect();
    Summary { status: best_status(&rotors, readings), rotors }
}

/// The best status among the rotors, or why there is none.
fn best_status(rotors: &[RotorReading], readings: &[Reading]) -> Status {
    let has = |status: Status| rotors.iter().any(|rotor| rotor.status == status);
    if has(Status::Locked) {
        Status::Locked
    } else if has(Status::Coarse) {
        Status::Coarse
    } else {
        refusal(readings)
    }
}

fn rows(readings: &[Reading], id: u8) -> impl Iterator<Item = (&Reading, &RotorReading)> {
    readings.iter().flat_map(move |reading| {
        reading.rotors.iter().filter(move |rotor| rotor.id == id).map(move |rotor| (reading, rotor))
    })
}

/// The reason of the longest window that was refused: it had the most to go by.
fn refusal(readings: &[Reading]) -> Status {
    let refused = readings.iter().filter(|reading| reading.status.reason().is_some());
    let longest = refused.max_by_key(|reading| reading.window_us);
    longest.map_or(Status::Refused(Reason::NoEvents), |reading| reading.status)
}

/// One rotor over the recording: from its locked readings, else its sharpest coarse one, else its last refusal.
fn over_recording(
    readings: &[Reading],
    id: u8,
    span_us: &Range<u64>,
    clock_sigma_ppm: f32,
) -> Option<RotorReading> {
    let OneWay { rows: locked, span_us } = OneWay::of(readings, id, span_us);
    if let Some((_, last)) = locked.last() {
        let mut rotor = (*last).clone();
        let pieces: Vec<Piece> = locked
            .iter()
            .filter_map(|(reading, rotor)| {
                Some(Piece::new(reading, rotor.speed?, rotor.evidence.swing_rad_s))
            })
            .collect();
        rotor.speed = mean_speed(&pieces, &span_us, clock_sigma_ppm);
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

/// The locked readings of a rotor, in all of which it turns in one direction: where it turned round, those of the longest stretch, for
/// the mean over both directions would be the speed of neither.
pub(super) struct OneWay<'a> {
    pub rows: Vec<(&'a Reading, &'a RotorReading)>,
    /// From when to when it did not turn in the other one, as far as is known.
    pub span_us: Range<u64>,
}

impl<'a> OneWay<'a> {
    /// Of the readings of a recording that lasts `span_us`.
    pub fn of(readings: &'a [Reading], id: u8, span_us: &Range<u64>) -> Self {
        let locked: Vec<_> =
            rows(readings, id).filter(|(_, rotor)| rotor.status == Status::Locked).collect();
        let way = |rotor: &RotorReading| rotor.speed.map(|speed| speed.direction());
        let lasts_us = |stretch: &&[(&Reading, _)]| {
            let ends = stretch.first().zip(stretch.last());
            ends.map(|(first, last)| window_us(last.0).end.saturating_sub(window_us(first.0).start))
        };
        let stretches = locked.chunk_by(|a, b| way(a.1) == way(b.1));
        let longest = stretches.max_by_key(lasts_us).unwrap_or_default();
        let mut span_us = span_us.clone();
        if let (Some((first, _)), Some((last, _))) = (longest.first(), longest.last()) {
            if locked.first().is_some_and(|(reading, _)| reading.t_us < first.t_us) {
                span_us.start = window_us(first).start;
            }
            if locked.last().is_some_and(|(reading, _)| reading.t_us > last.t_us) {
                span_us.end = window_us(last).end;
            }
        }
        Self { rows: longest.to_vec(), span_us }
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::{Evidence, Frame, Speed};

    use super::*;

    /// A reading every 50 ms, over 150 ms each, with a rotor of these speeds.
    fn readings(rpm: &[f32]) -> Vec<Reading> {
        let at = |(i, rpm): (u64, &f32)| {
            let speed = Speed {
                omega_rad_s: rpm / Speed::RPM_PER_RAD_S,
                omega_sigma_rad_s: 0.01,
                alpha_rad_s2: None,
                frame: Frame::Camera,
            };
            let rotor = RotorReading {
                id: 0,
                x_px: i as f32,
                y_px: 50.0,
                radius_px: 40.0,
                blades: None,
                status: Status::Locked,
                speed: Some(speed),
                evidence: Evidence::default(),
            };
            Reading {
                t_us: 75_000 + 50_000 * i,
                window_us: 150_000,
                events: 1000,
                thinned: 0,
                lost: 0,
                status: Status::Locked,
                rotors: [rotor].into_iter().collect(),
            }
        };
        (0..).zip(rpm).map(at).collect()
    }

    #[test]
    fn what_is_refused_in_every_search_is_told_beside_a_rotor_that_is_followed() {
        // Found in these of eighteen readings, of which every third searches while another rotor is followed.
        let told = |found: &[usize], is_beside: bool| {
            let mut readings = readings(&[1500.0; 18]);
            for (index, reading) in readings.iter_mut().enumerate() {
                let refused = RotorReading {
                    id: 1,
                    status: Status::Refused(Reason::TooFast),
                    speed: None,
                    ..reading.rotors[0].clone()
                };
                let followed = is_beside.then(|| reading.rotors[0].clone());
                let found = found.contains(&index).then_some(refused);
                reading.rotors = followed.into_iter().chain(found).collect();
            }
            let summary = summarise(&readings, &(0..1_000_000), 0.0);
            summary.rotors.iter().any(|rotor| rotor.id == 1)
        };
        let [all, every_third, few] =
            [(0..18).collect(), (0..18).step_by(3).collect(), vec![0, 3, 9, 15]];
        for (found, beside, alone) in
            [(all, true, true), (every_third, true, false), (few, false, false)]
        {
            assert_eq!((told(&found, true), told(&found, false)), (beside, alone), "{found:?}");
        }
    }

    #[test]
    fn a_rotor_that_turns_round_is_told_by_its_longest_stretch_in_one_direction() {
        // To and fro: each mean is of one direction, and of none of the time in which it turned in the other one.
        for (rpm, expected_rpm, span_ms) in [
            (vec![1500.0, 1500.0, 1500.0, -1200.0], 1500.0, 0..250),
            (vec![1500.0, -1200.0, -1200.0], -1200.0, 50..300),
            (vec![900.0, -1200.0, -1200.0, 900.0], -1200.0, 50..250),
            (vec![1500.0, 1500.0, 1500.0], 1500.0, 0..300),
        ] {
            let (readings, whole_us) = (readings(&rpm), 0..300_000);
            let OneWay { span_us, .. } = OneWay::of(&readings, 0, &whole_us);
            assert_eq!(span_us, 1000 * span_ms.start..1000 * span_ms.end, "{rpm:?}");
            let summary = summarise(&readings, &whole_us, 0.0);
            let speed = summary.rotors[0].speed.expect("it was locked");
            let told_rpm = speed.omega_rad_s * Speed::RPM_PER_RAD_S;
            assert!((told_rpm - expected_rpm).abs() < 0.1, "{rpm:?}: {told_rpm}");
            assert_eq!(speed.alpha_rad_s2, None, "{rpm:?}");
        }
    }

    #[test]
    fn a_recording_put_behind_another_has_a_summary_of_its_own() {
        // One that is seen long, and another, seen in one reading, of which nothing is filled in from the first.
        let mut readings = readings(&[1500.0; 13]);
        readings[12].t_us += 200_000;
        readings[12].rotors[0].id = 1;
        let streams_us = [0..725_000, 725_000..950_000];
        let summary = summarise_all(&readings, &streams_us, 0.0);
        assert_eq!(summary.status, Status::Locked);
        let ids: Vec<u8> = summary.rotors.iter().map(|rotor| rotor.id).collect();
        assert_eq!(ids, [0, 1]);
        for (rotor, (rows, span_us)) in
            summary.rotors.iter().zip([(0..12, &streams_us[0]), (12..13, &streams_us[1])])
        {
            assert_eq!(*rotor, summarise(&readings[rows], span_us, 0.0).rotors[0]);
        }
    }
}

//! The mean speed of a rotor over a recording, from readings whose windows overlap and leave gaps.

use std::ops::Range;

use evtach_core::{Frame, Speed};

use super::line::Line;
use super::piece::{Piece, seconds, weighted_mean};

/// Windows that touch overlap by no more than what their middles are rounded by, in microseconds.
const TOUCH_US: u64 = 2;

/// Mean speed over what the readings cover of `span_us`; `None` without any. They are in their order.
///
/// A reading is the turn between its window's ends, so windows laid end to end are exact however the speed varies.
/// What they leave open for no longer than the windows beside it is filled in from the line through all and the reading next to it,
/// each as far as it is known. That is as uncertain as readings scatter about that line, and as the speed swings within a window; and
/// it tells nothing new, so that what the windows are off by counts for it as well. Of a longer time nothing is known, not even that the
/// rotor turned: it is not in the mean.
pub fn mean_speed(pieces: &[Piece], span_us: &Range<u64>, clock_sigma_ppm: f32) -> Option<Speed> {
    pieces.first()?;
    let line = Line::through(pieces, span_us.start);
    let off = |piece: &Piece| piece.omega_rad_s() - line.at(piece.middle_us());
    let scatter = weighted_mean(pieces, |p| off(p).powi(2));
    let slope_rad_s2 = line.slope_rad_s2.unwrap_or(0.0);
    let swing = weighted_mean(pieces, |p| p.swing_variance(slope_rad_s2));

    // The clock is in all readings alike: it neither averages out nor shows in how they scatter.
    let clock = (f64::from(clock_sigma_ppm) * 1e-6 * line.mean_rad_s).powi(2);
    let own_variance = |piece: &Piece| (piece.variance() - clock).max(0.0);
    let (mut whole_s, mut turn_rad, mut turn_variance, mut by_gyro) = (0.0, 0.0, 0.0, 0.0);
    let mut add = |length_s: f64, counts_s: f64, omega_rad_s: f64, variance: f64, frame: Frame| {
        whole_s += length_s;
        turn_rad += length_s * omega_rad_s;
        match frame {
            Frame::Camera => turn_variance += counts_s * counts_s * variance,
            // What is left of a gyro's offset is in all of them alike.
            Frame::Room => by_gyro += counts_s * variance.sqrt(),
        }
    };
    let tiles = tiles(pieces);
    let gaps = gaps(&tiles, span_us);
    let open_s: f64 = gaps.iter().map(|gap| seconds(gap.start, gap.end)).sum();
    let weight: f64 = tiles.iter().map(|tile| tile.weight()).sum();
    for open_us in gaps {
        let middle_us = open_us.start.midpoint(open_us.end);
        if let Some(near) = pieces.iter().min_by_key(|p| p.middle_us().abs_diff(middle_us)) {
            let length_s = seconds(open_us.start, open_us.end);
            let away_s = seconds(near.middle_us(), middle_us);
            let moved = line.slope_rad_s2.map_or(0.0, |_| away_s * away_s * line.slope_variance);
            // How much of what the next reading is off by the line is the speed's, and not its own error.
            let own = scatter / (scatter + near.variance()).max(f64::from(f32::MIN_POSITIVE));
            // What lasts for longer than a window averages out.
            let windows = (open_us.end - open_us.start) as f64 / near.length_us().max(1) as f64;
            let varies = scatter + swing / windows.max(1.0);
            let variance = varies + own * own_variance(near) + moved;
            let omega_rad_s = line.at(middle_us) + own * off(near);
            add(length_s, length_s, omega_rad_s, variance, near.speed.frame);
        }
    }
    for tile in tiles {
        let length_s = tile.length_us() as f64 * 1e-6;
        let counts_s = length_s + open_s * tile.weight() / weight;
        add(length_s, counts_s, tile.omega_rad_s(), own_variance(tile), tile.speed.frame);
    }
    let turn_variance = turn_variance + by_gyro * by_gyro;
    let sigma_rad_s = (turn_variance / (whole_s * whole_s) + clock).sqrt();
    let in_room = pieces.iter().all(|piece| piece.speed.frame == Frame::Room);
    Some(Speed {
        omega_rad_s: (turn_rad / whole_s) as f32,
        omega_sigma_rad_s: sigma_rad_s as f32,
        alpha_rad_s2: line.slope_rad_s2.map(|slope| slope as f32),
        frame: if in_room { Frame::Room } else { Frame::Camera },
    })
}

/// What windows laid end to end leave open of a span, and is no longer than the windows beside it.
fn gaps(tiles: &[&Piece], span_us: &Range<u64>) -> Vec<Range<u64>> {
    let (Some(first), Some(last)) = (tiles.first(), tiles.last()) else { return Vec::new() };
    let ends = [
        (span_us.start..first.window_us.start, first.length_us()),
        (last.window_us.end..span_us.end, last.length_us()),
    ];
    let between = tiles.windows(2).map(|pair| {
        let open_us = pair[0].window_us.end..pair[1].window_us.start;
        (open_us, pair[0].length_us() + pair[1].length_us())
    });
    let all = between.chain(ends);
    all.filter(|(open_us, most_us)| !open_us.is_empty() && open_us.end - open_us.start <= *most_us)
        .map(|(open_us, _)| open_us)
        .collect()
}

/// What windows laid end to end cover, and the variance of the turn in them.
#[derive(Clone, Copy, Default)]
struct Cover {
    length_us: u64,
    turn_variance: f64,
}

impl Cover {
    fn with(self, piece: &Piece) -> Self {
        let length_s = piece.length_us() as f64 * 1e-6;
        Self {
            length_us: self.length_us + piece.length_us(),
            turn_variance: self.turn_variance + length_s * length_s * piece.variance(),
        }
    }

    /// More is better, and of as much that which is known best.
    fn betters(self, other: Self) -> bool {
        if self.length_us.abs_diff(other.length_us) <= TOUCH_US {
            self.turn_variance < other.turn_variance
        } else {
            self.length_us > other.length_us
        }
    }
}

/// Windows that do not overlap and together cover the most, in the order of time.
fn tiles(pieces: &[Piece]) -> Vec<&Piece> {
    // Windows end one after the other. `best[i]` is the best cover by those before the i-th, and `from[i]` is how
    // many come before it where it is one of them.
    let mut best = vec![Cover::default()];
    let mut from = Vec::new();
    for (i, piece) in pieces.iter().enumerate() {
        let start_us = piece.window_us.start + TOUCH_US;
        let before = pieces[..i].partition_point(|earlier| earlier.window_us.end <= start_us);
        let with = best[before].with(piece);
        let better = with.betters(best[i]);
        from.push(better.then_some(before));
        best.push(if better { with } else { best[i] });
    }
    let mut tiles = Vec::new();
    let mut left = pieces.len();
    while let Some(last) = left.checked_sub(1) {
        left = match from[last] {
            Some(before) => {
                tiles.push(&pieces[last]);
                before
            }
            None => last,
        };
    }
    tiles.reverse();
    tiles
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use evtach_core::Frame;

    use super::*;

    /// The mean of readings every 50 ms over 150 ms of a turn that is known at every instant, and its error.
    fn mean(turn_rad: impl Fn(f64) -> f64, until_ms: u64) -> (f64, f64) {
        swinging_mean(turn_rad, until_ms, 0.0)
    }

    /// The same where readings tell how the speed swings within their windows.
    fn swinging_mean(turn_rad: impl Fn(f64) -> f64, until_ms: u64, swing_rad_s: f64) -> (f64, f64) {
        let speed = swinging_speed(turn_rad, until_ms, swing_rad_s);
        (f64::from(speed.omega_rad_s), f64::from(speed.omega_sigma_rad_s))
    }

    fn swinging_speed(turn_rad: impl Fn(f64) -> f64, until_ms: u64, swing_rad_s: f64) -> Speed {
        let pieces: Vec<Piece> = (0..)
            .map(|i| 50 * i..50 * i + 150)
            .take_while(|window_ms| window_ms.end <= until_ms)
            .map(|window_ms| {
                let turned_rad =
                    turn_rad(window_ms.end as f64 * 1e-3) - turn_rad(window_ms.start as f64 * 1e-3);
                let speed = Speed {
                    omega_rad_s: (turned_rad / 0.15) as f32,
                    omega_sigma_rad_s: 0.01,
                    alpha_rad_s2: None,
                    frame: Frame::Camera,
                };
                Piece {
                    window_us: window_ms.start * 1000..window_ms.end * 1000,
                    speed,
                    swing_rad_s,
                }
            })
            .collect();
        mean_speed(&pieces, &(0..until_ms * 1000), 0.0).expect("readings")
    }

    #[test]
    fn windows_end_to_end_are_exact_for_a_motor_that_hunts() {
        let turn_rad = |t: f64| 230.0 * t + 0.12 * (20.0 * t).sin();
        let (mean_rad_s, sigma_rad_s) = mean(turn_rad, 600);
        assert!((mean_rad_s - turn_rad(0.6) / 0.6).abs() < 1e-3, "{mean_rad_s}");
        assert!((sigma_rad_s - 0.005).abs() < 1e-4, "{sigma_rad_s}");
    }

    #[test]
    fn what_a_motor_hunts_by_is_no_acceleration() {
        // By 3 rad/s, in whole waves of every phase, and while it speeds up or not.
        for (waves, until_ms) in [(1.0, 3000), (3.0, 3000), (1.0, 30_000), (30.0, 30_000)] {
            for phase in 0..8 {
                for alpha_rad_s2 in [0.0, 20.0] {
                    let w = TAU * waves / (1e-3 * until_ms as f64);
                    let phase = f64::from(phase) * TAU / 8.0;
                    let turn_rad = |t: f64| {
                        300.0 * t + 0.5 * alpha_rad_s2 * t * t - 3.0 / w * (w * t + phase).cos()
                    };
                    let told = swinging_speed(turn_rad, until_ms, 0.0).alpha_rad_s2;
                    let right = told.map_or(alpha_rad_s2 == 0.0, |told| {
                        // A line leans by some of a wave.
                        let leans = 7.0 / (1e-3 * until_ms as f64) / waves;
                        alpha_rad_s2 != 0.0 && (f64::from(told) - alpha_rad_s2).abs() < leans
                    });
                    assert!(right, "{waves} in {until_ms} ms: {told:?} for {alpha_rad_s2}");
                }
            }
        }
    }

    #[test]
    fn a_ramp_is_not_cut_short_by_what_no_window_covers() {
        let turn_rad = |t: f64| 230.0 * t + 5.0 * t * t;
        let (mean_rad_s, _) = mean(turn_rad, 640);
        assert!((mean_rad_s - turn_rad(0.64) / 0.64).abs() < 1e-3, "{mean_rad_s}");
        // Nor is it a swing, which a bend of 10 rad/s^2 in windows of 150 ms would be taken for.
        let (_, sigma_rad_s) = mean(turn_rad, 640);
        let (_, bent_rad_s) = swinging_mean(turn_rad, 640, PI / 45_f64.sqrt() * 10.0 * 0.075);
        let (_, swung_rad_s) = swinging_mean(turn_rad, 640, 1.0);
        assert!((bent_rad_s / sigma_rad_s - 1.0).abs() < 0.01, "{bent_rad_s} {sigma_rad_s}");
        assert!(swung_rad_s > 2.0 * sigma_rad_s, "{swung_rad_s} {sigma_rad_s}");
    }

    #[test]
    fn what_is_left_of_a_gyros_offset_does_not_average_out() {
        let told = |frames: [Frame; 3]| {
            let pieces: Vec<Piece> = (0..)
                .zip(frames)
                .map(|(i, frame)| {
                    let speed = Speed {
                        omega_rad_s: 200.0,
                        omega_sigma_rad_s: 0.03,
                        alpha_rad_s2: None,
                        frame,
                    };
                    Piece { window_us: i * 150_000..(i + 1) * 150_000, speed, swing_rad_s: 0.0 }
                })
                .collect();
            let mean = mean_speed(&pieces, &(0..450_000), 0.0).expect("readings");
            ((1e3 * mean.omega_sigma_rad_s).round(), mean.frame)
        };
        let (camera, room) = (Frame::Camera, Frame::Room);
        assert_eq!(told([camera; 3]), (17.0, camera));
        assert_eq!(told([room; 3]), (30.0, room));
        // Until the offset was known they were told to the camera.
        assert_eq!(told([camera, camera, room]), (17.0, camera));
        assert_eq!(told([camera, room, room]), (22.0, camera));
    }

    #[test]
    fn time_without_a_reading_makes_nothing_surer() {
        let piece = |start_us: u64| {
            let speed = Speed {
                omega_rad_s: 200.0,
                omega_sigma_rad_s: 0.03,
                alpha_rad_s2: None,
                frame: Frame::Camera,
            };
            Piece { window_us: start_us..start_us + 150_000, speed, swing_rad_s: 0.0 }
        };
        for (pieces, sigma_rad_s) in
            [(vec![piece(0)], 0.03), (vec![piece(0), piece(150_000)], 0.03 / 2.0_f32.sqrt())]
        {
            for until_us in [300_000, 1_000_000, 1_000_000_000] {
                let mean = mean_speed(&pieces, &(0..until_us), 0.0).expect("readings");
                assert!((mean.omega_sigma_rad_s / sigma_rad_s - 1.0).abs() < 0.01, "{mean:?}");
            }
        }
    }

    #[test]
    fn what_is_open_for_long_is_not_in_the_mean() {
        // Sped up for 0.6 s, once more at 2 s for as long, and then for good: seen and not to be seen in between.
        let piece = |start_us: u64| {
            let speed = Speed {
                omega_rad_s: 100.0 + 30e-6 * (start_us + 75_000) as f32,
                omega_sigma_rad_s: 0.002,
                alpha_rad_s2: Some(30.0),
                frame: Frame::Camera,
            };
            Piece { window_us: start_us..start_us + 150_000, speed, swing_rad_s: 0.0 }
        };
        let pieces: Vec<Piece> =
            [0, 150_000, 300_000, 450_000, 2_000_000, 2_150_000].map(piece).into();
        let mean = |pieces: &[Piece], until_us| {
            let mean = mean_speed(pieces, &(0..until_us), 0.0).expect("readings");
            (mean.omega_rad_s, mean.omega_sigma_rad_s)
        };
        // Up to 0.6 s, or to an end that is near.
        for (until_us, expected_rad_s) in [(20_000_000, 109.0), (700_000, 110.5)] {
            let (mean_rad_s, sigma_rad_s) = mean(&pieces[..4], until_us);
            assert!((mean_rad_s - expected_rad_s).abs() < 0.01, "{mean_rad_s} {sigma_rad_s}");
            assert!(sigma_rad_s < 0.02, "{sigma_rad_s}");
        }
        // And from 2 to 2.3 s.
        let (mean_rad_s, _) = mean(&pieces, 20_000_000);
        let expected_rad_s = (0.6 * 109.0 + 0.3 * (100.0 + 30.0 * 2.15)) / 0.9;
        assert!((mean_rad_s - expected_rad_s).abs() < 0.01, "{mean_rad_s} {expected_rad_s}");
    }

    #[test]
    fn a_single_reading_goes_on_as_it_told() {
        let speed = Speed {
            omega_rad_s: 200.0,
            omega_sigma_rad_s: 0.01,
            alpha_rad_s2: Some(10.0),
            frame: Frame::Camera,
        };
        let pieces = [Piece { window_us: 0..300_000, speed, swing_rad_s: 0.0 }];
        let mean = mean_speed(&pieces, &(0..600_000), 0.0).expect("a reading");
        // 200 rad/s at 0.15 s, and so 201.5 in the middle.
        assert!((mean.omega_rad_s - 201.5).abs() < 1e-3, "{}", mean.omega_rad_s);
        assert_eq!(mean.alpha_rad_s2, Some(10.0));
    }

    #[test]
    fn what_is_filled_in_is_as_uncertain_as_the_speed_varies() {
        let turn_rad = |t: f64| 230.0 * t + 0.5 * (20.0 * t).sin();
        let (mean_rad_s, sigma_rad_s) = mean(turn_rad, 440);
        assert!((mean_rad_s - turn_rad(0.44) / 0.44).abs() < 3.0 * sigma_rad_s);
        assert!(sigma_rad_s > 0.1, "{sigma_rad_s}");
    }

    #[test]
    fn a_swing_that_no_mean_shows_is_in_the_error_of_what_is_filled_in() {
        // Once a window: all readings are alike.
        let w = TAU / 0.15;
        let turn_rad = |t: f64| 230.0 * t + 2.0 / w * (w * t).sin();
        let (mean_rad_s, blind_rad_s) = mean(turn_rad, 640);
        let off_rad_s = (mean_rad_s - turn_rad(0.64) / 0.64).abs();
        let (_, sigma_rad_s) = swinging_mean(turn_rad, 640, 2.0_f64.sqrt());
        assert!(off_rad_s > 4.0 * blind_rad_s, "{off_rad_s} {blind_rad_s}");
        assert!(off_rad_s < 2.0 * sigma_rad_s, "{off_rad_s} {sigma_rad_s}");
    }

    #[test]
    fn a_window_that_knows_little_bends_nothing() {
        let piece = |start_us: u64, omega_rad_s, omega_sigma_rad_s| {
            let speed =
                Speed { omega_rad_s, omega_sigma_rad_s, alpha_rad_s2: None, frame: Frame::Camera };
            Piece { window_us: start_us..start_us + 150_000, speed, swing_rad_s: 0.0 }
        };
        let pieces =
            [piece(0, 203.0, 1.0), piece(50_000, 200.0, 0.01), piece(100_000, 200.01, 0.01)];
        let mean = mean_speed(&pieces, &(0..400_000), 0.0).expect("readings");
        assert!((mean.omega_rad_s - 200.005).abs() < 0.02, "{}", mean.omega_rad_s);
        assert_eq!(mean.alpha_rad_s2, None);
    }
}

//! Times that are folded: a sensor that looks at a row, a column or all of its pixels only every so often stamps what it finds with the
//! time of the look. Then a pattern that passes n times between two looks looks like one that passes n - 1 times, or that goes
//! backwards: what is faster than half the rate of the looks is told by nothing (Nyquist's limit), and all witnesses agree on it.
//!
//! The looks of a row have a shortest distance; times of their own come as close to each other as chance brings them. A link or a lamp
//! that lets through bursts folds as well, and even less is known of what passes in between.

use crate::math::round;
use crate::rotors::Disc;
use crate::store::Window;

/// Rows through the middle of a rotor that are looked at, and as many columns.
const LINES: usize = 16;
/// Times of a row closer than this are of one look, which takes its time, too. No pattern is told that passes as fast.
const LOOK_US: u32 = 100;
/// Fewest looks of a row or column that is judged.
const LEAST_LOOKS: u32 = 12;
/// The closest two of n times at random are the span over n^2 apart; so many times that are no chance: seven in a thousand.
const BEYOND_CHANCE: f32 = 5.0;
/// Of more lines that are looked at sooner, the rest are not nearly all.
const MOST_SOONER: u32 = LINES as u32 / 4;

/// Times that hold an event or none, of which bursts fill less than half.
const SLOT_US: u32 = 256;
/// Fewest bursts that are told to be regular.
const LEAST_BURSTS: u32 = 8;
/// Sensors come round sooner.
const SCAN_US: f32 = 1000.0;
/// What a look finds is stamped with one time; what is let through takes longer than this.
const STAMPED_US: f32 = 20.0;
/// What a rotor's own bursts and its passes may be apart by, over all of them, in halves of a pass.
const OWN_HALVES: f32 = 0.2;

/// The looks at one row or column.
#[derive(Clone, Copy)]
struct Line {
    looks: u32,
    last_us: u32,
    closest_us: u32,
}

impl Line {
    /// Whether it can be judged, and is looked at again after so long a time or sooner.
    fn is_sooner(&self, most_us: f32) -> bool {
        self.looks >= LEAST_LOOKS && self.closest_us as f32 <= most_us
    }
}

/// Whether the sensor looks at each row or column of a rotor, or at all of its pixels at once, only every so often, and that longer apart
/// than `most_us`. Cost: some 30 instructions an event, until most is known to be looked at sooner.
#[must_use]
pub fn looks_seldom(window: &Window<'_>, disc: Disc, most_us: f32) -> bool {
    let never = Line { looks: 0, last_us: 0, closest_us: u32::MAX };
    let (mut columns, mut rows, mut all) = ([never; LINES], [never; LINES], [never]);
    let half = LINES as u16 / 2;
    let x = (disc.x_px as u16).wrapping_sub(half);
    let y = (disc.y_px as u16).wrapping_sub(half);
    let (mut sooner_columns, mut sooner_rows, mut sooner) = (0, 0, 0);
    for segment in 0..window.segments() {
        for event in window.segment(segment) {
            let t_us = event.since(window.start_us).unsigned_abs();
            let (column, row) = (event.x().wrapping_sub(x), event.y().wrapping_sub(y));
            sooner_columns += look(&mut columns, column, t_us, most_us);
            sooner_rows += look(&mut rows, row, t_us, most_us);
            sooner += look(&mut all, 0, t_us, most_us);
            if sooner > 0 && sooner_columns > MOST_SOONER && sooner_rows > MOST_SOONER {
                return false;
            }
        }
    }
    [&columns[..], &rows, &all].iter().any(|lines| is_regular(lines, window, most_us))
}

/// Whether events come in bursts, as regular as a clock's, that the rotor does not make: its own come every half pass, which takes
/// `most_us`, or every so many. A sensor that scans comes round within `SCAN_US`, and nothing that it sees may pass faster than half as
/// often; before what is let through by something else, blades may pass any number of times in between. Cost: some ten instructions an
/// event, until enough of the time is known to be filled.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn comes_in_bursts(window: &Window<'_>, most_us: f32) -> bool {
    let (mut filled_us, mut end_us, mut last_us, mut longest_us) = (0_u32, 0_u32, 0_u32, 0_u32);
    let (mut bursts, mut steady, mut closed_us) = (0_u32, 0_u32, 0_u32);
    let (mut first_us, mut burst_us, mut period_us) = (0_u32, 0_u32, 0_u32);
    for segment in 0..window.segments() {
        for event in window.segment(segment) {
            let t_us = event.since(window.start_us).unsigned_abs();
            if t_us >= end_us {
                filled_us += SLOT_US;
                // Half of the time, with what may be ahead of that before the end.
                if filled_us > window.duration_us / 8 + 3 * (t_us / 8) {
                    return false;
                }
                end_us = (t_us | (SLOT_US - 1)) + 1;
            }
            let gap_us = t_us.saturating_sub(last_us);
            last_us = t_us;
            if gap_us < longest_us / 2 {
                continue;
            }
            // What came so far are no bursts, but events of one.
            if gap_us / 2 > longest_us {
                (bursts, steady, closed_us) = (0, 0, 0);
            }
            longest_us = longest_us.max(gap_us);
            if bursts == 0 {
                first_us = t_us;
            } else {
                closed_us = closed_us.saturating_add(gap_us);
                let after_us = t_us.wrapping_sub(burst_us);
                steady += u32::from(period_us.abs_diff(after_us) < period_us / 4);
                period_us = after_us;
            }
            burst_us = t_us;
            bursts += 1;
        }
    }
    if bursts < LEAST_BURSTS || 8 * steady < 7 * (bursts - 2) {
        return false;
    }
    let all_us = burst_us.wrapping_sub(first_us) as f32;
    let periods = (bursts - 1) as f32;
    let period_us = all_us / periods;
    let halves = period_us / most_us;
    let is_own = halves > 0.5 && (halves - round(halves)).abs() * periods < OWN_HALVES;
    let is_stamped = all_us - (closed_us as f32) < STAMPED_US * periods;
    !is_own && !is_stamped && (period_us > SCAN_US || period_us > most_us)
}

/// Takes in an event of a line, if it is of one of these; 1 where that shows the line to be looked at sooner, else 0.
// Not inlined: flash is short.
#[inline(never)]
fn look(lines: &mut [Line], line: u16, t_us: u32, most_us: f32) -> u32 {
    let Some(line) = lines.get_mut(usize::from(line)) else { return 0 };
    let since_us = t_us.wrapping_sub(line.last_us);
    if line.looks > 0 && since_us < LOOK_US {
        return 0;
    }
    let was_sooner = line.is_sooner(most_us);
    if line.looks > 0 {
        line.closest_us = line.closest_us.min(since_us);
    }
    line.looks += 1;
    line.last_us = t_us;
    u32::from(!was_sooner && line.is_sooner(most_us))
}

/// Whether nearly all lines, of which half can be judged, have a shortest distance between looks that is no chance, and longer.
// Not inlined: flash is short.
#[inline(never)]
fn is_regular(lines: &[Line], window: &Window<'_>, most_us: f32) -> bool {
    let (mut judged, mut regular, mut sooner) = (0, 0, false);
    for line in lines.iter().filter(|line| line.looks >= LEAST_LOOKS) {
        judged += 1;
        let (looks, closest_us) = (line.looks as f32, line.closest_us as f32);
        if closest_us * looks * looks > BEYOND_CHANCE * window.duration_us as f32 {
            regular += 1;
            sooner |= line.is_sooner(most_us);
        }
    }
    2 * judged >= lines.len() && 4 * regular >= 3 * judged && !sooner
}

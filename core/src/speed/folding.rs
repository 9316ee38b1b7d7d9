//! Times that are folded: a sensor that looks at a row, a column or all of its pixels only every so often stamps what it finds with the
//! time of the look. Then a pattern that passes n times between two looks looks like one that passes n - 1 times, or that goes
//! backwards: what is faster than half the rate of the looks is told by nothing (Nyquist's limit), and all witnesses agree on it.
//!
//! The looks of a row have a shortest distance; times of their own come as close to each other as chance brings them. A link that lets
//! through bursts folds as well; these fill less of the time than events would by chance.

use crate::math::floor;
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

/// Share of the times that as many events would be in by chance below which they come in bursts. Those of a single mark that shows in a
/// quarter of its way around are in half of them.
const LEAST_FILLED: f32 = 0.4;

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

/// Whether events come in bursts that are farther apart than `most_us`. Cost: some five instructions an event, until most of the times are
/// known to be filled.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn comes_in_bursts(window: &Window<'_>, most_us: f32) -> bool {
    let times = window.duration_us as f32 / most_us;
    let (mut events, mut filled, mut end_us) = (0.0, 0.0, 0);
    for segment in 0..window.segments() {
        let stored = window.segment(segment);
        for event in stored {
            let t_us = event.since(window.start_us).unsigned_abs();
            if t_us >= end_us {
                filled += 1.0;
                if filled >= LEAST_FILLED * times {
                    return false;
                }
                // Rounded up: what comes then is of the next time, and no event counts twice.
                end_us = ((floor(t_us as f32 / most_us) + 1.0) * most_us) as u32 + 1;
            }
        }
        events += stored.len() as f32;
    }
    // Of so many times so many events fill 1 - exp(-events / times), which is no less than this.
    filled * (events + times) < LEAST_FILLED * times * events
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

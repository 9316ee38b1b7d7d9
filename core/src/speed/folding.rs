//! Times that are folded: a sensor that looks at a row, a column or all of its pixels only every so often stamps what it finds with the
//! time of the look. Then a pattern that passes n times between two looks looks like one that passes n - 1 times, or that goes
//! backwards: what is faster than half the rate of the looks is told by nothing (Nyquist's limit), and all witnesses agree on it.
//!
//! The looks of a row have a shortest distance; times of their own come as close to each other as chance brings them.

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

/// The looks at one row or column.
#[derive(Clone, Copy)]
struct Line {
    looks: u32,
    last_us: u32,
    closest_us: u32,
}

/// Time between two looks of the sensor at a row or column of a rotor, or at all of its pixels, in microseconds, whichever is longest; 0 where it looks whenever
/// there is something to see. Cost: one pass over the window, some 30 instructions an event.
#[must_use]
pub fn look_us(window: &Window<'_>, disc: Disc) -> u32 {
    let never = Line { looks: 0, last_us: 0, closest_us: u32::MAX };
    let (mut columns, mut rows, mut all) = ([never; LINES], [never; LINES], [never]);
    let half = LINES as u16 / 2;
    let x = (disc.x_px as u16).wrapping_sub(half);
    let y = (disc.y_px as u16).wrapping_sub(half);
    for event in window.events() {
        let t_us = event.since(window.start_us).unsigned_abs();
        let (column, row) = (event.x().wrapping_sub(x), event.y().wrapping_sub(y));
        if usize::from(column) < LINES {
            look(&mut columns, column, t_us);
        }
        if usize::from(row) < LINES {
            look(&mut rows, row, t_us);
        }
        look(&mut all, 0, t_us);
    }
    regular_us(&columns, window).max(regular_us(&rows, window)).max(regular_us(&all, window))
}

/// Takes in an event of a line, if it is of one of these.
// Not inlined: flash is short.
#[inline(never)]
fn look(lines: &mut [Line], line: u16, t_us: u32) {
    let Some(line) = lines.get_mut(usize::from(line)) else { return };
    let since_us = t_us.wrapping_sub(line.last_us);
    if line.looks > 0 {
        if since_us < LOOK_US {
            return;
        }
        line.closest_us = line.closest_us.min(since_us);
    }
    line.looks += 1;
    line.last_us = t_us;
}

/// The shortest distance of the looks at nearly all lines, of which half can be judged, where that is no chance.
// Not inlined: flash is short.
#[inline(never)]
fn regular_us(lines: &[Line], window: &Window<'_>) -> u32 {
    let (mut judged, mut regular, mut closest_us) = (0, 0, u32::MAX);
    for line in lines {
        let looks = line.looks as f32;
        judged += u32::from(line.looks >= LEAST_LOOKS);
        if line.looks >= LEAST_LOOKS
            && line.closest_us as f32 * looks * looks > BEYOND_CHANCE * window.duration_us as f32
        {
            regular += 1;
            closest_us = closest_us.min(line.closest_us);
        }
    }
    if 2 * judged >= lines.len() as u32 && 4 * regular >= 3 * judged { closest_us } else { 0 }
}

//! A readout that cannot keep up: its queue hands events out at a constant pace, and stamps them late by its length.
//!
//! Where many pixels fire, events come at random: the time that a number of them takes scatters as in a Poisson
//! process. From a queue that never runs empty they come like a clock. While such a queue fills, time is
//! stretched, and all speeds are read too low by the same share; nothing else in the events' times tells.
//!
//! But while it fills, no event is lost. Where a rotor's pixels see few of the blades that pass, most are: the queue is full,
//! and filled within the first moments of the window, or before. From then on all events are late alike. And where the stream begins
//! with the window, a rotor's phase shows how far it filled, and by when.

use super::filling::Filled;
use crate::math::larger;
use crate::rotors::Disc;
use crate::store::{StoredEvent, Window};

/// Events whose time is taken together: few against those of one edge that crosses a pixel, many against the microsecond.
const GROUP: usize = 32;
/// Most events of a place, 32 groups: with half as many, one place in fifty of a stream of ten million a second looked busy by chance.
const EVENTS: usize = 32 * GROUP + 1;
/// Fewest groups that are judged.
const LEAST_GROUPS: u32 = 8;
/// Variance of the difference of two times rounded to the microsecond.
const ROUNDING_US2: f32 = 1.0 / 6.0;
/// Scatter below which events come from a queue, as a share of that of a Poisson process: scenes that are not held up stay
/// above a third.
const MOST_SCATTER: f32 = 0.2;
/// The same where one place alone is judged.
const LEAST_SCATTER: f32 = 0.05;
/// Events that a readout may hold.
const QUEUE_EVENTS: f32 = 4_096.0;

/// Share of a rotor's events that come, from which on it is not sure that any are lost.
const MOST_CAME: f32 = 0.6;
/// Events of either polarity that a blade leaves in a pixel as it passes, at least: one, and a mark on a disc, which passes half of
/// it, half as many.
const LEAST_LEFT: f32 = 0.5;
/// A line through times of which the first are early, by the share y of all at the start and evenly less up to the share x, is tilted
/// by 3 x y at most.
const TILT: f32 = 3.0;
/// The same where the queue is full from any time on, or up to any, or between any two: by 1.5 y.
const STEP: f32 = 1.5;
/// What is seen to be off is off by all of it, where half of what may be counts.
const FOUND: f32 = 2.0;
/// Share of a whole queue by which the first events may be early for another reason than that it filled.
const MOST_UNSEEN: f32 = 0.25;

/// What a readout that was busy does to a window.
#[derive(Clone, Copy, Debug, Default)]
pub struct Held {
    /// Share of its time by which all its events may be late.
    pub late: f32,
    /// Share by which its time may be stretched as a rotor's speed is read.
    pub stretch: f32,
    /// Whether the queue is seen to fill as the window begins, so that the rotor is out of step there.
    pub filled: bool,
}

/// Whether a readout has to do more than it can.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Busy {
    /// At no time.
    Never,
    /// In a part of the window.
    ForAWhile,
    /// In all of it.
    AllThrough,
}

/// How busy the readout was in a window. Cost: 25 000 instructions.
#[must_use]
// Not inlined: flash is short.
#[inline(never)]
pub fn busy(window: &Window<'_>) -> Busy {
    let (mut scatter, mut degrees) = (0.0, 0_u32);
    let (mut busy, mut idle) = (false, false);
    // Where segments start, and where the last ends.
    let last = window.segments().saturating_sub(1);
    for place in 0..=window.segments() {
        let (found, groups) = paces(window, window.segment(place.min(last)), place > last);
        let judged = groups >= LEAST_GROUPS;
        busy |= judged && found < LEAST_SCATTER * groups as f32;
        // A stream begins with an empty queue, so its first moments are not busy yet.
        if place > 0 || window.segments() == 1 {
            idle |= judged && found > MOST_SCATTER * groups as f32;
            scatter += found;
            degrees += groups;
        }
    }
    if busy && idle {
        Busy::ForAWhile
    } else if degrees >= LEAST_GROUPS && scatter < MOST_SCATTER * degrees as f32 {
        Busy::AllThrough
    } else {
        Busy::Never
    }
}

/// What the readout does to a rotor's speed: nothing unless it was busy. At least so many blades of the rotor pass meanwhile.
/// Cost: 25 000 instructions, and one pass over the window where it was.
#[must_use]
pub fn held(window: &Window<'_>, disc: Disc, passes: f32, seen: Filled) -> Held {
    let busy = busy(window);
    if busy == Busy::Never {
        return Held::default();
    }
    let (mut arrived, mut of_rotor) = (0.0, [0.0_f32; 2]);
    for segment in 0..window.segments() {
        for event in window.segment(segment) {
            let stands_for = f32::from(1_u16 << event.weight_log2());
            let at = Disc { x_px: event.x().into(), y_px: event.y().into(), radius_px: 0.0 };
            arrived += stands_for;
            if disc.distance2(&at) < disc.radius_px * disc.radius_px {
                of_rotor[usize::from(window.is_on(*event))] += stands_for;
            }
        }
    }
    let whole = QUEUE_EVENTS / larger(arrived, QUEUE_EVENTS);
    if busy == Busy::ForAWhile {
        return Held { late: whole, stretch: STEP * whole, filled: false };
    }
    let [off, on] = of_rotor;
    let passed = core::f32::consts::PI * disc.radius_px * disc.radius_px * passes;
    // Of so many that the pixels sent, these came: what is lost beside one that comes fills the queue, or would.
    let came = larger(off, on) / larger(LEAST_LEFT * passed, larger(off, on));
    let took = whole * came / larger(1.0 - came, f32::MIN_POSITIVE);
    // What is not seen to have filled may fill unseen, evenly through all of the window; but no more than what is lost leaves room for.
    let left = (whole - seen.early).abs();
    let filled = left < MOST_UNSEEN * whole;
    let (unseen, found) = if filled { (left, FOUND * seen.tilt.abs()) } else { (whole, 0.0) };
    let unseen = if came < MOST_CAME { unseen.min(TILT * took * whole) } else { unseen };
    Held { late: whole, stretch: found + unseen, filled }
}

/// Variance of the time that a group of events takes over that of a Poisson process, times the degrees of freedom, and these: of the
/// first events or the last, as they came. Thinned ones stand for so many that edges pass the pixels evenly meanwhile.
fn paces(window: &Window<'_>, events: &[StoredEvent], last: bool) -> (f32, u32) {
    let count = events.len().min(EVENTS);
    let events = if last { &events[events.len() - count..] } else { &events[..count] };
    let since = |event: &StoredEvent| event.since(window.start_us) as f32;
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0_u32);
    for group in events.windows(GROUP + 1).step_by(GROUP) {
        if group.iter().all(|event| event.weight_log2() == 0) {
            let time_us = since(&group[GROUP]) - since(&group[0]);
            sum += time_us;
            squares += time_us * time_us;
            count += 1;
        }
    }
    let mean = sum / (count as f32).max(1.0);
    if count < 2 || mean <= 0.0 {
        return (0.0, 0);
    }
    let degrees = count - 1;
    let variance_us2 = squares - mean * sum - ROUNDING_US2 * degrees as f32;
    (variance_us2.max(0.0) * GROUP as f32 / (mean * mean), degrees)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{PackedEvent, Polarity};
    use crate::store::{MOST_SEGMENTS, MOST_SPARE, Store};

    /// Share of the events of a window, one in a microsecond, that the queue holds.
    const WHOLE: f32 = 4_096.0 / 150_000.0;

    /// The stretch of a window of events whose distances are told in nanoseconds.
    fn of(distance_ns: impl Fn(u64) -> u64) -> f32 {
        around(32_768, Disc::default(), 0.0, &[Polarity::On], distance_ns)
    }

    /// The same as a rotor's speed is read, of events of these polarities, in room for so many in a segment.
    fn around(
        capacity: usize,
        disc: Disc,
        passes: f32,
        polarities: &[Polarity],
        distance_ns: impl Fn(u64) -> u64,
    ) -> f32 {
        let mut memory = vec![StoredEvent::default(); MOST_SEGMENTS * capacity];
        let mut store = Store::new(&mut memory, MOST_SPARE, 25_000);
        let mut t_ns = 0;
        for index in 0_u64.. {
            t_ns += distance_ns(index);
            let t_us = t_ns / 1_000;
            if t_us >= 150_000 {
                break;
            }
            while t_us >= store.open_end_us() {
                store.close_segment();
            }
            // Not in turn: a store that thins might keep one of them only.
            let polarity = polarities[(random(index) * 1e6) as usize % polarities.len()];
            store.push(&[PackedEvent::new(t_us as u32, 1, 1, polarity)], 0, |_, _| {});
        }
        held(&store.window(6, u64::MAX), disc, passes, Filled::default()).stretch
    }

    /// Exponentially distributed with a mean of one, from a hash.
    fn random(index: u64) -> f32 {
        let mixed = (index + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let hash = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB) >> 40;
        -libm::logf((hash as f32 + 0.5) / (1 << 24) as f32)
    }

    /// Distance in ns of events that come in bursts, one in a microsecond in the mean.
    fn burst(index: u64) -> u64 {
        (random(index) * random(index + (1 << 32)) * 1_000.0) as u64
    }

    #[test]
    fn a_clocked_readout_is_told_from_random_events_at_any_pace() {
        for pace_ns in [200, 1_000, 20_000] {
            assert!(of(|_| pace_ns) > 0.0, "{pace_ns} ns");
            assert!(of(|index| (random(index) * pace_ns as f32) as u64) == 0.0, "{pace_ns} ns");
        }
    }

    #[test]
    fn random_events_of_a_fast_stream_are_no_busy_readout() {
        // 32 events take 3 us, and the rounding of their times is half as much as they scatter.
        for stream in 0..40_u64 {
            let found = of(|index| (random(index + (stream << 32)) * 94.0) as u64);
            assert!(found == 0.0, "{stream}: {found}");
        }
    }

    #[test]
    fn a_readout_that_is_busy_once_the_stream_has_begun_is_told() {
        let found = of(|index| if index < 25_000 { burst(index) } else { 1_000 });
        assert!((found / WHOLE - 1.0).abs() < 0.05, "{found}");
    }

    #[test]
    fn a_readout_that_is_busy_for_a_while_may_stretch_half_as_much_again() {
        for busy in [0..45_000, 60_000..100_000, 130_000..200_000] {
            let found = of(|index| if busy.contains(&index) { 1_000 } else { burst(index) });
            assert!((found / (1.5 * WHOLE) - 1.0).abs() < 0.05, "{busy:?}: {found}");
        }
    }

    #[test]
    fn an_edge_that_passes_pixels_evenly_is_no_busy_readout() {
        // Of a pattern that comes again every 512 events, 32 that stand for 16 each take the same time always.
        let evenly = |index| burst(index % 512);
        assert!(around(2_048, Disc::default(), 0.0, &[Polarity::On], evenly) == 0.0);
    }

    #[test]
    fn the_stretch_is_the_queue_over_the_events() {
        let found = of(|_| 1_000);
        assert!((found / WHOLE - 1.0).abs() < 0.05, "{found}");
    }

    #[test]
    fn where_pixels_miss_most_blades_the_queue_filled_at_once() {
        // All events within 314 pixels, which see 500 or 5 000 blades pass.
        let disc = Disc { x_px: 1.0, y_px: 1.0, radius_px: 10.0 };
        let (one, both) = ([Polarity::On], [Polarity::On, Polarity::Off]);
        let complete = around(32_768, disc, 500.0, &one, |_| 1_000);
        assert!((complete / WHOLE - 1.0).abs() < 0.05, "{complete}");
        for (polarities, of_polarity) in [(&one[..], 150_000.0), (&both, 75_000.0)] {
            let lost = around(2_048, disc, 5_000.0, polarities, |_| 1_000);
            // So many of 785 000 came, so the queue was full by the time that a quarter, or a tenth, of what it holds had come.
            let came = of_polarity / (0.5 * core::f32::consts::PI * 100.0 * 5_000.0);
            let filled = WHOLE * came / (1.0 - came);
            assert!((lost / (3.0 * filled * WHOLE) - 1.0).abs() < 0.1, "{lost}");
        }
    }
}

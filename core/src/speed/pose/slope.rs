//! What the pose says in the end: the speed and its change, and how the axis wanders.

use heapless::Vec;

use super::super::baseline::Estimate;
use super::super::path::mean_place;
use super::super::statistics::{root_sum_square, student_over_normal};
use super::super::trend::{Point, Trend};
use super::{LEAST_SHARE, MOVING_PX_S, Pose, Sums, WALK_SINGLE_PX};
use crate::limits::MAX_KNOTS;
use crate::math::{TAU, larger, sqrt};
use crate::store::Window;

/// Symmetry periods in the window from which on places in the period get offsets of their own.
const FOLDED_PERIODS: usize = 3;
/// Blocks over which the wandering of the axis is judged.
const DRIFT_BLOCKS: usize = 12;
/// No rotor's turn goes by this share of a cycle of its harmonic off where the two blocks before lead: the path has slipped to another edge
/// of the template. Blocks of the fewest events scatter by a tenth of a cycle.
const SLIP_CYCLES: f32 = 0.6;
/// The same where blocks between are out of step, where it slips bit by bit; and by so many standard errors.
const GAP_SLIP_CYCLES: f32 = 0.2;
const GAP_SLIP_SIGMAS: f32 = 4.0;
/// Blocks from the one at an end to the next in step beyond which it is alone.
const LONE_GAP: usize = 2;
/// Phase by which a block may be farther off the path than all are, and the same in standard errors: beyond, the path has not arrived
/// there, and the sine that tells how far is bent.
const ARRIVED_RAD: f32 = 0.5;
const ARRIVED_SIGMAS: f32 = 3.0;
/// Shortest time that pixels take to settle where a stream begins: simulated ones of a bandwidth of 50 Hz take as long.
const SETTLING_US: f32 = 10_000.0;
/// The window is so many times as long at least, or all of it is believed.
const LEAST_SETTLED: f32 = 4.0;
/// How far the speed in what is left out goes off where a parabola leads, over how much it swings within the rest: at its ends a
/// polynomial of degree three is five times as steep.
const END_SWING: f32 = 5.0;
/// What they tell meanwhile is not believed where the speed without it is as exact, but for this factor; or differs by so many of its
/// standard errors, from a moving camera by so many.
const AS_EXACT: f32 = 1.25;
const UNSETTLED_SIGMAS: f32 = 2.0;
const MOVING_SIGMAS: f32 = 3.0;
/// How far off a pixel that has only just started reports its first edge, in pixels at the rim (one standard deviation): it takes what it
/// sees for its level, where each later edge finds it up to a threshold away.
const EARLY_PX: f32 = 0.2;

/// The turn followed through the window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slope {
    /// Mean speed over the window.
    pub speed: Estimate,
    /// The same beyond the even turn that the path starts from.
    pub beyond_rad_s: f32,
    /// Standard deviation of the speed within the window, in rad/s: that of one swing a window.
    pub swing_rad_s: f32,
    /// Acceleration in rad/s^2.
    pub alpha_rad_s2: f32,
    /// Its standard error in rad/s^2.
    pub alpha_sigma_rad_s2: f32,
    /// Root mean square speed of the axis in px/s: 0 on a tripod, tens in the hand.
    pub drift_px_s: f32,
    /// Time at the window's start that was not believed, in microseconds.
    pub unsettled_us: f32,
}

/// Whether the turn slips from one cycle of `cycle_rad` to another: goes off where two blocks in step lead to the next one. A `share` of
/// their events is in step.
fn slips(points: &[Point], cycle_rad: f32, share: f32) -> bool {
    let mut before = [(0, Point::default()); 2];
    for (last, c) in points.iter().enumerate().filter(|(_, point)| point.weight > 0.0) {
        let [(first, a), (_, b)] = before;
        before = [before[1], (last, *c)];
        if a.weight <= 0.0 {
            continue;
        }
        let lead = (c.u - b.u) / (b.u - a.u);
        let off_cycles = (c.y - b.y - lead * (b.y - a.y)).abs() / cycle_rad;
        // Phases of events scatter by 1 / (2 share) in square.
        let ahead = 1.0 + lead;
        let scatter = 1.0 / c.weight + ahead * ahead / b.weight + lead * lead / a.weight;
        let sigma_cycles = sqrt(0.5 * scatter / share) / TAU;
        let gap = last - first > 2 && off_cycles > GAP_SLIP_SIGMAS * sigma_cycles;
        if off_cycles > if gap { GAP_SLIP_CYCLES } else { SLIP_CYCLES } {
            return true;
        }
    }
    false
}

/// A block alone at an end, behind a gap over which the path may have slipped by less than [`slips`] can tell, is borne out by none: left out.
fn leave_lone_ends(points: &mut [Point]) {
    // Reversed twice, each end comes first once, and the order stays.
    for _ in 0..2 {
        points.reverse();
        let mut known = points.iter().enumerate().filter(|(_, point)| point.weight > 0.0);
        if let (Some((end, _)), Some((beside, _))) = (known.next(), known.next())
            && beside - end > LONE_GAP
            && let Some(point) = points.get_mut(end)
        {
            point.weight = 0.0;
        }
    }
}

impl Pose {
    /// Time that pixels take to tell edges rightly where the stream begins with the window: until each has seen one, and a slow one
    /// has got used to the light.
    pub(super) fn settling_us(&self, window: &Window<'_>) -> f32 {
        let unsettled_us = larger(self.period_us / self.sectors as f32, SETTLING_US);
        let small = LEAST_SETTLED * unsettled_us <= self.window_us;
        if window.is_first() && small { unsettled_us } else { 0.0 }
    }

    /// What the first pass of the blades over pixels that have only just started may do to the speed, in rad/s (one standard deviation); 0
    /// where the stream does not begin with the window, or that pass was not believed. One point of n that is off by so much changes
    /// the slope of a straight line by 6 / (n (n + 1)) of that.
    // Not inlined: flash is short.
    #[inline(never)]
    pub fn start_rad_s(&self, window: &Window<'_>) -> f32 {
        if !window.is_first() || self.slope.is_some_and(|slope| slope.unsettled_us > 0.0) {
            return 0.0;
        }
        let pass_s = 1e-6 * self.period_us / self.sectors as f32;
        let passes = 1e-6 * self.window_us / pass_s;
        6.0 * EARLY_PX / (self.disc.radius_px * passes * (passes + 1.0) * pass_s)
    }

    /// The trend of the turn, where pixels may not have settled at first: what they tell meanwhile is believed where the rest bears it out
    /// and it tells more. [`Self::slope`] is the trend through all blocks.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn settled_trend(&self, sums: &Sums, window: &Window<'_>) -> Option<Slope> {
        let settled = self.trend_after(self.unsettled_us, sums);
        let (Some(all), Some(settled)) = (self.slope, settled) else {
            return self.slope.or(settled);
        };
        let off_rad_s = (all.speed.omega_rad_s - settled.speed.omega_rad_s).abs();
        let sigma_rad_s = settled.speed.sigma_rad_s;
        // A hand did something meanwhile.
        let moves = all.drift_px_s > MOVING_PX_S;
        let start_rad_s = self.start_rad_s(window);
        let most_rad_s = root_sum_square(AS_EXACT * all.speed.sigma_rad_s, start_rad_s);
        let as_exact = !moves && sigma_rad_s < most_rad_s;
        let sigmas = if moves { MOVING_SIGMAS } else { UNSETTLED_SIGMAS };
        Some(if as_exact || off_rad_s > sigmas * sigma_rad_s { settled } else { all })
    }

    /// The trend of what came later than so long after the window's start, as if all before went on as it did, and how the axis wanders;
    /// `None` when too few blocks tell, or the path has slipped.
    // Not inlined: flash is short.
    #[inline(never)]
    pub(super) fn trend_after(&self, unsettled_us: f32, sums: &Sums) -> Option<Slope> {
        let count = self.path.blocks();
        let periods = count / self.in_period.max(1);
        let middle_us = 0.5 * unsettled_us;
        let half_us = 0.5 * self.window_us - middle_us;
        let mut points = Vec::<Point, MAX_KNOTS>::new();
        let (mut sum, mut whole) = (0.0, f32::MIN_POSITIVE);
        for (index, block) in sums.blocks.iter().enumerate().take(count) {
            let u = (self.path.time_us(index, block.way()) - middle_us) / half_us;
            let (off_rad, weight) = block.turn_rad(self.harmonic as f32).unwrap_or_default();
            sum += weight * off_rad;
            whole += weight;
            points.push(Point { u, y: off_rad, weight: if u < -1.0 { 0.0 } else { weight } }).ok();
        }
        let mean_rad = sum / whole;
        for point in &mut points {
            if !self.arrived(point.y - mean_rad, point.weight) {
                point.weight = 0.0;
            }
            point.y += self.path.at(middle_us + point.u * half_us).turn_rad;
        }
        let share = self.coherence.max(LEAST_SHARE);
        if slips(&points, TAU / self.harmonic as f32, share) {
            return None;
        }
        // A single mark is in step now and then.
        if self.walk_px > WALK_SINGLE_PX {
            leave_lone_ends(&mut points);
        }
        // Blocks a period apart see the same pixels, unless the axis wanders: what tells more exactly.
        let folded = periods >= FOLDED_PERIODS && self.in_period > 1;
        let untold = middle_us / half_us + self.ends_untold(&points, half_us);
        let mut trend = Trend::fit(&points, 1);
        let mut tries = 2 * u8::from(folded);
        while tries > 0 {
            tries -= 1;
            if let Some(found) = Trend::fit(&points, self.in_period)
                && trend.is_none_or(|trend| found.slope_error < trend.slope_error)
            {
                trend = Some(found);
            }
            // The last one sees a part of its place, or some of the next: where two blades are tilted, another turn.
            points.pop();
        }
        let trend = trend?;
        let factor = student_over_normal(trend.degrees_of_freedom);
        let (half_s, middle_s) = (half_us * 1e-6, middle_us * 1e-6);
        let alpha_rad_s2 = trend.bend / (half_s * half_s);
        let alpha_sigma_rad_s2 = factor * trend.bend_error / (half_s * half_s);
        let swing_rad_s = |bent: f32| 0.5 * TAU / half_s * sqrt(bent);
        let beyond_rad_s = trend.slope / half_s - alpha_rad_s2 * middle_s;
        // What is left out may have had another acceleration, and a swing, as may the ends where no block is in step.
        let error =
            root_sum_square(factor * trend.slope_error / half_s, alpha_sigma_rad_s2 * middle_s);
        let swung = END_SWING * swing_rad_s(trend.bent_beside) * untold;
        Some(Slope {
            speed: Estimate {
                omega_rad_s: self.omega_rad_s + beyond_rad_s,
                sigma_rad_s: root_sum_square(error, swung),
            },
            beyond_rad_s,
            swing_rad_s: swing_rad_s(trend.bent),
            alpha_rad_s2,
            alpha_sigma_rad_s2,
            drift_px_s: self.drift_px_s(),
            unsettled_us,
        })
    }

    /// Whether the path has arrived at a block, known by so many events in step, that is farther off it than the mean by such a turn: within
    /// what they scatter by. That of a single mark, whose shift and turn look alike, is held back from its blocks.
    fn arrived(&self, off_rad: f32, weight: f32) -> bool {
        let off_rad = self.harmonic as f32 * off_rad;
        let scatter = 0.5 / (self.coherence.max(LEAST_SHARE) * weight);
        let most = ARRIVED_RAD * ARRIVED_RAD + ARRIVED_SIGMAS * ARRIVED_SIGMAS * scatter;
        off_rad * off_rad < most || self.walk_px <= WALK_SINGLE_PX
    }

    /// Share of the window at its two ends where no block tells.
    fn ends_untold(&self, points: &[Point], half_us: f32) -> f32 {
        let (mut before, mut after) = (-1.0, -1.0);
        for point in points.iter().filter(|point| point.weight > 0.0) {
            before = larger(before, -point.u);
            after = larger(after, point.u);
        }
        larger(0.5 * (2.0 - before - after - self.path.step_us() / half_us), 0.0)
    }

    /// Root mean square speed of the axis along the path, in px/s.
    pub(super) fn drift_px_s(&self) -> f32 {
        let size = self.path.blocks().div_ceil(DRIFT_BLOCKS).max(1);
        let dt_s = size as f32 * self.path.step_us() * 1e-6;
        let (mut squares, mut count, mut before) = (0.0, 0_u8, None);
        for knots in self.path.knots().chunks_exact(size) {
            let here = mean_place(knots);
            if let Some((x, y)) = before {
                let (vx, vy) = ((here.0 - x) / dt_s, (here.1 - y) / dt_s);
                squares += vx * vx + vy * vy;
                count += 1;
            }
            before = Some(here);
        }
        sqrt(squares / f32::from(count.max(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotors::Disc;
    use crate::store::{MOST_SEGMENTS, MOST_SPARE, Store, StoredEvent};

    #[test]
    fn pixels_that_have_only_just_started_make_few_passes_less_sure() {
        let mut memory = [StoredEvent::default(); 16 * MOST_SEGMENTS];
        let mut store = Store::new(&mut memory, MOST_SPARE, 25_000);
        for _ in 0..7 {
            store.close_segment();
        }
        let disc = Disc { radius_px: 60.0, ..Disc::default() };
        let share = |omega_rad_s: f32, window: &Window<'_>| {
            let pose = Pose::new(disc, omega_rad_s, 4, 4, window.duration_us);
            pose.start_rad_s(window) / omega_rad_s
        };
        let window = store.window(6, u64::MAX);
        // 2 turns, 8 passes: 3.3 mrad of a quarter of a turn at one of 8 points.
        let omega_rad_s = 2.0 * TAU / 0.15;
        let expected = 0.2 / 60.0 / (0.25 * TAU) * 6.0 / 72.0;
        assert!((share(omega_rad_s, &window) / expected - 1.0).abs() < 1e-3);
        assert!(share(10.0 * omega_rad_s, &window) < 0.02 * expected, "many passes");
        store.drop_oldest();
        assert!(share(omega_rad_s, &store.window(6, u64::MAX)) <= 0.0, "they have started");
    }

    /// Turns of 40 blocks, `gap` in the middle not in step: `jump_rad` over them, and a scatter of a share of a cycle of the harmonic
    /// 12 about a speed that changes.
    fn points(jump_rad: f32, gap: usize, scatter: f32) -> Vec<Point, MAX_KNOTS> {
        (0..40_usize)
            .map(|i| {
                let u = (i as f32 - 19.5) / 20.0;
                let off = scatter * CYCLE_RAD * ((i * 7 % 11) as f32 - 5.0) / 5.0;
                let y = 0.8 * u + 0.1 * u * u + off + if i < 20 { 0.0 } else { jump_rad };
                Point { u, y, weight: if (20..20 + gap).contains(&i) { 0.0 } else { 50.0 } }
            })
            .collect()
    }

    const CYCLE_RAD: f32 = TAU / 12.0;

    #[test]
    fn a_turn_by_a_cycle_of_the_harmonic_is_a_slip() {
        for jump_rad in [CYCLE_RAD, -CYCLE_RAD] {
            assert!(slips(&points(jump_rad, 0, 0.1), CYCLE_RAD, 0.9));
        }
        assert!(!slips(&points(0.0, 0, 0.1), CYCLE_RAD, 0.9));
        assert!(!slips(&[], CYCLE_RAD, 0.9));
    }

    #[test]
    fn a_turn_by_part_of_a_cycle_while_blocks_are_out_of_step_is_a_slip() {
        let part_rad = 0.4 * CYCLE_RAD;
        assert!(slips(&points(part_rad, 2, 0.01), CYCLE_RAD, 0.9));
        assert!(!slips(&points(0.0, 2, 0.01), CYCLE_RAD, 0.9));
        assert!(
            !slips(&points(part_rad, 0, 0.01), CYCLE_RAD, 0.9),
            "they follow a motor that hunts"
        );
    }

    #[test]
    fn a_block_alone_at_an_end_is_left_out_behind_two_that_are_out_of_step() {
        for end in [0, 39] {
            for gap in [1, 2] {
                let mut points = points(0.0, 0, 0.01);
                let beside = if end == 0 { 1..1 + gap } else { 39 - gap..39 };
                points[beside].iter_mut().for_each(|point| point.weight = 0.0);
                let mut left = points.clone();
                leave_lone_ends(&mut left);
                if gap > 1 {
                    points[end].weight = 0.0;
                }
                assert_eq!(left, points, "behind {gap}");
            }
        }
        leave_lone_ends(&mut []);
    }
}

//! The one front door: events in, readings out.
//!
//! [`Tachometer::push`] takes in events and never waits; [`Tachometer::poll`] advances the measurement of a full
//! window in bounded steps. A reading is a function of the events of its window, their times and the capacities alone.
//! Which windows are measured depends on speed only when a measurement takes longer than [`SPARE_SEGMENTS`]
//! segments: then events are left out and counted until it ends, and the next window starts afresh.

use heapless::Vec;

use crate::event::{Event, GyroSample};
use crate::limits::{MAX_ROTORS, MAX_SUSPECTS};
use crate::reading::{Evidence, Frame, Reading, Reason, RotorReading, Status};
use crate::rotors::extraction::{self, Extraction, View};
use crate::rotors::{Disc, Found, HeatMap, Spectrum, Visits};
use crate::settings::{Ignored, Memory, Poll, Settings};
use crate::speed::measurement::{Bench, Measurement, Outcome, Stated};
use crate::speed::polar::PolarTrack;
use crate::store::{SPARE_SEGMENTS, Store, WINDOW_SEGMENTS};
use crate::tracker::Tracker;

/// First window: short, so that a recording of a few milliseconds is spread over all segments; it doubles
/// until the base window is reached.
const FIRST_WINDOW_US: u32 = 18_750;
/// Base window (paper: "fixed-length of event stream, e.g., 150ms").
pub const BASE_WINDOW_US: u32 = 150_000;
/// Longest window.
pub const LONGEST_WINDOW_US: u32 = 2_000_000;
/// Windows that an adapting window steps through.
const WINDOWS_US: [u32; 9] = [
    BASE_WINDOW_US,
    200_000,
    300_000,
    400_000,
    600_000,
    800_000,
    1_200_000,
    1_600_000,
    LONGEST_WINDOW_US,
];
/// Segments by which the window moves on from reading to reading: 50 ms of 150.
const HOP_SEGMENTS: usize = 2;
/// Following a rotor, every so many readings the whole image is searched again.
const SEARCH_EVERY: u8 = 10;
/// The same while a rotor is in view that is not locked.
const SEARCH_AGAIN: u8 = 2;
/// Fewest events in a window that are looked at.
const LEAST_EVENTS: u64 = 300;
/// Share of events lost beyond which the rest is not trusted.
const MOST_LOST: f32 = 0.5;
/// Time going back by more than this restarts the window; less is disorder, and the event is left out.
const CLOCK_RESET_US: u64 = 1_000_000;
/// Latest sensor time that is believed: beyond it (292 000 years) sums of times could overflow.
const LATEST_US: u64 = u64::MAX / 2;
/// Standard deviation of a gyro's zero-rate offset in rad/s, with the offset calibrated on a still camera.
const GYRO_OFFSET_RAD_S: f32 = 3e-3;

/// Fastest roll that is believed, in rad/s: gyros in cameras end at 2000 degrees a second (35 rad/s).
const FASTEST_ROLL_RAD_S: f32 = 100.0;

#[derive(Debug, Default)]
#[expect(clippy::large_enum_variant, reason = "no heap to box the larger one on")]
enum Job {
    #[default]
    Idle,
    /// Searching the whole image.
    Search(Extraction),
    /// Measuring candidate number `0`.
    Measure(usize, Measurement),
}

/// A place to measure.
#[derive(Clone, Copy, Debug)]
struct Suspect {
    found: Found,
    /// Blade count, and whether the blades are alike, of a rotor that was locked in the window before.
    followed: Option<(Option<u8>, bool)>,
}

/// Memory that is used by one job at a time.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "the larger one is the point: both share its memory")]
enum Scratch {
    Search(extraction::Scratch),
    Measure(Bench),
}

/// Events in, readings out.
#[derive(Debug)]
pub struct Tachometer<'m> {
    settings: Settings,
    store: Store<'m>,
    heat: HeatMap<'m>,
    weights: &'m mut [u8],
    started: bool,
    last_us: u64,
    target_us: u32,
    /// Segments of the window that is being measured; 0 = none.
    window_segments: usize,
    /// End of the stored events when the measurement started: a last window may not be full.
    window_end_us: u64,
    /// Whether the store has filled before the measurement ended.
    overrun: bool,
    /// Whether the last reading was a lock, so that the rest of a stream need not be looked at.
    satisfied: bool,
    ignored: Ignored,
    job: Job,
    polar: PolarTrack,
    spectrum: Spectrum,
    scratch: Scratch,
    candidates: Vec<Suspect, MAX_SUSPECTS>,
    outcomes: Vec<Outcome, MAX_ROTORS>,
    in_step_hz: Option<f32>,
    tracker: Tracker,
    /// Readings until the whole image is searched again.
    until_search: u8,
}

impl<'m> Tachometer<'m> {
    /// A tachometer over the lent memory.
    #[must_use]
    pub fn new(settings: Settings, memory: Memory<'m>) -> Self {
        let heat = HeatMap::new(memory.heat, settings.geometry);
        Self {
            settings,
            store: Store::new(memory.events, segment_us(FIRST_WINDOW_US)),
            heat,
            weights: memory.weights,
            started: false,
            last_us: 0,
            target_us: settings.window_us.unwrap_or(BASE_WINDOW_US),
            window_segments: 0,
            window_end_us: 0,
            overrun: false,
            satisfied: false,
            ignored: Ignored::default(),
            job: Job::Idle,
            polar: PolarTrack::new(),
            spectrum: Spectrum::default(),
            scratch: Scratch::Measure(Bench::EMPTY),
            candidates: Vec::new(),
            outcomes: Vec::new(),
            in_step_hz: None,
            tracker: Tracker::default(),
            until_search: 0,
        }
    }

    /// Begins anew with other settings: another sensor, or a blade count that the person chose. What was counted
    /// stays counted.
    pub fn configure(&mut self, settings: Settings) {
        self.settings = settings;
        self.heat.resize(settings.geometry);
        self.tracker = Tracker::default();
        self.started = false;
        self.window_segments = 0;
        self.job = Job::Idle;
        self.candidates.clear();
        self.outcomes.clear();
    }

    /// The settings in use.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes in events in time order; never waits for a measurement.
    /// Cost: about 50 instructions an event, and one pass over the heat map for each segment that ends.
    pub fn push(&mut self, events: &[Event]) {
        for event in events {
            self.push_one(event);
        }
    }

    fn push_one(&mut self, event: &Event) {
        if !self.settings.geometry.contains(event.x, event.y) {
            self.ignored.out_of_bounds += 1;
            return;
        }
        if self.settings.roi.is_some_and(|roi| !roi.contains(event.x, event.y)) {
            self.ignored.out_of_roi += 1;
            return;
        }
        if event.t_us > LATEST_US {
            self.ignored.out_of_order += 1;
            return;
        }
        if event.t_us < self.last_us && self.started {
            if self.last_us - event.t_us < CLOCK_RESET_US {
                self.ignored.out_of_order += 1;
                return;
            }
            self.started = false;
        }
        if !self.started {
            self.restart(event.t_us);
        }
        self.last_us = event.t_us;
        if event.t_us >= self.store.open_end_us() && !self.overrun {
            self.advance(event.t_us);
        }
        if self.overrun {
            self.ignored.overrun += 1;
            return;
        }
        self.heat.add(event.x, event.y);
        self.store.push(event);
    }

    /// Forgets the window; rotors keep their letters.
    fn restart(&mut self, t_us: u64) {
        self.started = true;
        self.overrun = false;
        self.window_segments = 0;
        self.job = Job::Idle;
        self.target_us = self.settings.window_us.unwrap_or(BASE_WINDOW_US);
        self.store.restart(t_us, segment_us(FIRST_WINDOW_US.min(self.target_us)));
        self.heat.clear();
        self.until_search = 0;
    }

    /// Closes segments until the open one holds `t_us`.
    fn advance(&mut self, t_us: u64) {
        let gap_us = t_us - self.store.open_end_us();
        if gap_us > u64::from(LONGEST_WINDOW_US) && self.window_segments == 0 {
            // Nothing for longer than any window: what went before says nothing about what comes.
            self.restart(t_us);
            return;
        }
        while t_us >= self.store.open_end_us() {
            if self.store.full() {
                self.overrun = true;
                return;
            }
            self.store.close_segment();
            let window_us = self.store.segment_us() * WINDOW_SEGMENTS as u32;
            if self.window_segments == 0 && self.store.closed() >= WINDOW_SEGMENTS {
                if window_us + WINDOW_SEGMENTS as u32 <= self.target_us {
                    self.store.lengthen(segment_us(self.target_us.min(2 * window_us)));
                } else {
                    self.start(WINDOW_SEGMENTS);
                }
            }
        }
    }

    /// Starts measuring the window over the oldest segments.
    fn start(&mut self, segments: usize) {
        self.window_segments = segments;
        self.window_end_us = self.last_us + 1;
        self.candidates.clear();
        self.outcomes.clear();
        self.in_step_hz = None;
        let known = self.tracker.known().iter().filter(|known| known.can_be_followed());
        for known in known {
            let followed = Some((known.parts, known.alike));
            self.candidates.push(Suspect { found: known.found, followed }).ok();
        }
        if self.until_search == 0 || self.candidates.is_empty() {
            self.candidates.clear();
            self.search();
        } else {
            self.until_search -= 1;
            self.measure_next(0);
        }
    }

    fn search(&mut self) {
        self.until_search = SEARCH_EVERY;
        if !matches!(self.scratch, Scratch::Search(_)) {
            self.scratch = Scratch::Search(extraction::Scratch::default());
        }
        self.job = Job::Search(Extraction::default());
    }

    /// Counts events that the sensor or the link lost.
    pub fn lost(&mut self, count: u64) {
        self.store.lost(count);
    }

    /// Takes in a gyro sample. One that no gyro gives (not a number, or faster than any measures) is left out.
    pub fn gyro(&mut self, sample: GyroSample) {
        let believed = sample.roll_rad_s.abs() <= FASTEST_ROLL_RAD_S;
        if self.started && believed {
            self.store.roll(sample.roll_rad_s);
        }
    }

    /// Events that were not used, by cause.
    #[must_use]
    pub const fn ignored(&self) -> Ignored {
        self.ignored
    }

    /// Events left out on purpose since the start: the store is smaller than the window.
    #[must_use]
    pub const fn thinned(&self) -> u64 {
        self.store.thinned()
    }

    /// The heat map, for aiming.
    #[must_use]
    pub const fn heat(&self) -> &HeatMap<'m> {
        &self.heat
    }

    /// Name of the stage that the next poll works on.
    #[must_use]
    pub const fn stage(&self) -> &'static str {
        match &self.job {
            Job::Idle => "idle",
            Job::Search(extraction) => extraction.stage(),
            Job::Measure(_, measurement) => measurement.stage(),
        }
    }

    /// Ends the stream: what is in the window is to be measured even if the window is not full.
    pub fn finish(&mut self) {
        if self.started && self.window_segments == 0 && !self.satisfied {
            self.start((self.store.closed() + 1).min(WINDOW_SEGMENTS));
        }
    }

    /// Advances the measurement by at most `steps` steps, each of a few million instructions at most (`evtach bench cost`).
    pub fn poll(&mut self, steps: u32) -> Poll {
        for _ in 0..steps {
            if self.window_segments == 0 {
                return Poll::Idle;
            }
            if self.step() {
                return Poll::Ready(self.conclude());
            }
        }
        Poll::Pending
    }

    /// One step of the running job; `true` once the window has been measured.
    fn step(&mut self) -> bool {
        let window = self.store.window(self.window_segments, self.window_end_us);
        match &mut self.job {
            Job::Idle => true,
            Job::Search(extraction) => {
                let grid = Visits::grid(self.settings.geometry, self.weights.len());
                let Some(weights) = self.weights.get_mut(..grid.len()) else { return true };
                let mut view = View { window, grid, weights };
                let Scratch::Search(scratch) = &mut self.scratch else { return true };
                if extraction.step(&mut view, &mut self.polar, &mut self.spectrum, scratch) {
                    self.in_step_hz = extraction.in_step_hz();
                    for candidate in extraction.candidates() {
                        self.candidates.push(Suspect { found: *candidate, followed: None }).ok();
                    }
                    return self.measure_next(0);
                }
                false
            }
            Job::Measure(index, measurement) => {
                let Scratch::Measure(bench) = &mut self.scratch else { return true };
                let stated = Stated {
                    blades: self.settings.blades,
                    clock_sigma_ppm: self.settings.clock_sigma_ppm,
                };
                if !measurement.step(&window, &stated, &mut self.polar, bench) {
                    return false;
                }
                let (index, outcome) = (*index, measurement.result());
                let followed = self.candidates.get(index).is_some_and(|c| c.followed.is_some());
                if followed && outcome.status != Status::Locked {
                    // Lost: look at the whole image again, in this very window.
                    self.candidates.clear();
                    self.outcomes.clear();
                    self.search();
                    return false;
                }
                self.keep(outcome);
                self.measure_next(index + 1)
            }
        }
    }

    /// Keeps an outcome unless it says that nothing turns there.
    fn keep(&mut self, outcome: Outcome) {
        if outcome.status == Status::Refused(Reason::NoRotation) {
            return;
        }
        let rank = |outcome: &Outcome| match outcome.status {
            Status::Locked => 2,
            Status::Coarse => 1,
            Status::Refused(_) => 0,
        };
        let place = outcome.found.disc;
        let rival = self.outcomes.iter_mut().find(|o| o.found.disc.overlaps(&place));
        match rival {
            // The rotor that was measured stands, whatever else was thought to be in its place.
            Some(rival) if rank(&outcome) > rank(rival) => *rival = outcome,
            Some(_) => {}
            None => {
                self.outcomes.push(outcome).ok();
            }
        }
    }

    /// Starts measuring the next candidate from `index` on that no measured rotor overlaps; `true` when none is left.
    fn measure_next(&mut self, index: usize) -> bool {
        let taken = |disc: &Disc| {
            let measured = |o: &&Outcome| o.status.reason().is_none();
            self.outcomes.iter().filter(measured).any(|o| o.found.disc.overlaps(disc))
        };
        let next = (index..self.candidates.len()).find(|i| !taken(&self.candidates[*i].found.disc));
        let Some(next) = next else {
            self.job = Job::Idle;
            return true;
        };
        if !matches!(self.scratch, Scratch::Measure(_)) {
            self.scratch = Scratch::Measure(Bench::EMPTY);
        }
        let Suspect { found, followed } = self.candidates[next];
        let measurement = match followed {
            Some((parts, alike)) => Measurement::follow(&found, parts, alike),
            None => Measurement::new(&found),
        };
        self.job = Job::Measure(next, measurement);
        false
    }

    /// Turns the outcomes into a reading and moves the window on.
    fn conclude(&mut self) -> Reading {
        let segments = self.window_segments;
        let account = self.store.account(segments);
        let window = self.store.window(segments, self.window_end_us);
        let (start_us, window_us) = (window.start_us, window.duration_us);
        self.tracker.start_reading();
        let mut rotors = Vec::<RotorReading, MAX_ROTORS>::new();
        for outcome in &self.outcomes {
            let id = self.tracker.identify(outcome);
            rotors.push(rotor_reading(id, outcome, account.roll_rad_s())).ok();
        }
        rotors.sort_unstable_by_key(|rotor| rotor.id);
        let lost =
            account.lost as f32 > MOST_LOST * account.counted.saturating_add(account.lost) as f32;
        let status = if account.counted == 0 {
            Status::Refused(Reason::NoEvents)
        } else if account.counted < LEAST_EVENTS {
            Status::Refused(Reason::TooFewEvents)
        } else if lost && rotors.iter().all(|rotor| rotor.speed.is_none()) {
            Status::Refused(Reason::Saturated)
        } else {
            best_status(&rotors, self.in_step_hz)
        };
        self.move_on(status);
        Reading {
            t_us: start_us + u64::from(window_us / 2),
            window_us,
            events: account.counted,
            thinned: account.counted - account.kept,
            lost: account.lost,
            status,
            rotors,
        }
    }

    /// Chooses the next window: longer while a rotor or the search needs it, else a hop further.
    fn move_on(&mut self, status: Status) {
        self.window_segments = 0;
        self.job = Job::Idle;
        self.satisfied = status == Status::Locked;
        if self.outcomes.iter().any(|outcome| outcome.status != Status::Locked) {
            self.until_search = self.until_search.min(SEARCH_AGAIN);
        }
        if self.overrun {
            // There is a hole behind what is stored. What is known of the rotors still holds.
            let until_search = self.until_search;
            self.restart(self.last_us);
            self.until_search = until_search;
            return;
        }
        let window_us = self.store.segment_us() * WINDOW_SEGMENTS as u32;
        let wanted = self.outcomes.iter().map(|o| o.wanted_us).fold(0.0, f32::max);
        let wanted =
            if status.reason().is_some() { wanted.max(1.5 * window_us as f32) } else { wanted };
        let adapts = self.settings.window_us.is_none();
        if adapts && wanted > window_us as f32 * 1.02 && window_us < LONGEST_WINDOW_US {
            let longer = WINDOWS_US.iter().find(|w| **w as f32 >= wanted);
            self.target_us = longer.copied().unwrap_or(LONGEST_WINDOW_US);
            self.store.lengthen(segment_us(self.target_us));
            // It is longer for a rotor that is not locked, and only those are followed.
            self.until_search = 0;
        } else if status.reason().is_some() && adapts {
            // Nothing even in the longest window: begin again with a short one.
            self.restart(self.last_us);
        } else {
            for _ in 0..HOP_SEGMENTS {
                self.store.drop_oldest();
                self.heat.fade(WINDOW_SEGMENTS as u16);
            }
        }
    }
}

const fn segment_us(window_us: u32) -> u32 {
    window_us / WINDOW_SEGMENTS as u32
}

fn rotor_reading(id: u8, outcome: &Outcome, roll_rad_s: Option<f32>) -> RotorReading {
    let mut speed = outcome.speed;
    if let Some(speed) = &mut speed {
        // The gyro serves where its offset is smaller than what the hand may have rolled.
        let mut roll_sigma = outcome.roll_sigma_rad_s;
        if let Some(roll_rad_s) = roll_rad_s.filter(|_| GYRO_OFFSET_RAD_S < roll_sigma) {
            speed.omega_rad_s -= roll_rad_s;
            speed.frame = Frame::Room;
            roll_sigma = GYRO_OFFSET_RAD_S;
        }
        let sigma = speed.omega_sigma_rad_s;
        speed.omega_sigma_rad_s = crate::math::sqrt(sigma * sigma + roll_sigma * roll_sigma);
    }
    let Disc { x_px, y_px, radius_px } = outcome.found.disc;
    let evidence: Evidence = outcome.evidence;
    let (blades, status) = (outcome.parts, outcome.status);
    RotorReading { id, x_px, y_px, radius_px, blades, status, speed, evidence }
}

/// The best status among the rotors, or why there is none.
fn best_status(rotors: &[RotorReading], in_step_hz: Option<f32>) -> Status {
    let has = |status: Status| rotors.iter().any(|rotor| rotor.status == status);
    if has(Status::Locked) {
        Status::Locked
    } else if has(Status::Coarse) {
        Status::Coarse
    } else if let Some(first) = rotors.first() {
        first.status
    } else if in_step_hz.is_some_and(is_mains) {
        Status::Refused(Reason::Flicker)
    } else {
        Status::Refused(Reason::NoRotation)
    }
}

/// Whether a frequency is twice that of the mains, or a multiple: lamps.
fn is_mains(hz: f32) -> bool {
    [100.0, 120.0].iter().any(|mains| {
        let ratio = hz / mains;
        let nearest = libm::roundf(ratio);
        nearest >= 1.0 && (ratio - nearest).abs() * mains < 4.0
    })
}

const _: () = assert!(SPARE_SEGMENTS >= HOP_SEGMENTS);

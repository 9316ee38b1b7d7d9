//! The one front door: events in, readings out.
//!
//! [`Tachometer::push`] takes in events and never waits; [`Tachometer::poll`] advances the measurement of a full
//! window in bounded steps. A reading is a function of the events of its window, their times and the capacities alone.
//! Which windows are measured depends on speed only when a measurement takes longer than the spare segments last:
//! then all that came meanwhile is the next window, thinned so that it finds room.

mod beside;
mod conclude;
mod gate;
mod intake;
mod job;
mod rhythm;
mod work;

use heapless::Vec;

use crate::limits::{MAX_ROTORS, MAX_SUSPECTS, POLAR_EVENTS};
use crate::rotors::extraction::{Extraction, Round};
use crate::rotors::{Found, HeatMap, Spectrum};
use crate::settings::{Ignored, Memory, More, Settings};
use crate::speed::measurement::{Measurement, Outcome};
use crate::speed::polar::PolarEvents;
use crate::store::{Store, WINDOW_SEGMENTS};
use crate::tracker::Tracker;
use rhythm::Rhythm;

pub use intake::CLOCK_RESET_US;
use work::Scratch;
pub use work::Work;

/// First window: short, so that a recording of a few milliseconds is spread over all segments; it doubles
/// until the base window is reached.
const FIRST_WINDOW_US: u32 = 18_750;
/// Base window (paper: "fixed-length of event stream, e.g., 150ms").
pub const BASE_WINDOW_US: u32 = 150_000;
/// Longest window.
pub const LONGEST_WINDOW_US: u32 = 2_000_000;

#[derive(Debug, Default)]
#[allow(clippy::large_enum_variant, reason = "one job at a time, and no heap to put the larger on")]
enum Job {
    #[default]
    Idle,
    /// Putting a lamp's events out of sight: of segment `0` next; `1`: whether there were any.
    Darken(usize, bool),
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

/// Events in, readings out.
#[derive(Debug)]
pub struct Tachometer<'m> {
    settings: Settings,
    rhythm: Rhythm,
    store: Store<'m>,
    heat: HeatMap<'m>,
    weights: &'m mut [u8],
    more: Option<More<'m>>,
    started: bool,
    last_us: u64,
    target_us: u32,
    /// Segments of the window that is being measured; 0 = none.
    window_segments: usize,
    /// End of the stored events when the measurement started: a last window may not be full.
    window_end_us: u64,
    /// Whether, while a window was measured, nothing came for longer than the spare segments last: what they hold does not go
    /// on from the window, nor what comes from them.
    overrun: bool,
    /// Whether the window that is measured is all that came while the one before was measured.
    catching_up: bool,
    /// Whether the last reading was a lock, so that the rest of a stream need not be looked at.
    satisfied: bool,
    ignored: Ignored,
    job: Job,
    polar: &'m mut PolarEvents<POLAR_EVENTS>,
    spectrum: &'m mut Spectrum,
    scratch: &'m mut Scratch,
    candidates: Vec<Suspect, MAX_SUSPECTS>,
    outcomes: Vec<Outcome, MAX_ROTORS>,
    /// Whether what keeps step in this window passes more often than is followed.
    too_fast: bool,
    /// Frequency in Hz at which all that is seen flickers, 0 for none.
    lamp_hz: f32,
    /// Whether a lamp's events are out of sight.
    dark: bool,
    /// Whether a rotor that is followed was not locked in this window.
    lost: bool,
    /// Whether polarity is ignored in what is searched and found, as the window showed nothing sure with it.
    ignores_polarity: bool,
    tracker: Tracker,
    /// Readings until the whole image is searched again, or [`rhythm::NEVER`].
    until_search: u8,
    /// How far the search beside the rotors has got that is spread over readings.
    round: Round,
    stretch: Stretch,
    beside: Beside,
    /// Whether a search of all of the image, but for what is followed, began in this window.
    searched: bool,
    /// When the window begins anew, in microseconds; until then none is measured.
    anew_us: Option<u64>,
}

/// Whether the window may be longer than what is in it needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stretch {
    /// It is as long as the rotors wanted it.
    #[default]
    Wanted,
    /// It grew while nothing turned, and so many longest ones were refused since: what has come into view may do with less.
    Blind(u8),
    /// It was begun short again for that, and none was locked yet, or longest ones alone.
    Tried,
}

/// What moves beside the rotors, all of which are locked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Beside {
    /// Nothing, or it was not asked yet.
    #[default]
    Nothing,
    /// Something, and the window grows to see whether it turns slowly, from so many microseconds on.
    LookedAt(f32),
    /// What has been looked at. Windows are as long as the rotors want them.
    Known,
}

impl<'m> Tachometer<'m> {
    /// A tachometer over the lent memory.
    #[must_use]
    pub fn new(settings: Settings, memory: Memory<'m>) -> Self {
        let heat = HeatMap::new(memory.heat, settings.geometry);
        let rhythm = Rhythm::of(memory.events.len());
        let Work { polar, spectrum, scratch } = memory.work;
        Self {
            settings,
            rhythm,
            store: Store::new(memory.events, rhythm.spare, segment_us(FIRST_WINDOW_US)),
            heat,
            weights: memory.weights,
            more: memory.more,
            started: false,
            last_us: 0,
            target_us: settings.window_us.unwrap_or(BASE_WINDOW_US),
            window_segments: 0,
            window_end_us: 0,
            overrun: false,
            catching_up: false,
            satisfied: false,
            ignored: Ignored::default(),
            job: Job::Idle,
            polar,
            spectrum,
            scratch,
            candidates: Vec::new(),
            outcomes: Vec::new(),
            too_fast: false,
            lamp_hz: 0.0,
            dark: false,
            lost: false,
            ignores_polarity: false,
            tracker: Tracker::default(),
            until_search: 0,
            round: Round::default(),
            stretch: Stretch::default(),
            beside: Beside::default(),
            searched: false,
            anew_us: None,
        }
    }

    /// Begins anew with other settings: another sensor, or a blade count that the person chose. What was counted
    /// stays counted.
    pub fn configure(&mut self, settings: Settings) {
        self.settings = settings;
        self.heat.resize(settings.geometry);
        self.tracker = Tracker::default();
        self.stretch = Stretch::default();
        self.beside = Beside::default();
        self.store.forget_roll();
        self.started = false;
        self.window_segments = 0;
        self.satisfied = false;
        self.job = Job::Idle;
        self.candidates.clear();
        self.outcomes.clear();
    }

    /// The settings in use.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
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

    /// Whether a window is being measured: otherwise a poll does nothing.
    #[must_use]
    pub const fn is_measuring(&self) -> bool {
        self.window_segments > 0
    }

    /// Name of the stage that the next poll works on.
    #[must_use]
    pub const fn stage(&self) -> &'static str {
        match &self.job {
            Job::Idle if self.window_segments > 0 => "conclusion",
            Job::Idle => "idle",
            Job::Darken(..) => "lamp",
            Job::Search(extraction) => extraction.stage(),
            Job::Measure(_, measurement) => measurement.stage(),
        }
    }
}

const fn segment_us(window_us: u32) -> u32 {
    window_us / WINDOW_SEGMENTS as u32
}

//! The memory that measuring works in.

use crate::limits::{POLAR_EVENTS, VISITS};
use crate::rotors::{Spectrum, extraction};
use crate::speed::measurement::Bench;
use crate::speed::polar::PolarEvents;

/// Memory that measuring works in, the same size everywhere.
///
/// It is lent instead of being a part of the tachometer, so that a device makes it in place: built on the stack first, it would
/// be what the stack is deepest for.
#[derive(Debug)]
pub struct Work {
    pub(super) polar: PolarEvents<POLAR_EVENTS>,
    pub(super) spectrum: Spectrum,
    pub(super) scratch: Scratch,
}

impl Work {
    /// Nothing in it. All zeros, so that no image holds a copy of it.
    pub const EMPTY: Self = Self {
        polar: PolarEvents::new(),
        spectrum: Spectrum::EMPTY,
        scratch: Scratch::Measure(Bench::EMPTY),
    };
}

impl Default for Work {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// Memory that is used by one job at a time. With a tag of its own, of which the first is zero, whatever the jobs keep: else
/// [`Work::EMPTY`] may hold a bit, and flash a copy of it all.
#[derive(Debug)]
#[repr(C, u32)]
pub(super) enum Scratch {
    Measure(Bench),
    Search {
        scratch: extraction::Scratch,
        /// Times of the events that are searched, where no more room is lent for them.
        times: [u16; VISITS],
    },
}

// Not inlined: through a reference of its own the compiler writes in place what it would build on the stack otherwise.
impl Scratch {
    #[inline(never)]
    pub(super) fn ready_for_search(&mut self) {
        if !matches!(self, Self::Search { .. }) {
            *self = Self::Search { scratch: extraction::Scratch::default(), times: [0; VISITS] };
        }
    }

    #[inline(never)]
    pub(super) fn ready_for_measuring(&mut self) {
        match self {
            Self::Measure(bench) => bench.clear(),
            Self::Search { .. } => *self = Self::Measure(Bench::EMPTY),
        }
    }
}

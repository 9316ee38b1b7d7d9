//! The memory that measuring works in.

use crate::rotors::{Spectrum, extraction};
use crate::speed::measurement::Bench;
use crate::speed::polar::PolarTrack;

/// Memory that measuring works in, the same size everywhere.
///
/// It is lent instead of being a part of the tachometer, so that a device makes it in place: built on the stack first, it would
/// be what the stack is deepest for.
#[derive(Debug)]
pub struct Work {
    pub(super) polar: PolarTrack,
    pub(super) spectrum: Spectrum,
    pub(super) scratch: Scratch,
}

impl Work {
    /// Nothing in it. All zeros, so that no image holds a copy of it.
    pub const EMPTY: Self = Self {
        polar: PolarTrack::new(),
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
#[allow(clippy::large_enum_variant, reason = "the larger one is the point: both share its memory")]
#[repr(C, u32)]
#[expect(clippy::large_enum_variant, reason = "the larger one is the point: both share its memory")]
pub(super) enum Scratch {
    Measure(Bench),
    Search(extraction::Scratch),
}

// Not inlined: through a reference of its own the compiler writes in place what it would build on the stack otherwise.
impl Scratch {
    #[inline(never)]
    pub(super) fn ready_for_search(&mut self) {
        if !matches!(self, Self::Search(_)) {
            *self = Self::Search(extraction::Scratch::default());
        }
    }

    #[inline(never)]
    pub(super) fn ready_for_measuring(&mut self) {
        match self {
            Self::Measure(bench) => bench.clear(),
            Self::Search(_) => *self = Self::Measure(Bench::EMPTY),
        }
    }
}

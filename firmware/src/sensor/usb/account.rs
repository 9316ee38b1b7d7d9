//! What became of the events that the camera saw.

use core::fmt;

use super::limit::Limit;
use super::model::Model;
use super::trouble::Trouble;
use crate::sensor::outlet::Delivered;
use evtach_core::Geometry;

/// A camera that answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Camera {
    /// What it is.
    pub model: Model,
    /// Its pixels, as it tells.
    pub geometry: Geometry,
}

/// How acquisition stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Acquired {
    /// The camera, while it answers.
    pub camera: Option<Camera>,
    /// Why there is none, where something is plugged in.
    pub trouble: Option<Trouble>,
    /// Sensor time that has been reached, in microseconds.
    pub latest_us: u64,
    /// Events that came, and what became of them here.
    pub delivered: Delivered,
    /// Events that the camera left out because it was told to send fewer. It tells no number: it leaves out one for
    /// each that comes, or that it loses, while [`Limit::skips`]. What lies outside of a region is not known.
    pub thinned_by_camera: u64,
    /// Events that the camera lost because its FIFO was full, by its own counter; a camera without counters tells none.
    pub lost_by_camera: u64,
    /// What the camera is told to leave out.
    pub limit: Limit,
    /// Words that no such camera sends, and halves of words.
    pub damaged_words: u64,
    /// Times the camera's clock began anew, without it being plugged in.
    pub clock_resets: u32,
    /// Sessions that began: the first one, and one for each time the camera was plugged in or asked anew.
    pub sessions: u32,
    /// Times the data stopped, and was made to go on.
    pub stalls: u32,
    /// Transfers that failed for another reason.
    pub errors: u32,
}

impl Acquired {
    /// Nothing has come yet.
    pub const NONE: Self = Self {
        camera: None,
        trouble: None,
        latest_us: 0,
        delivered: Delivered::NONE,
        thinned_by_camera: 0,
        lost_by_camera: 0,
        limit: Limit::NONE,
        damaged_words: 0,
        clock_resets: 0,
        sessions: 0,
        stalls: 0,
        errors: 0,
    };

    /// Events that the camera saw, as far as that is known: each of them came, or is counted under what became of it.
    #[must_use]
    pub const fn seen(&self) -> u64 {
        self.delivered
            .received
            .saturating_add(self.thinned_by_camera)
            .saturating_add(self.lost_by_camera)
    }
}

/// One line that begins with "acquired": every count under its name.
impl fmt::Display for Acquired {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Delivered { received, thinned, overrun } = self.delivered;
        write!(
            f,
            "acquired seen={} received={received} thinned={thinned} overrun={overrun} thinned_by_camera={} \
             lost_by_camera={} skips={} narrowed={} damaged_words={} clock_resets={} sessions={} stalls={} errors={} \
             sensor={}",
            self.seen(),
            self.thinned_by_camera,
            self.lost_by_camera,
            u8::from(self.limit.skips),
            u8::from(self.limit.region.is_some()),
            self.damaged_words,
            self.clock_resets,
            self.sessions,
            self.stalls,
            self.errors,
            self.camera.map_or("-", |camera| camera.model.name()),
        )
    }
}

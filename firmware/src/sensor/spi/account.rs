//! What became of the events that the sensor sent.

use super::frame::{Header, Kind};
use super::parser::Frame;

/// Events lost between sensor and device, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Lost {
    /// By the bridge, as it tells.
    pub bridge: u64,
    /// In frames whose checksum was wrong.
    pub damaged: u64,
    /// In frames that never came, or whose first bytes were damaged.
    pub missing: u64,
    /// In sound frames, in words that give no event although the bridge counted one.
    pub undecoded: u64,
}

impl Lost {
    /// None.
    pub const NONE: Self = Self { bridge: 0, damaged: 0, missing: 0, undecoded: 0 };

    /// All of them.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.bridge
            .saturating_add(self.damaged)
            .saturating_add(self.missing)
            .saturating_add(self.undecoded)
    }
}

/// Counts over a stream. How many events are lost is exact, because every frame tells how many were sent
/// before it; which of them were in damaged frames and which in missing ones is shared out by the
/// number of either, where both happened between two sound frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Account {
    /// Sound frames.
    pub frames: u64,
    /// Frames that came with a wrong checksum.
    pub frames_damaged: u64,
    /// Frames that did not come.
    pub frames_missing: u64,
    /// Times the bridge began its counting anew: it was restarted, and what was lost then is not known.
    pub restarts: u64,
    /// Events that came.
    pub received: u64,
    /// Events that did not.
    pub lost: Lost,
    expected: Option<Expected>,
}

/// What the next frame should say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Expected {
    sequence: u32,
    events_before: u32,
    bridge_lost: u32,
}

/// How far a counter that wraps has gone on; `None` when it stepped back.
const fn ahead(from: u32, to: u32) -> Option<u32> {
    let step = to.wrapping_sub(from);
    if step <= i32::MAX as u32 { Some(step) } else { None }
}

impl Account {
    /// Nothing has come yet.
    pub const NONE: Self = Self {
        frames: 0,
        frames_damaged: 0,
        frames_missing: 0,
        restarts: 0,
        received: 0,
        lost: Lost::NONE,
        expected: None,
    };

    /// Takes in the header of a sound frame and returns how many events were lost since the one before. The
    /// frame's own events follow by [`Account::events`].
    pub fn frame(&mut self, frame: &Frame<'_>) -> u64 {
        let header = &frame.header;
        self.frames += 1;
        let before = self.lost.total();
        match self.expected.and_then(|expected| gap(&expected, header)) {
            Some((frames, events, bridge)) => {
                self.add(frame.damaged_before, frames, events, bridge)
            }
            None => self.restarts += u64::from(self.expected.is_some()),
        }
        self.expected = Some(Expected {
            sequence: header.sequence.wrapping_add(1),
            events_before: header.events_before,
            bridge_lost: header.bridge_lost,
        });
        self.lost.total().saturating_sub(before)
    }

    fn add(&mut self, rejected: u32, frames: u32, events: u32, bridge: u32) {
        // What looked like a frame and was none must not make more damaged frames than there are.
        let damaged = rejected.min(frames);
        self.frames_damaged += u64::from(damaged);
        self.frames_missing += u64::from(frames - damaged);
        self.lost.bridge = self.lost.bridge.saturating_add(bridge.into());
        let events = u64::from(events);
        if frames == 0 {
            self.lost.undecoded = self.lost.undecoded.saturating_add(events);
        } else {
            let in_damaged = events * u64::from(damaged) / u64::from(frames);
            self.lost.damaged = self.lost.damaged.saturating_add(in_damaged);
            self.lost.missing = self.lost.missing.saturating_add(events - in_damaged);
        }
    }

    /// Takes in the number of events that the frame held.
    pub fn events(&mut self, count: u32) {
        self.received = self.received.saturating_add(count.into());
        if let Some(expected) = &mut self.expected {
            expected.events_before = expected.events_before.wrapping_add(count);
        }
    }

    /// Events that the sensor sent since the first sound frame: each of them came, or is lost by a cause.
    #[must_use]
    pub const fn sent(&self) -> u64 {
        self.received.saturating_add(self.lost.total())
    }
}

/// Frames, events and the bridge's own losses between what was expected and a header; `None` when the
/// bridge counts anew.
fn gap(expected: &Expected, header: &Header) -> Option<(u32, u32, u32)> {
    Some((
        ahead(expected.sequence, header.sequence)?,
        ahead(expected.events_before, header.events_before)?,
        ahead(expected.bridge_lost, header.bridge_lost)?,
    ))
}

impl Header {
    /// Whether events follow in the payload.
    #[must_use]
    pub const fn has_events(&self) -> bool {
        matches!(self.kind, Kind::Evt2 | Kind::Evt3)
    }
}

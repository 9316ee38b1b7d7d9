//! Fewer events by the camera's own registers, when it sends more than the instrument can use.

use embassy_time::{Duration, Instant};
use evtach_core::{Geometry, Roi};
use heapless::Vec;

use super::model::Model;
use super::registers::{Module, Register};

/// Time over which a rate is taken.
const WINDOW: Duration = Duration::from_millis(100);

/// Windows with few enough events after which less is left out: three seconds.
const CALM: u32 = 30;

/// Sides of the regions that are left, in 256ths: half the area, a quarter.
const SIDES: [u32; 2] = [181, 128];

/// Most registers that a step takes.
const MOST_WRITES: usize = 16;

/// What the camera leaves out: each step keeps about half of what the one before kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limit {
    /// One event is left out for each that is let through.
    pub skips: bool,
    /// Only this part of the sensor sends events; `None`: all of it.
    pub region: Option<Roi>,
}

impl Limit {
    /// Nothing is left out.
    pub const NONE: Self = Self { skips: false, region: None };

    /// Whether anything is left out.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.skips || self.region.is_some()
    }
}

/// Which filters a camera has: an older logic may lack some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Abilities {
    pub model: Model,
    /// The pixel array, in its own coordinates.
    pub array: Geometry,
    pub skips: bool,
    pub regions: bool,
}

impl Abilities {
    /// The steps, from all events to fewest.
    fn steps(&self) -> Vec<Limit, 4> {
        let mut steps = Vec::from_array([Limit::NONE]);
        let mut now = Limit::NONE;
        if self.skips {
            now.skips = true;
            steps.push(now).ok();
        }
        if self.regions {
            for side in SIDES {
                now.region = Some(middle(self.array, side));
                steps.push(now).ok();
            }
        }
        steps
    }

    /// The registers that set a limit, in the order in which they are written.
    pub fn writes(&self, limit: &Limit) -> Vec<(Register, u32), MOST_WRITES> {
        let whole = middle(self.array, 256);
        let Roi { x, y, width_px, height_px } = limit.region.unwrap_or(whole);
        let [left, top] = [u32::from(x), u32::from(y)];
        let [right, bottom] = [left + u32::from(width_px) - 1, top + u32::from(height_px) - 1];
        let mut writes = Vec::new();
        match self.model {
            Model::Davis346 => {
                let mut write = |parameter, value| {
                    writes.push((Register::new(Module::Dvs, parameter), value)).ok();
                };
                if self.skips {
                    // Events let through before one is left out.
                    write(52, 1);
                    write(51, limit.skips.into());
                }
                if self.regions {
                    write(41, left);
                    write(42, top);
                    write(43, right);
                    write(44, bottom);
                }
            }
            Model::Dvxplorer => {
                let mut write = |parameter, value| {
                    writes.push((Register::new(Module::Chip, parameter), value & 0xff)).ok();
                };
                // The cropper is passed by while it is set; rows go by groups of eight.
                write(0x3300, 1);
                write(0x3305, left >> 8);
                write(0x3306, left);
                write(0x3307, right >> 8);
                write(0x3308, right);
                write(0x3301, top / 8);
                write(0x3302, 0xff);
                write(0x3303, bottom / 8);
                write(0x3304, 0xff);
                write(0x3300, 0);
            }
        }
        writes
    }
}

/// The middle of the array, with sides of so many 256ths. Whole groups of eight rows.
fn middle(array: Geometry, side: u32) -> Roi {
    let part = |px: u16| (u32::from(px) * side / 256) as u16;
    let (width_px, height_px) = (part(array.width_px).max(1), part(array.height_px).max(1));
    let x = (array.width_px - width_px) / 2;
    let y = (array.height_px - height_px) / 2 / 8 * 8;
    Roi { x, y, width_px, height_px }
}

/// Watches the rate, and says when the limit is to change.
#[derive(Debug)]
pub(super) struct Governor {
    most_ev_s: u32,
    steps: Vec<Limit, 4>,
    step: usize,
    since: Instant,
    from: u64,
    calm: u32,
}

impl Governor {
    /// For a camera, behind so many events that came before.
    pub fn new(abilities: &Abilities, most_ev_s: u32, events: u64) -> Self {
        Self {
            most_ev_s,
            steps: abilities.steps(),
            step: 0,
            since: Instant::now(),
            from: events,
            calm: 0,
        }
    }

    /// What holds now.
    pub fn limit(&self) -> Limit {
        self.steps.get(self.step).copied().unwrap_or_default()
    }

    /// Whether the rate is to be looked at again: ten times a second.
    pub fn is_due(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.since) >= WINDOW
    }

    /// Takes in how many events came so far, or were lost for want of room; the new limit, when it is another. To be called when it
    /// is due.
    pub fn update(&mut self, now: Instant, events: u64) -> Option<Limit> {
        let took_us = now.saturating_duration_since(self.since).as_micros().max(1);
        let rate_ev_s = events.saturating_sub(self.from).saturating_mul(1_000_000) / took_us;
        (self.since, self.from) = (now, events);
        let most_ev_s = u64::from(self.most_ev_s);
        // A step back about doubles the rate.
        self.calm = if rate_ev_s < most_ev_s * 2 / 5 { self.calm + 1 } else { 0 };
        if rate_ev_s > most_ev_s && self.step + 1 < self.steps.len() {
            self.step += 1;
        } else if self.calm >= CALM && self.step > 0 {
            self.step -= 1;
        } else {
            return None;
        }
        self.calm = 0;
        Some(self.limit())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    const DAVIS: Abilities = Abilities {
        model: Model::Davis346,
        array: Model::Davis346.geometry(),
        skips: true,
        regions: true,
    };

    #[test]
    fn more_than_can_be_used_is_left_out_step_by_step_and_let_in_again() {
        let mut governor = Governor::new(&DAVIS, 1_000_000, 5_000_000);
        let mut now = governor.since;
        let mut events = 5_000_000;
        let mut run = |rate_ev_s: u64, windows: u32| -> Vec<(u32, Limit)> {
            (0..windows)
                .filter_map(|window| {
                    now += WINDOW;
                    events += rate_ev_s / 10;
                    Some((window, governor.update(now, events)?))
                })
                .collect()
        };
        assert_eq!(run(1_000_000, 50), []);
        let changes = run(1_200_000, 5);
        let regions: Vec<_> =
            changes.iter().map(|(at, limit)| (*at, limit.skips, limit.region)).collect();
        let half = Roi { x: 51, y: 32, width_px: 244, height_px: 183 };
        let quarter = Roi { x: 86, y: 64, width_px: 173, height_px: 130 };
        assert_eq!(regions, [(0, true, None), (1, true, Some(half)), (2, true, Some(quarter))]);
        assert_eq!(run(600_000, 100), [], "a step back would be too much again");
        let back = run(300_000, 100);
        assert_eq!(back.iter().map(|(at, _)| *at).collect::<Vec<_>>(), [29, 59, 89]);
        assert_eq!(back.last().map(|(_, limit)| *limit), Some(Limit::NONE));
    }

    #[test]
    fn filters_that_a_camera_lacks_are_not_written() {
        let bare = Abilities { skips: false, regions: false, ..DAVIS };
        assert_eq!(bare.steps(), [Limit::NONE]);
        assert!(bare.writes(&Limit::NONE).is_empty());
        let whole = DAVIS.writes(&Limit::NONE);
        let values: Vec<_> = whole.iter().map(|(at, value)| (at.parameter, *value)).collect();
        assert_eq!(values, [(52, 1), (51, 0), (41, 0), (42, 0), (43, 345), (44, 259)]);
    }
}

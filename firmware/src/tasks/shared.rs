//! What tasks of different priority share: bounded channels and single values, nothing else.

use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use evtach_core::{Reading, Roi};

use crate::instrument::Picture;
use crate::scpi::Fate;
use crate::sensor::Standing;

/// Readings on their way to the instrument: at 20 a second, a tenth of a second.
const READINGS: usize = 2;

/// The tasks that must show that they are alive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u32)]
pub enum Task {
    /// Reads the sensor.
    Acquire = 1,
    /// Measures.
    Measure = 2,
    /// Talks over the port.
    Link = 4,
}

impl Task {
    const ALL: [Self; 3] = [Self::Acquire, Self::Measure, Self::Link];

    /// Its name in a fault's words.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Acquire => "acquire",
            Self::Measure => "measure",
            Self::Link => "link",
        }
    }
}

/// What the measurement is to look at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Blades, where a person knows them.
    pub blades: Option<u8>,
    /// Part of the sensor.
    pub roi: Option<Roi>,
    /// Length of the window in microseconds.
    pub window_us: Option<u32>,
}

/// Everything between the tasks but the blocks of events.
pub struct Shared {
    standing: Mutex<CriticalSectionRawMutex, Cell<Standing>>,
    /// Events that were handed on, but are in no window that was measured.
    late: Mutex<CriticalSectionRawMutex, Cell<u64>>,
    pub(super) readings: Channel<CriticalSectionRawMutex, Reading, READINGS>,
    pub(super) dropped: AtomicU32,
    /// The last that was asked for. No `Signal`, here nor below: that is not all zeros at the start, and would have the flash hold a
    /// copy of all this.
    wanted: Channel<CriticalSectionRawMutex, Wanted, 1>,
    /// A picture to be taken, and one that has been.
    pub(super) blank: Channel<CriticalSectionRawMutex, &'static mut Picture, 1>,
    pub(super) taken: Channel<CriticalSectionRawMutex, &'static mut Picture, 1>,
    /// A person has asked for something, and wants to see it.
    pub(super) touched: Channel<CriticalSectionRawMutex, (), 1>,
    alive: AtomicU32,
}

impl Default for Shared {
    fn default() -> Self {
        Self::new()
    }
}

impl Shared {
    /// Nothing has happened yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            standing: Mutex::new(Cell::new(Standing::NONE)),
            late: Mutex::new(Cell::new(0)),
            readings: Channel::new(),
            dropped: AtomicU32::new(0),
            wanted: Channel::new(),
            blank: Channel::new(),
            taken: Channel::new(),
            touched: Channel::new(),
            alive: AtomicU32::new(0),
        }
    }

    /// Lends the memory of the picture that goes back and forth between measuring and showing.
    pub fn lend(&self, picture: &'static mut Picture) {
        self.blank.try_send(picture).ok();
    }

    /// What the measurement is to look at from now on, whatever was asked before.
    pub(super) fn want(&self, wanted: Wanted) {
        self.wanted.clear();
        self.wanted.try_send(wanted).ok();
    }

    /// What the measurement is to look at, when that is new.
    pub(super) fn take_wanted(&self) -> Option<Wanted> {
        self.wanted.try_receive().ok()
    }

    /// How acquisition stands: told by the acquiring task, which is alive then.
    pub fn tell(&self, standing: Standing) {
        self.standing.lock(|cell| cell.set(standing));
        self.alive(Task::Acquire);
    }

    /// How acquisition stands.
    #[must_use]
    pub fn standing(&self) -> Standing {
        self.standing.lock(Cell::get)
    }

    /// How many events were handed on so far that are in no window that was measured: told by the measuring task.
    pub(super) fn tell_late(&self, events: u64) {
        self.late.lock(|cell| cell.set(events));
    }

    /// What became of all events so far.
    #[must_use]
    pub(super) fn fate(&self) -> Fate {
        let Standing { received, thinned, left_out, lost_before, overrun, .. } = self.standing();
        // Acquiring tells what it handed on a moment after measuring may have told what became of it.
        let handed_on = received.saturating_sub(thinned);
        let late = self.late.lock(Cell::get).min(handed_on);
        Fate { used: handed_on - late, thinned: thinned + left_out, late, lost_before, overrun }
    }

    /// A task says that it is alive.
    pub fn alive(&self, task: Task) {
        self.alive.fetch_or(task as u32, Ordering::Relaxed);
    }

    /// Whether every task has said so since the last time that all had.
    pub fn all_alive(&self) -> bool {
        let all = Task::ALL.iter().fold(0, |all, task| all | *task as u32);
        let alive = self.alive.load(Ordering::Relaxed) == all;
        if alive {
            self.alive.store(0, Ordering::Relaxed);
        }
        alive
    }

    /// The first task that has not, for the words of a fault.
    #[must_use]
    pub fn missing(&self) -> Option<Task> {
        let alive = self.alive.load(Ordering::Relaxed);
        Task::ALL.into_iter().find(|task| alive & *task as u32 == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_event_has_one_fate() {
        let shared = Shared::new();
        let fate = |received, thinned, late| {
            let (left_out, lost_before, overrun) = (50, 30, 4);
            shared.tell(Standing {
                received,
                thinned,
                left_out,
                lost_before,
                overrun,
                ..Standing::NONE
            });
            shared.tell_late(late);
            let Fate { used, thinned, late, lost_before, overrun } = shared.fate();
            assert_eq!(used + thinned + late, received + left_out, "used, thinned or late");
            assert_eq!((lost_before, overrun), (30, 4), "what was lost did not come");
            (used, thinned, late)
        };
        assert_eq!(fate(0, 0, 0), (0, 50, 0));
        assert_eq!(fate(1000, 600, 0), (400, 650, 0));
        assert_eq!(fate(1000, 600, 150), (250, 650, 150));
        // Told before what came was.
        assert_eq!(fate(1000, 600, 410), (0, 650, 400));
    }
}

//! What the measurement costs, stage by stage, counted where it runs.

use core::fmt;

use evtach_core::{PackedEvent, Poll, Tachometer};
use heapless::LinearMap;

/// A counter of time or of instructions.
pub trait Clock {
    /// Whether it counts at all: where it does not, nothing is kept.
    const COUNTS: bool = true;

    /// Ticks since some moment; what a tick is, the board says.
    fn ticks(&self) -> u64;
}

/// Neither a PC nor the device counts.
impl Clock for () {
    const COUNTS: bool = false;

    fn ticks(&self) -> u64 {
        0
    }
}

/// Ticks spent between two readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Spent {
    /// Taking in events.
    pub push: u64,
    /// Measuring.
    pub poll: u64,
}

/// What one stage of the measurement has cost so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StageCost {
    /// Pieces of the measurement.
    pub polls: u32,
    /// Ticks in the longest.
    pub longest: u32,
    /// Ticks in all of them.
    pub ticks: u64,
}

impl StageCost {
    fn add(&mut self, ticks: u64) {
        self.polls = self.polls.saturating_add(1);
        self.ticks += ticks;
        self.longest = self.longest.max(u32::try_from(ticks).unwrap_or(u32::MAX));
    }
}

/// Stages told apart.
const STAGES: usize = 20;

/// Costs counted around the calls into the tachometer.
#[derive(Debug)]
pub struct Costs<C> {
    clock: C,
    stages: LinearMap<&'static str, StageCost, STAGES>,
    pushed: u64,
    push: StageCost,
    spent: Spent,
}

impl<C: Clock> Costs<C> {
    /// Nothing spent yet.
    pub const fn new(clock: C) -> Self {
        let none = StageCost { polls: 0, ticks: 0, longest: 0 };
        let spent = Spent { push: 0, poll: 0 };
        Self { clock, stages: LinearMap::new(), pushed: 0, push: none, spent }
    }

    /// Pushes events, the first of them of the time `first_us` in microseconds, each standing for 2^`weight_log2`. Not
    /// inlined, so that there is one of it however many tasks measure.
    #[inline(never)]
    pub fn push(
        &mut self,
        tachometer: &mut Tachometer<'_>,
        first_us: u64,
        events: &[PackedEvent],
        weight_log2: u8,
    ) {
        let start = self.clock.ticks();
        tachometer.push_thinned(first_us, events, weight_log2);
        if !C::COUNTS {
            return;
        }
        let ticks = self.clock.ticks() - start;
        self.push.add(ticks);
        self.pushed += events.len() as u64;
        self.spent.push += ticks;
    }

    /// Polls once. Not inlined, for the same reason.
    #[inline(never)]
    pub fn poll(&mut self, tachometer: &mut Tachometer<'_>, steps: u32) -> Poll {
        if !tachometer.is_measuring() {
            // After nearly every block of events: telling the time would cost more than the answer.
            return Poll::Idle;
        }
        if !C::COUNTS {
            return tachometer.poll(steps);
        }
        let stage = tachometer.stage();
        let start = self.clock.ticks();
        let poll = tachometer.poll(steps);
        let ticks = self.clock.ticks() - start;
        if self.stages.get(&stage).is_none() {
            // With more names than places the rest goes uncounted by stage; the sum still holds.
            self.stages.insert(stage, StageCost::default()).ok();
        }
        if let Some(cost) = self.stages.get_mut(&stage) {
            cost.add(ticks);
        }
        self.spent.poll += ticks;
        poll
    }

    /// What was spent since this was last asked.
    pub fn take_spent(&mut self) -> Spent {
        core::mem::take(&mut self.spent)
    }
}

/// One line for intake, one for each stage.
impl<C> fmt::Display for Costs<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let StageCost { polls, ticks, longest } = self.push;
        writeln!(f, "push events={} calls={polls} ticks={ticks} longest={longest}", self.pushed)?;
        for (name, StageCost { polls, ticks, longest }) in &self.stages {
            // The name stands last, because it may hold spaces.
            writeln!(f, "stage calls={polls} ticks={ticks} longest={longest} name={name}")?;
        }
        Ok(())
    }
}

//! Which rounds the pose is found in, and what each looks at.

/// Corrections that move the rim by less than this, in pixels, are the last of their phase.
pub const SETTLED_PX: f32 = 0.3;

/// Phases, each with more of the window's detail than the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// A path of few blocks.
    First,
    /// One of some more.
    Second,
    /// As many blocks as a sample of the events allows; the harmonic is raised as far as it goes.
    Fine,
    /// As many as all events allow.
    All,
    /// One more look gives the trend.
    Last,
}

/// Rounds at most, and events, of each phase.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    phase: Phase,
    /// Rounds of this phase so far.
    round: u8,
    /// Most rounds by phase.
    most: [u8; 4],
    /// Events looked at before [`Phase::All`], and the share of all events, and the most, that are looked at from then on.
    first_events: usize,
    share: usize,
    most_events: usize,
    /// Whether to ask where polarities are the other way round.
    sides: bool,
    /// Whether a rotor is followed that a hand moved.
    follows_hand: bool,
}

/// Most events of a rotor that was followed that are looked at: a PC keeps up with twenty readings a second of it.
const MOST_FOLLOWED: usize = 65_536;
/// Rounds of a later phase at most while each moves the path far.
const MOST_ROUNDS: u8 = 6;
/// Blocks of the path in the first two phases.
const FIRST_BLOCKS: usize = 12;
const SECOND_BLOCKS: usize = 24;

impl Schedule {
    /// For a rotor of which little is known.
    pub const NEW: Self = Self {
        phase: Phase::First,
        round: 0,
        most: [3, 1, 6, 3],
        first_events: 3_072,
        share: 1,
        most_events: usize::MAX,
        sides: true,
        follows_hand: false,
    };
    /// For a rotor that was followed in the window before: a third of the events tell it as well. A path that starts where it was is
    /// not led astray by its sides.
    pub const KNOWN: Self = Self {
        most: [1, 0, 2, 1],
        first_events: 1_280,
        share: 3,
        most_events: MOST_FOLLOWED,
        sides: false,
        ..Self::NEW
    };

    /// The same for one that a hand moved meanwhile, which is known by its parts alone; and by its sides, where it has any.
    pub const fn moved(sides: bool) -> Self {
        Self { most: [1, 1, 4, 1], sides, follows_hand: true, ..Self::KNOWN }
    }

    /// The phase that the next round belongs to.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// Whether the path has had as many blocks as in [`Phase::Fine`] for a round.
    pub fn is_fine(&self) -> bool {
        self.phase > Phase::Fine || self.phase == Phase::Fine && self.round > 0
    }

    /// Whether several rounds look at all events, as where little is known of the rotor, and the next is one of them.
    pub fn learns(&self) -> bool {
        self.phase == Phase::All && self.most[Phase::All as usize] > 1
    }

    /// Whether this round asks where polarities are the other way round: a sample of the events tells it once the rotor is known.
    pub fn asks_sides(&self) -> bool {
        self.sides && (self.samples() || self.learns())
    }

    /// Asks no more.
    pub const fn ask_no_sides(&mut self) {
        self.sides = false;
    }

    /// Whether the first of these is next: it learns the template anew.
    pub fn reaches_out(&self) -> bool {
        self.learns() && self.round == 0
    }

    /// The template has to be learnt anew: the last phase that corrects the path begins again, if it has begun.
    pub const fn again(&mut self) {
        if matches!(self.phase, Phase::All | Phase::Last) {
            self.phase = Phase::All;
            self.round = 0;
            // One learns, and what it learns is to correct the path, too.
            self.most = Self::NEW.most;
        }
    }

    /// Whether this round looks at a sample of the events only.
    pub fn samples(&self) -> bool {
        self.phase < Phase::All
    }

    /// Ends a round that moved the rim by so much, `under_way` as far as one can; `true` when a new phase begins.
    pub fn advance(&mut self, moved_px: f32, under_way: bool) -> bool {
        self.round += 1;
        let most = self.most.get(self.phase as usize).copied().unwrap_or(0);
        // A motor that hunts is far from what was known of it.
        let farther = under_way && self.phase >= Phase::Fine;
        let most = if farther { most.max(MOST_ROUNDS) } else { most };
        // In the first fine round the harmonic is not raised yet.
        let settled = moved_px < SETTLED_PX && (self.phase != Phase::Fine || self.round > 1);
        if !settled && self.round < most {
            return false;
        }
        self.round = 0;
        self.phase = match self.phase {
            Phase::First if self.most[1] > 0 => Phase::Second,
            Phase::First => Phase::Fine,
            Phase::Second => Phase::Fine,
            Phase::Fine => Phase::All,
            Phase::All | Phase::Last => Phase::Last,
        };
        true
    }

    /// Whether a rotor is followed that a hand moved meanwhile.
    pub const fn follows_hand(&self) -> bool {
        self.follows_hand
    }

    /// Events that this round looks at, at most, of so many.
    pub fn events(&self, all: usize) -> usize {
        if self.samples() {
            self.first_events
        } else {
            (all / self.share).clamp(self.first_events, self.most_events)
        }
    }

    /// Most blocks of the path in this phase.
    pub const fn blocks(&self) -> usize {
        match self.phase {
            Phase::First => FIRST_BLOCKS,
            Phase::Second => SECOND_BLOCKS,
            Phase::Fine | Phase::All | Phase::Last => usize::MAX,
        }
    }
}

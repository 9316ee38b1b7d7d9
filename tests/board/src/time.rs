//! Virtual time in picoseconds: fine enough for the processor's clock, long enough for half a year.

use std::cell::Cell;

/// Picoseconds in a microsecond.
pub const US: u64 = 1_000_000;
/// Picoseconds in a millisecond.
pub const MS: u64 = 1000 * US;
/// Picoseconds in a second.
pub const S: u64 = 1000 * MS;
/// Later than anything that happens.
pub const NEVER: u64 = u64::MAX;

/// Kinds of code that instructions are counted by: 0 is thread mode, the others are exception numbers.
pub const LEVELS: usize = 16 + 98;

/// What the hooks of the engine and the board share: where time stands, and when to stop.
///
/// Cells, because the engine's hooks run in the middle of everything else.
pub struct Pulse {
    /// Time now.
    pub now: Cell<u64>,
    /// When something of the board is due.
    pub due: Cell<u64>,
    /// An exception waits that the priorities let through; the masks have to be looked at.
    pub pending: Cell<bool>,
    /// The block that starts must not run: something has to be looked at first.
    pub attention: Cell<bool>,
    /// Time that an instruction takes.
    pub instruction_ps: Cell<u64>,
    /// Number of the exception whose handler runs.
    pub level: Cell<usize>,
    /// Instructions carried out, by [`Pulse::level`].
    pub instructions: Vec<Cell<u64>>,
}

impl Default for Pulse {
    fn default() -> Self {
        Self {
            now: Cell::new(0),
            due: Cell::new(0),
            pending: Cell::new(false),
            attention: Cell::new(false),
            instruction_ps: Cell::new(0),
            level: Cell::new(0),
            instructions: vec![Cell::new(0); LEVELS],
        }
    }
}

impl Pulse {
    /// Accounts for instructions.
    pub fn spend(&self, instructions: u64) {
        self.now.set(self.now.get() + instructions * self.instruction_ps.get());
        let counter = &self.instructions[self.level.get()];
        counter.set(counter.get() + instructions);
    }

    /// Lets time pass in which no instruction is carried out.
    pub fn wait(&self, instructions: u64) {
        self.now.set(self.now.get() + instructions * self.instruction_ps.get());
    }
}

//! A search in parts, one in a window, where all of it would take longer than the next window lasts to come: a part is one
//! spectrum, and a look at one line of it.

use super::Extraction;
use crate::rotors::heat::CellGrid;

/// How far a search has got that goes on in a later window.
#[derive(Clone, Copy, Debug, Default)]
pub struct Round {
    /// Quarter that comes next, 0 = all of the picture, and its cells, as a power of two; 0 = not chosen yet.
    quarter: u8,
    cell_log2: u8,
    /// What is kept of what was searched so far: see [`Extraction`].
    finer: bool,
    least_log2: u8,
    looks: u8,
    quarter_looks: u8,
}

impl Round {
    /// Whether nothing of it has been searched yet.
    pub const fn begins(&self) -> bool {
        self.quarter == 0 && self.looks == 0
    }
}

impl Extraction {
    /// The next part of a search that goes on where another ended.
    pub fn go_on(round: Round) -> Self {
        let Round { quarter, cell_log2, finer, least_log2, looks, quarter_looks } = round;
        Self {
            in_parts: true,
            quarter: quarter.into(),
            cell_log2,
            finer,
            least_log2,
            looks: looks.into(),
            quarter_looks: quarter_looks.into(),
            ..Self::default()
        }
    }

    /// Where the next part begins.
    pub const fn round(&self) -> Round {
        Round {
            quarter: self.quarter as u8,
            cell_log2: self.grid.cell_log2,
            finer: self.finer,
            least_log2: self.least_log2,
            looks: self.looks as u8,
            quarter_looks: self.quarter_looks as u8,
        }
    }

    /// What comes next begins with all of the picture again.
    pub(super) fn begin_round(&mut self) {
        (self.quarter, self.least_log2, self.looks, self.quarter_looks) = (0, 0, 0, 0);
        self.grid = CellGrid::default();
    }

    /// Leaves out the highest lines: windows before this one have had a look at those.
    pub(super) fn leave_out_lines(&mut self) {
        if self.in_parts {
            let looks = if self.quarter == 0 { self.looks } else { self.quarter_looks };
            // The highest comes last.
            self.lines.truncate(self.lines.len().saturating_sub(looks));
        }
    }
}

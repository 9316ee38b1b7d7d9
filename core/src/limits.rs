//! Every capacity in one place, with its cost in bytes.

/// Rotors in one reading.
pub const MAX_ROTORS: usize = 8;

/// Most blades that a person may state: more do not get rings of their own.
pub const MOST_STATED_BLADES: u8 = 32;

/// Events in the device's store: 16 384 x 8 B = 128 KiB.
pub const DEVICE_EVENTS: usize = 16_384;

/// Heat map cells on the device: 6 400 x 2 B = 12.5 KiB; 80 x 80 cells of 4 px cover a 320x320 sensor, 87 x 65 a 346x260 one.
pub const DEVICE_HEAT_CELLS: usize = 6_400;

/// Largest k that K-means tries.
pub const MAX_CLUSTERS: usize = 8;

/// Lines of the spectrum that are looked into: each costs a map.
pub const MAX_LINES: usize = 16;

/// Cells of the search: 6 400 x 2 B = 12.5 KiB; 80 x 80 cells of 4 px cover a 320x320 sensor.
pub const VISIT_CELLS: usize = 6_400;

/// Events of the search: 6 144 x 2 B = 12 KiB.
pub const VISITS: usize = 6_144;

/// Events of one rotor in polar coordinates: 3 072 x 8 B = 24 KiB.
pub const POLAR_EVENTS: usize = 3_072;

/// Most cells in a row of the coherence map, which covers the square around a disc.
pub const COHERENCE_COLUMNS: usize = 24;
/// Cells of the coherence map: 576 x 20 B = 11 KiB.
pub const COHERENCE_CELLS: usize = COHERENCE_COLUMNS * COHERENCE_COLUMNS;

/// Phasors in one look for a winding: 128 x 24 B = 3 KiB.
pub const WINDING_PHASORS: usize = 128;

/// Events in a slice for registration: 2 x 512 x 16 B = 16 KiB.
pub const SLICE_POINTS: usize = 512;

/// Side of the nearest-neighbour grid in cells, about as many as a slice has points of a polarity: 2 x 24 x 24 x 2 B = 2.3 KiB.
pub const GRID_CELLS_SIDE: usize = 24;

/// Largest blade count that is named; more are measured, but not counted.
pub const MAX_BLADES: u8 = 8;

/// Slice pairs at one baseline.
pub const MAX_PAIRS: usize = 128;

/// Rotors by every line before the choice: 20 x 36 B.
pub const MAX_CANDIDATES: usize = 20;

/// Of these, those that are measured in one window at most: 12 x 48 B.
pub const MAX_SUSPECTS: usize = 12;

/// Knots of a rotor's path through the window: 64 x 12 B.
pub const MAX_KNOTS: usize = 64;

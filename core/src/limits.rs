//! Every capacity in one place, with its cost in bytes.

/// Rotors in one reading.
pub const MAX_ROTORS: usize = 8;

/// Events in the device's store: 16 384 x 8 B = 128 KiB.
pub const DEVICE_EVENTS: usize = 16_384;

/// Heat map cells on the device: 6 400 x 2 B = 12.5 KiB; 80 x 80 cells of 4 px cover a 320x320 sensor, 87 x 65 a 346x260 one.
pub const DEVICE_HEAT_CELLS: usize = 6_400;

/// Largest k that K-means tries.
pub const MAX_CLUSTERS: usize = 8;

/// Lines of the spectrum that are looked into: each costs a coherence map.
pub const MAX_LINES: usize = 16;

/// Events of one rotor in polar coordinates: 3 072 x 8 B = 24 KiB.
pub const POLAR_EVENTS: usize = 3_072;

/// Time bins of the scan: 1 024 x 8 B = 8 KiB. 150 ms / 1 024 = 146 us, Nyquist limit 3.4 kHz.
pub const SCAN_BINS: usize = 1_024;

/// Cells of the coherence map: 1 536 x 20 B = 30 KiB; 44 x 33 cells of 8 px cover a 346x260 sensor.
pub const COHERENCE_CELLS: usize = 1_536;

/// Phasors in one look for a winding: 128 x 24 B = 3 KiB.
pub const WINDING_PHASORS: usize = 128;

/// Events in a slice for registration: 2 x 512 x 16 B = 16 KiB.
pub const SLICE_POINTS: usize = 512;

/// Side of the nearest-neighbour grid in cells: 40 x 40 x 2 B = 3.1 KiB.
pub const GRID_CELLS_SIDE: usize = 40;

/// Largest blade count that is named; more are measured, but not counted.
pub const MAX_BLADES: u8 = 8;

/// Slice pairs at one baseline.
pub const MAX_PAIRS: usize = 16;

/// Rotors by every line before the choice: 20 x 32 B.
pub const MAX_CANDIDATES: usize = 20;

/// Of these, those that are measured in one window at most: 12 x 36 B.
pub const MAX_SUSPECTS: usize = 12;

/// Knots of a rotor's path through the window: 64 x 12 B.
pub const MAX_KNOTS: usize = 64;

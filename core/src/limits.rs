//! Every capacity in one place, with its cost in bytes.

/// Rotors in one reading.
pub const MAX_ROTORS: usize = 8;

/// Events in the device's store: 16 384 x 8 B = 128 KiB.
pub const DEVICE_EVENTS: usize = 16_384;

/// Heat map cells on the device: 6 400 x 2 B = 12.5 KiB; 80 x 80 cells of 4 px cover a 320x320 sensor, 87 x 65 a 346x260 one.
pub const DEVICE_HEAT_CELLS: usize = 6_400;

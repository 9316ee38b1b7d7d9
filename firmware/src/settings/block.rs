//! The block of preferences, little-endian:
//!
//! | byte | field |
//! |---|---|
//! | 0 | generation of the layout: 1 |
//! | 1 | unit: 0 rpm, 1 Hz, 2 rad/s, 3 ms |
//! | 2 | blades, 0: found |
//! | 3 | bit 0: lower limit set, bit 1: upper limit set |
//! | 4 | lower limit in rpm, f32 |
//! | 8 | upper limit in rpm, f32 |
//! | 12 | clock trim in ppm, f32 |
//!
//! A later firmware may add fields at the end: an older one passes over them, and where they are missing, the newer one takes
//! their defaults. What cannot be understood that way counts up the generation, and other generations are refused. A
//! layout by hand, because its bytes are a contract with every firmware to come, and a serialiser's are not.

use crate::instrument::{Alarm, MAX_BLADES, MAX_TRIM_PPM, Preferences, Unit};

/// Bytes of a block as it is written here.
pub const BLOCK_BYTES: usize = 16;

const GENERATION: u8 = 1;
const LOW: u8 = 1;
const HIGH: u8 = 2;

/// Why a block is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BlockError {
    /// There is not even a generation.
    #[error("the block of preferences is empty: set them again")]
    Empty,
    /// Another firmware wrote it.
    #[error("preferences of generation {0}, not 1: update the firmware, or set them again")]
    Generation(u8),
    /// A field holds what none may.
    #[error("byte {byte} of the preferences is out of range: set them again")]
    Range {
        /// Where the field begins.
        byte: u8,
    },
}

/// The block of these preferences.
#[must_use]
pub fn encode(preferences: &Preferences) -> [u8; BLOCK_BYTES] {
    let Preferences { unit, alarm: Alarm { low_rpm, high_rpm }, blades, clock_trim_ppm } =
        *preferences;
    let unit = match unit {
        Unit::Rpm => 0,
        Unit::Hertz => 1,
        Unit::RadPerS => 2,
        Unit::MsPerTurn => 3,
    };
    let blades = blades.unwrap_or(0);
    let flags = low_rpm.map_or(0, |_| LOW) | high_rpm.map_or(0, |_| HIGH);
    let [l0, l1, l2, l3] = low_rpm.unwrap_or(0.0).to_le_bytes();
    let [h0, h1, h2, h3] = high_rpm.unwrap_or(0.0).to_le_bytes();
    let [c0, c1, c2, c3] = clock_trim_ppm.to_le_bytes();
    [GENERATION, unit, blades, flags, l0, l1, l2, l3, h0, h1, h2, h3, c0, c1, c2, c3]
}

/// The preferences of a block.
///
/// # Errors
/// When it is of another generation, or a field is out of range.
pub fn decode(bytes: &[u8]) -> Result<Preferences, BlockError> {
    let (&generation, fields) = bytes.split_first().ok_or(BlockError::Empty)?;
    if generation != GENERATION {
        return Err(BlockError::Generation(generation));
    }
    // Fields that are not there are zero, which stands for the default of each.
    let mut block = [0; BLOCK_BYTES - 1];
    block.iter_mut().zip(fields).for_each(|(byte, field)| *byte = *field);
    let [unit, blades, flags, l0, l1, l2, l3, h0, h1, h2, h3, c0, c1, c2, c3] = block;
    let range = |byte| BlockError::Range { byte };
    let limit = |flag, bytes, byte| {
        let rpm = f32::from_le_bytes(bytes);
        match flags & flag != 0 {
            false => Ok(None),
            true if rpm > 0.0 && rpm.is_finite() => Ok(Some(rpm)),
            true => Err(range(byte)),
        }
    };
    let clock_trim_ppm = f32::from_le_bytes([c0, c1, c2, c3]);
    Ok(Preferences {
        unit: match unit {
            0 => Unit::Rpm,
            1 => Unit::Hertz,
            2 => Unit::RadPerS,
            3 => Unit::MsPerTurn,
            _ => return Err(range(1)),
        },
        blades: match blades {
            0 => None,
            1..=MAX_BLADES => Some(blades),
            _ => return Err(range(2)),
        },
        alarm: Alarm {
            low_rpm: limit(LOW, [l0, l1, l2, l3], 4)?,
            high_rpm: limit(HIGH, [h0, h1, h2, h3], 8)?,
        },
        clock_trim_ppm: if (-MAX_TRIM_PPM..=MAX_TRIM_PPM).contains(&clock_trim_ppm) {
            clock_trim_ppm
        } else {
            return Err(range(12));
        },
    })
}

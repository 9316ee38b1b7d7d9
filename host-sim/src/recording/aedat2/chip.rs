//! What the bits of an address mean for each camera (jAER's `AEChip` classes).

use evtach_core::{Geometry, Polarity};

/// Families of address layouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// 15 bits: y, x, polarity; bit 15 marks external events.
    Dvs128,
    /// 32 bits: y, x, polarity, with samples of frames and of the inertial sensor among them.
    Davis,
}

/// What an address stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Address {
    /// A pixel as stored: jAER counts columns from the right and rows from the bottom.
    Pixel { column: u16, row: u16, polarity: Polarity },
    /// One of the seven words of an inertial sample: which, and its value.
    Imu { index: usize, value: i16 },
    /// A frame's sample, a trigger.
    Other,
}

/// Layout and size for the name in an `AEChip` line.
pub fn of_name(name: &str) -> Option<(Layout, Geometry)> {
    let name = name.to_ascii_lowercase();
    let (layout, width_px, height_px) = [
        ("davis128", Layout::Davis, 128, 128),
        ("davis208", Layout::Davis, 208, 192),
        ("davis240", Layout::Davis, 240, 180),
        ("davis346", Layout::Davis, 346, 260),
        ("davis640", Layout::Davis, 640, 480),
        ("sbret10", Layout::Davis, 240, 180),
        ("dvs128", Layout::Dvs128, 128, 128),
        ("tmpdiff128", Layout::Dvs128, 128, 128),
    ]
    .into_iter()
    .find_map(|(chip, layout, width, height)| {
        name.contains(chip).then_some((layout, width, height))
    })?;
    Some((layout, Geometry::new(width_px, height_px)?))
}

impl Layout {
    /// Splits an address.
    #[inline]
    pub const fn split(self, address: u32) -> Address {
        match self {
            Self::Dvs128 if address & 0x8000 != 0 => Address::Other,
            Self::Dvs128 => Address::Pixel {
                column: ((address >> 1) & 0x7f) as u16,
                row: ((address >> 8) & 0x7f) as u16,
                // This chip alone sends 0 for brighter.
                polarity: if address & 1 == 0 { Polarity::On } else { Polarity::Off },
            },
            Self::Davis => match (address >> 31, (address >> 10) & 3) {
                (0, 0 | 2) => Address::Pixel {
                    column: ((address >> 12) & 0x3ff) as u16,
                    row: ((address >> 22) & 0x1ff) as u16,
                    polarity: if address & 0x800 == 0 { Polarity::Off } else { Polarity::On },
                },
                (1, 3) => Address::Imu {
                    index: ((address >> 28) & 7) as usize,
                    value: ((address >> 12) & 0xffff) as u16 as i16,
                },
                _ => Address::Other,
            },
        }
    }
}

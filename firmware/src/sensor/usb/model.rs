//! The cameras that are known, and what sets them apart.

use evtach_core::Geometry;

use super::registers::{Module, Register};
use super::start::{self, Step};
use super::trouble::Trouble;

/// A camera that is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Model {
    /// iniVation DAVIS346: 346x260 pixels, with a gyro.
    Davis346,
    /// iniVation DVXplorer: 640x480 pixels, with a gyro.
    Dvxplorer,
}

/// Of the vendor's numbers.
const INIVATION: u16 = 0x152a;

/// The logic that the start-up order is documented for.
const LOGIC: u32 = 18;
/// Version of the logic, and its patch level.
const LOGIC_VERSION: Register = Register::new(Module::System, 0);
const LOGIC_PATCH: Register = Register::new(Module::System, 7);

impl Model {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Davis346, Self::Dvxplorer];

    /// The camera of these numbers.
    #[must_use]
    pub fn from_ids(vendor_id: u16, product_id: u16) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|model| (model.vendor_id(), model.product_id()) == (vendor_id, product_id))
    }

    /// Its maker's number.
    #[must_use]
    pub const fn vendor_id(self) -> u16 {
        INIVATION
    }

    /// Its number among the maker's.
    #[must_use]
    pub const fn product_id(self) -> u16 {
        match self {
            Self::Davis346 => 0x841a,
            Self::Dvxplorer => 0x8419,
        }
    }

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Davis346 => "DAVIS346",
            Self::Dvxplorer => "DVXplorer",
        }
    }

    /// Its pixels, unless it says otherwise.
    #[must_use]
    pub const fn geometry(self) -> Geometry {
        match self {
            Self::Davis346 => Geometry { width_px: 346, height_px: 260 },
            Self::Dvxplorer => Geometry { width_px: 640, height_px: 480 },
        }
    }

    /// Oldest firmware of its USB controller that is known to work: low byte of the device release number.
    #[must_use]
    pub const fn oldest_firmware(self) -> u8 {
        match self {
            Self::Davis346 => 6,
            Self::Dvxplorer => 8,
        }
    }

    /// Oldest patch level of logic 18 that is known to work.
    #[must_use]
    pub const fn oldest_patch(self) -> u32 {
        match self {
            Self::Davis346 => 1,
            Self::Dvxplorer => 2,
        }
    }

    /// Whether the camera's firmware will do.
    pub(super) const fn check_firmware(self, has: u8) -> Result<(), Trouble> {
        let needs = self.oldest_firmware();
        if has < needs { Err(Trouble::OldFirmware { model: self, has, needs }) } else { Ok(()) }
    }

    /// Whether the camera's logic will do.
    pub(super) const fn check_logic(self, version: u32, patch: u32) -> Result<(), Trouble> {
        // A later logic may have other registers.
        if version != LOGIC || patch < self.oldest_patch() {
            return Err(Trouble::OtherLogic { model: self, version, patch });
        }
        Ok(())
    }

    pub(super) const fn logic() -> (Register, Register) {
        (LOGIC_VERSION, LOGIC_PATCH)
    }

    /// Its start-up order.
    pub(super) const fn steps(self) -> &'static [Step] {
        match self {
            Self::Davis346 => start::DAVIS346,
            Self::Dvxplorer => start::DVXPLORER,
        }
    }
}

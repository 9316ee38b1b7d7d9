//! Why a USB port gives no events.

use core::fmt;

use embassy_usb_driver::host::PipeError;

use super::model::Model;
use super::registers::Register;

/// Most bytes of a trouble in words.
pub const TROUBLE_BYTES: usize = 72;

/// Why there is no camera at the port, in words for the screen: what is, and what to do.
///
/// Numbered from one, so that none of them is zeros: what begins without any then is, and takes no flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Trouble {
    /// Some other device, by the numbers of its maker and its kind.
    Foreign {
        /// Maker.
        vendor_id: u16,
        /// Kind.
        product_id: u16,
    } = 1,
    /// The firmware of the camera's USB controller is too old.
    OldFirmware {
        /// The camera.
        model: Model,
        /// What it has.
        has: u8,
        /// What it needs at least.
        needs: u8,
    },
    /// The camera's logic is another than the one whose registers are known.
    OtherLogic {
        /// The camera.
        model: Model,
        /// Version.
        version: u32,
        /// Patch level.
        patch: u32,
    },
    /// The camera speaks at full speed: the port or the cable is no good for more.
    Slow,
    /// It has no endpoint for data.
    NoData,
    /// The port gives no name of what is plugged in.
    NoAnswer,
    /// A register cannot be read or written.
    Register(Register),
    /// A register says what no camera has.
    Nonsense(Register),
    /// The data stops again and again.
    Stalled,
    /// Data comes damaged, again and again.
    Damaged,
    /// More power is drawn than the port has.
    Overcurrent,
}

impl Trouble {
    /// Whether it may go away on its own, so that the port is reset and asked again.
    #[must_use]
    pub const fn may_pass(self) -> bool {
        match self {
            Self::Foreign { .. }
            | Self::OldFirmware { .. }
            | Self::OtherLogic { .. }
            | Self::Slow
            | Self::NoData => false,
            Self::NoAnswer
            | Self::Register(_)
            | Self::Nonsense(_)
            | Self::Stalled
            | Self::Damaged
            | Self::Overcurrent => true,
        }
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign { vendor_id, product_id } => {
                write!(
                    f,
                    "{vendor_id:04x}:{product_id:04x} is no camera known here: plug in another"
                )
            }
            Self::OldFirmware { model, has, needs } => {
                write!(
                    f,
                    "{}: firmware {has} is older than {needs}: update the camera",
                    model.name()
                )
            }
            Self::OtherLogic { model, version, patch } => {
                let least = model.oldest_patch();
                write!(
                    f,
                    "{}: logic {version}.{patch}, not 18.{least}: update the camera",
                    model.name()
                )
            }
            Self::Slow => f.write_str("the camera speaks at full speed: use a USB 2.0 cable"),
            Self::NoData => f.write_str("the camera offers no data: update the camera"),
            Self::NoAnswer => f.write_str("what is plugged in does not answer: plug it in again"),
            Self::Register(register) => {
                write!(f, "the camera does not take register {register}: plug it in again")
            }
            Self::Nonsense(register) => {
                write!(f, "the camera's register {register} makes no sense: plug it in again")
            }
            Self::Stalled => {
                f.write_str("the camera's data stops again and again: plug it in again")
            }
            Self::Damaged => f.write_str("the camera's data comes damaged: check the cable"),
            Self::Overcurrent => f.write_str("the camera draws too much current: check the cable"),
        }
    }
}

/// Why a session with a camera ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// Unplugged.
    Gone,
    /// Something else was plugged in meanwhile: the port has been reset.
    Anew(embassy_usb_driver::Speed),
    /// It will not do.
    Trouble(Trouble),
}

impl From<Trouble> for End {
    fn from(trouble: Trouble) -> Self {
        Self::Trouble(trouble)
    }
}

impl End {
    /// What a failed request for a register means.
    pub fn at(register: Register) -> impl FnOnce(PipeError) -> Self {
        move |error| match error {
            PipeError::Disconnected => Self::Gone,
            _ => Self::Trouble(Trouble::Register(register)),
        }
    }
}

//! Sensors, each behind the traits of embedded-hal or of embassy's USB host: no pin and no peripheral is named here.

pub(crate) mod outlet;
pub mod spi;
pub mod usb;

pub use outlet::Delivered;

use evtach_core::Geometry;

/// How acquisition stands, whatever the sensor: what screen and link tell of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Standing {
    /// The sensor's pixels, while it answers.
    pub geometry: Option<Geometry>,
    /// Why it does not, where something is plugged in.
    pub trouble: Option<usb::Trouble>,
    /// Sensor time that has been reached, in microseconds.
    pub latest_us: u64,
    /// Events that came, and found room.
    pub received: u64,
    /// Events that the sensor or the link lost, or that found no room.
    pub lost: u64,
}

impl Standing {
    /// Nothing has come yet.
    pub const NONE: Self =
        Self { geometry: None, trouble: None, latest_us: 0, received: 0, lost: 0 };
}

impl From<&spi::Acquired> for Standing {
    fn from(acquired: &spi::Acquired) -> Self {
        let spi::Acquired { sensor, latest_us, account, overrun, .. } = acquired;
        Self {
            geometry: sensor.map(|hello| hello.geometry),
            trouble: None,
            latest_us: *latest_us,
            received: account.received.saturating_sub(*overrun),
            lost: account.lost.total().saturating_add(*overrun),
        }
    }
}

impl From<&usb::Acquired> for Standing {
    fn from(acquired: &usb::Acquired) -> Self {
        let usb::Acquired { camera, trouble, latest_us, delivered, lost_by_camera, .. } = acquired;
        Self {
            geometry: camera.map(|camera| camera.geometry),
            trouble: *trouble,
            latest_us: *latest_us,
            received: delivered.received.saturating_sub(delivered.overrun),
            lost: delivered.overrun.saturating_add(*lost_by_camera),
        }
    }
}

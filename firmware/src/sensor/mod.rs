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
    /// Of these, left out evenly, because more waited to be measured.
    pub thinned: u64,
    /// Events that did not come, because the sensor was told to leave out as many as it sends.
    pub left_out: u64,
    /// Events that the sensor or the link lost.
    pub lost_before: u64,
    /// Events that came, and found no room.
    pub overrun: u64,
}

impl Standing {
    /// Nothing has come yet.
    pub const NONE: Self = Self {
        geometry: None,
        trouble: None,
        latest_us: 0,
        received: 0,
        thinned: 0,
        left_out: 0,
        lost_before: 0,
        overrun: 0,
    };

    /// Events lost, whatever the cause.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost_before.saturating_add(self.overrun)
    }
}

impl From<&spi::Acquired> for Standing {
    fn from(acquired: &spi::Acquired) -> Self {
        let spi::Acquired { sensor, latest_us, account, thinned, overrun, .. } = acquired;
        Self {
            geometry: sensor.map(|hello| hello.geometry),
            trouble: None,
            latest_us: *latest_us,
            received: account.received.saturating_sub(*overrun),
            thinned: *thinned,
            left_out: 0,
            lost_before: account.lost.total(),
            overrun: *overrun,
        }
    }
}

impl From<&usb::Acquired> for Standing {
    fn from(acquired: &usb::Acquired) -> Self {
        let usb::Acquired { camera, trouble, latest_us, delivered, .. } = acquired;
        Self {
            geometry: camera.map(|camera| camera.geometry),
            trouble: *trouble,
            latest_us: *latest_us,
            received: delivered.received.saturating_sub(delivered.overrun),
            thinned: delivered.thinned,
            left_out: acquired.thinned_by_camera,
            lost_before: acquired.lost_by_camera,
            overrun: delivered.overrun,
        }
    }
}

//! Whatever is plugged in, for good.

use core::future::pending;
use core::pin::pin;

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Sender;
use embassy_time::{Duration, Timer, with_timeout};
use embassy_usb_driver::Speed;
use embassy_usb_driver::host::{DeviceEvent, UsbHostController};
use embassy_usb_host::{BusController, BusHandle, BusRoute, BusState, bus};

use super::account::Acquired;
use super::session::{self, Reached, SILENCE, Surroundings, TRANSFER_BYTES};
use super::trouble::{End, Trouble};
use crate::intake::Block;
use crate::sensor::outlet::Outlet;

/// Longest configuration that is read: a camera's is 32 bytes, a webcam's about a thousand. What is longer is no camera.
const CONFIGURATION_BYTES: usize = 512;

/// Time for something to say what it is.
const ENUMERATION: Duration = Duration::from_secs(3);

/// Time until what may pass is tried again.
const AGAIN: Duration = Duration::from_secs(2);

/// Most addresses that a bus gives.
const ADDRESSES: u8 = 127;

/// Reads from whatever camera is at the port, for good. `told` hears how it stands after every transfer, and twice
/// a second at least; `most_ev_s` is the rate beyond which the camera is told to send fewer events.
pub async fn acquire<'d, H: UsbHostController<'d>, M: RawMutex>(
    port: H,
    state: &'d BusState,
    blocks: &mut Sender<'_, M, Block>,
    most_ev_s: u32,
    mut told: impl FnMut(&Acquired),
) -> ! {
    let (mut port, handle) = bus(port, state);
    let mut outlet = Outlet::new(blocks, false);
    let mut acquired = Acquired::NONE;
    let mut buffer = [0; TRANSFER_BYTES];
    let mut plugged: Option<Speed> = None;
    loop {
        let speed = match plugged.take() {
            Some(speed) => speed,
            None => connection(&mut port, &mut acquired, &mut told).await,
        };
        let mut around = Surroundings {
            outlet: &mut outlet,
            acquired: &mut acquired,
            told: &mut told,
            most_ev_s,
            buffer: &mut buffer,
        };
        let end = talk(&mut port, &handle, speed, &mut around).await;
        // There is one port, so that whoever had an address has gone.
        (1..=ADDRESSES).for_each(|address| handle.free_address(address));
        plugged = match end {
            End::Gone => None,
            End::Anew(speed) => Some(speed),
            End::Trouble(trouble) => {
                acquired.trouble = Some(trouble);
                hold(&mut port, speed, trouble, &acquired, &mut told).await
            }
        };
        if plugged.is_none() {
            acquired.trouble = None;
        }
        told(&acquired);
    }
}

/// Waits for something to be plugged in.
async fn connection<'d, H: UsbHostController<'d>>(
    port: &mut BusController<'d, H>,
    acquired: &mut Acquired,
    told: &mut impl FnMut(&Acquired),
) -> Speed {
    loop {
        // A reset that has begun is not begun anew.
        match telling(port.wait_for_device_event(), acquired, told).await {
            DeviceEvent::Connected(speed) => return speed,
            DeviceEvent::Overcurrent => acquired.trouble = Some(Trouble::Overcurrent),
            _ => acquired.trouble = None,
        }
    }
}

/// Waits for something, and tells how it stands meanwhile.
async fn telling<T>(
    wanted: impl Future<Output = T>,
    acquired: &Acquired,
    told: &mut impl FnMut(&Acquired),
) -> T {
    let mut wanted = pin!(wanted);
    loop {
        told(acquired);
        if let Either::First(came) = select(wanted.as_mut(), Timer::after(SILENCE)).await {
            return came;
        }
    }
}

/// Finds out what was plugged in, and reads it while it is a camera.
async fn talk<'d, H, M, T>(
    port: &mut BusController<'d, H>,
    handle: &BusHandle<'d, H::Allocator>,
    speed: Speed,
    around: &mut Surroundings<'_, '_, '_, M, T>,
) -> End
where
    H: UsbHostController<'d>,
    M: RawMutex,
    T: FnMut(&Acquired),
{
    let mut configuration = [0; CONFIGURATION_BYTES];
    let enumerating = async {
        let enumerating = handle.enumerate(BusRoute::Direct(speed), &mut configuration);
        with_timeout(ENUMERATION, enumerating).await
    };
    // It may be pulled out again before it has said what it is.
    let (info, bytes) = match select(enumerating, departure(port)).await {
        Either::First(Ok(Ok(enumerated))) => enumerated,
        Either::First(_) => return End::Trouble(Trouble::NoAnswer),
        Either::Second(end) => return end,
    };
    let configuration = configuration.get(..bytes).unwrap_or_default();
    session::run(port, handle, Reached { info: &info, configuration }, around).await
}

/// Waits until the device at the port goes, or is another.
async fn departure<'d, H: UsbHostController<'d>>(port: &mut BusController<'d, H>) -> End {
    loop {
        if let Some(end) = session::after(port.wait_for_device_event().await) {
            return end;
        }
    }
}

/// Tells what is wrong until it is unplugged, or, where that may help, until it is reset and tried again.
async fn hold<'d, H: UsbHostController<'d>>(
    port: &mut BusController<'d, H>,
    speed: Speed,
    trouble: Trouble,
    acquired: &Acquired,
    told: &mut impl FnMut(&Acquired),
) -> Option<Speed> {
    let patience = async {
        if trouble.may_pass() {
            Timer::after(AGAIN).await;
        } else {
            pending().await
        }
    };
    let gone = select(departure(port), patience);
    match telling(gone, acquired, told).await {
        Either::First(End::Anew(speed)) => Some(speed),
        Either::First(_) => None,
        Either::Second(()) => {
            port.controller_mut().bus_reset().await;
            Some(speed)
        }
    }
}

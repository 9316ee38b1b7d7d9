//! The controller: power, connections, resets, and who gets which channel.

use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Duration, Timer};
use embassy_usb_driver::host::{
    DeviceEvent, HostError, SplitInfo, UsbHostAllocator, UsbHostController, pipe,
};
use embassy_usb_driver::{EndpointInfo, EndpointType, Speed};
use embassy_usb_synopsys_otg::otg_v1::{regs, vals};

use super::channel::{self, Endpoint};
use super::memory::CHANNELS;
use super::phy;
use super::pipe::{Pipe, fits};
use super::registers::{OTG, port};
use super::ring::Ring;
use super::{CHANNEL_WAKERS, PORT_WAKER, State, with};

/// Time until a plug sits (USB 2.0, 7.1.7.3).
const DEBOUNCE: Duration = Duration::from_millis(100);
/// Length of a reset (7.1.7.5), and what a device needs behind it.
const RESET: Duration = Duration::from_millis(50);
const RECOVERY: Duration = Duration::from_millis(20);

/// Clock of the PHY in a millisecond's frame.
const FULL_SPEED_FRAME: u16 = 60_000;

/// The host controller. There is one: `start` makes it.
pub struct Host {
    _one: (),
}

impl Host {
    pub(super) const fn new() -> Self {
        Self { _one: () }
    }
}

/// Hands out pipes.
#[derive(Clone, Copy)]
pub struct Allocator;

impl UsbHostAllocator<'static> for Allocator {
    type Pipe<T: pipe::Type, D: pipe::Direction> = Pipe<T, D>;

    fn alloc_pipe<T: pipe::Type, D: pipe::Direction>(
        &self,
        addr: u8,
        endpoint: &EndpointInfo,
        split: Option<SplitInfo>,
    ) -> Result<Pipe<T, D>, HostError> {
        let kind = match T::ep_type() {
            EndpointType::Control => vals::Eptyp::CONTROL,
            EndpointType::Bulk => vals::Eptyp::BULK,
            EndpointType::Interrupt | EndpointType::Isochronous => {
                return Err(HostError::Other("the host port does control and bulk transfers"));
            }
        };
        if split.is_some() {
            return Err(HostError::Other("the host port does no hubs"));
        }
        if !fits(endpoint.max_packet_size) {
            return Err(HostError::InvalidDescriptor);
        }
        let fills_ring = kind == vals::Eptyp::BULK && D::is_in();
        with(|State { port, channels, ring }| {
            let speed = port.enabled.ok_or(HostError::NoSuchDevice)?;
            let index = channels.iter().position(|channel| !channel.taken);
            let index = index.filter(|_| !(fills_ring && ring.is_taken()));
            let index = index.ok_or(HostError::OutOfPipes)?;
            let endpoint = Endpoint {
                address: addr,
                number: endpoint.addr.index() as u8,
                kind,
                packet_bytes: endpoint.max_packet_size,
                pings: speed == Speed::High,
                is_low_speed: speed == Speed::Low,
            };
            channels[index].taken = true;
            channels[index].fills_ring = fills_ring;
            if fills_ring {
                *ring = Ring::of(endpoint);
            }
            Ok(Pipe::new(index, endpoint))
        })
    }
}

impl UsbHostController<'static> for Host {
    type Allocator = Allocator;

    fn allocator(&self) -> Allocator {
        Allocator
    }

    /// Dropped before its end, it misses nothing: the next call begins the reset of what is plugged in anew.
    async fn wait_for_device_event(&mut self) -> DeviceEvent {
        if !with(|state| state.port.started) {
            phy::start_core().await;
            with(|state| state.port.started = true);
        }
        loop {
            let event = poll_fn(|context| {
                PORT_WAKER.register(context.waker());
                with(|State { port, .. }| {
                    if core::mem::take(&mut port.overcurrent) {
                        Poll::Ready(Some(DeviceEvent::Overcurrent))
                    } else if core::mem::take(&mut port.disconnected) {
                        Poll::Ready(Some(DeviceEvent::Disconnected))
                    } else if port.connected {
                        Poll::Ready(None)
                    } else {
                        Poll::Pending
                    }
                })
            })
            .await;
            if let Some(event) = event {
                return event;
            }
            Timer::after(DEBOUNCE).await;
            self.bus_reset().await;
            if let Some(speed) = with(|state| state.port.enabled) {
                return DeviceEvent::Connected(speed);
            }
            if !OTG.hprt().read().pcsts() {
                // Pulled out again.
                with(|state| state.port.connected = false);
            }
        }
    }

    async fn bus_reset(&mut self) {
        (0..CHANNELS).for_each(channel::halt);
        with(|State { port, channels, ring }| {
            channels.iter_mut().for_each(channel::Channel::lose);
            ring.lose();
            port.enabled = None;
        });
        CHANNEL_WAKERS.iter().for_each(AtomicWaker::wake);
        phy::flush();
        port(|w| w.set_prst(true));
        Timer::after(RESET).await;
        port(|w| w.set_prst(false));
        Timer::after(RECOVERY).await;
        let speed = with(|state| state.port.enabled);
        if speed.is_some() {
            // What was wanted of the port has been done.
            with(|state| state.port.connected = false);
        }
        if speed.is_some_and(|speed| speed != Speed::High) {
            OTG.hfir().write_value(regs::Hfir(FULL_SPEED_FRAME.into()));
        }
    }
}

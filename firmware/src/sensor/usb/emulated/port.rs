//! A scripted port: what is plugged in when, behind the host traits.

use core::cell::RefCell;
use core::future::{pending, poll_fn};
use core::task::Poll;
use std::boxed::Box;
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

use embassy_time::{Duration, Instant, Timer};
use embassy_usb_driver::host::{
    DeviceEvent, HostError, PipeError, SplitInfo, TimeoutConfig, UsbHostAllocator,
    UsbHostController, UsbPipe, pipe,
};
use embassy_usb_driver::{EndpointInfo, Speed};

use super::camera::{Camera, Packet};

/// What hangs at the port.
#[derive(Debug)]
pub enum Device {
    /// A camera.
    Camera(Box<Camera>),
    /// Something with these descriptors, and nothing else.
    Other {
        /// Its device descriptor.
        device: [u8; 18],
        /// Its configuration with all that belongs to it.
        configuration: Vec<u8>,
    },
}

/// What happens to a port.
#[derive(Debug)]
pub enum Act {
    /// A device is plugged in.
    Plug(Device, Speed),
    /// The camera that was pulled out last.
    Replug,
    /// The device goes, and the port says so.
    Unplug,
    /// It goes without a word; only what is asked of it fails.
    Vanish,
    /// Nothing answers any more, and nothing fails: requests wait for ever.
    Hang,
    /// The next requests for data fail like this.
    Fail(PipeError, u32),
}

/// How the port's device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Presence {
    None,
    There,
    /// Gone, and nobody was told.
    Vanished,
    Hung,
}

/// What happens in front of the port, and what has been asked of it.
#[derive(Debug)]
pub struct World {
    /// When somebody looked first.
    began: Option<Instant>,
    acts: VecDeque<(Duration, Act)>,
    device: Option<Device>,
    presence: Presence,
    speed: Speed,
    events: VecDeque<DeviceEvent>,
    failing: (Option<PipeError>, u32),
    /// Times the port was reset.
    pub resets: u32,
    /// Addresses that pipes were made for.
    pub addresses: Vec<u8>,
    /// Pipes that there are.
    pub pipes: usize,
}

/// The port.
#[derive(Clone, Debug)]
pub struct Port(pub Rc<RefCell<World>>);

/// How often somebody who waits looks again.
const TICK: Duration = Duration::from_micros(200);

impl World {
    /// A port to which this happens, each at so many milliseconds from the first look at it.
    #[must_use]
    pub fn begin(acts: Vec<(u64, Act)>) -> Port {
        let acts = acts.into_iter().map(|(ms, act)| (Duration::from_millis(ms), act)).collect();
        Port(Rc::new(RefCell::new(Self {
            began: None,
            acts,
            device: None,
            presence: Presence::None,
            speed: Speed::High,
            events: VecDeque::new(),
            failing: (None, 0),
            resets: 0,
            addresses: Vec::new(),
            pipes: 0,
        })))
    }

    /// The camera that was plugged in last.
    #[must_use]
    pub fn camera(&self) -> Option<&Camera> {
        match &self.device {
            Some(Device::Camera(camera)) => Some(camera),
            _ => None,
        }
    }

    fn camera_mut(&mut self) -> Option<&mut Camera> {
        match &mut self.device {
            Some(Device::Camera(camera)) => Some(camera),
            _ => None,
        }
    }

    /// Does what is due, and lets the camera's time pass.
    fn tick(&mut self) {
        let age = self.began.get_or_insert_with(Instant::now).elapsed();
        while let Some((_, act)) = self.acts.pop_front_if(|(at, _)| *at <= age) {
            self.act(act);
        }
        let now_us = age.as_micros();
        let powered = matches!(self.presence, Presence::There | Presence::Hung);
        if let Some(camera) = self.camera_mut().filter(|_| powered) {
            camera.run_until(now_us);
        }
    }

    fn act(&mut self, act: Act) {
        match act {
            Act::Plug(device, speed) => {
                (self.device, self.speed, self.presence) = (Some(device), speed, Presence::There);
                self.events.push_back(DeviceEvent::Connected(speed));
            }
            Act::Replug => {
                if let Some(camera) = self.camera_mut() {
                    camera.power_on();
                }
                self.presence = Presence::There;
                self.events.push_back(DeviceEvent::Connected(self.speed));
            }
            Act::Unplug => {
                self.presence = Presence::None;
                self.events.push_back(DeviceEvent::Disconnected);
            }
            Act::Vanish => self.presence = Presence::Vanished,
            Act::Hang => self.presence = Presence::Hung,
            Act::Fail(error, times) => self.failing = (Some(error), times),
        }
    }
}

impl Port {
    /// Asks the world until it has an answer.
    async fn until<T>(&self, mut ask: impl FnMut(&mut World) -> Option<T>) -> T {
        loop {
            let answer = {
                let world = &mut *self.0.borrow_mut();
                world.tick();
                ask(world)
            };
            match answer {
                Some(answer) => return answer,
                None => Timer::after(TICK).await,
            }
        }
    }

    /// Whether the device answers; hangs where it hangs.
    async fn there(&self) -> Result<(), PipeError> {
        let presence = {
            let world = &mut *self.0.borrow_mut();
            world.tick();
            world.presence
        };
        match presence {
            Presence::There => Ok(()),
            Presence::None | Presence::Vanished => Err(PipeError::BadResponse),
            Presence::Hung => pending().await,
        }
    }
}

impl UsbHostController<'static> for Port {
    type Allocator = Self;

    fn allocator(&self) -> Self {
        self.clone()
    }

    async fn wait_for_device_event(&mut self) -> DeviceEvent {
        self.until(|world| world.events.pop_front()).await
    }

    async fn bus_reset(&mut self) {
        self.0.borrow_mut().resets += 1;
    }
}

impl UsbHostAllocator<'static> for Port {
    type Pipe<T: pipe::Type, D: pipe::Direction> = Pipe;

    fn alloc_pipe<T: pipe::Type, D: pipe::Direction>(
        &self,
        addr: u8,
        endpoint: &EndpointInfo,
        _: Option<SplitInfo>,
    ) -> Result<Pipe, HostError> {
        let world = &mut *self.0.borrow_mut();
        // As many as a small controller has.
        if world.pipes == 3 {
            return Err(HostError::OutOfPipes);
        }
        world.pipes += 1;
        if addr != 0 {
            world.addresses.push(addr);
        }
        Ok(Pipe { port: self.clone(), packet_bytes: endpoint.max_packet_size.into() })
    }
}

/// A pipe to whatever hangs at the port.
#[derive(Debug)]
pub struct Pipe {
    port: Port,
    packet_bytes: usize,
}

impl Drop for Pipe {
    fn drop(&mut self) {
        self.port.0.borrow_mut().pipes -= 1;
    }
}

impl<T: pipe::Type, D: pipe::Direction> UsbPipe<T, D> for Pipe {
    async fn control_in(&mut self, setup: &[u8; 8], buf: &mut [u8]) -> Result<usize, PipeError>
    where
        T: pipe::IsControl,
        D: pipe::IsIn,
    {
        self.port.there().await?;
        let world = &mut *self.port.0.borrow_mut();
        let kind = setup[3];
        let answer: Vec<u8> = match (&setup[..2], &mut world.device) {
            ([0x80, 6], Some(Device::Camera(camera))) if kind == 1 => {
                camera.device_descriptor().to_vec()
            }
            ([0x80, 6], Some(Device::Camera(camera))) if kind == 2 => {
                camera.configuration().to_vec()
            }
            ([0x80, 6], Some(Device::Other { device, .. })) if kind == 1 => device.to_vec(),
            ([0x80, 6], Some(Device::Other { configuration, .. })) if kind == 2 => {
                configuration.clone()
            }
            (_, Some(Device::Camera(camera))) => match camera.vendor(setup, &[]) {
                Ok(Some(value)) => value.to_vec(),
                _ => return Err(PipeError::Stall),
            },
            _ => return Err(PipeError::Stall),
        };
        let bytes = answer.len().min(buf.len());
        buf[..bytes].copy_from_slice(&answer[..bytes]);
        Ok(bytes)
    }

    async fn control_out(&mut self, setup: &[u8; 8], buf: &[u8]) -> Result<(), PipeError>
    where
        T: pipe::IsControl,
        D: pipe::IsOut,
    {
        self.port.there().await?;
        let world = &mut *self.port.0.borrow_mut();
        match (&setup[..2], world.camera_mut()) {
            // SET_ADDRESS, SET_CONFIGURATION.
            ([0x00, 5 | 9], _) => Ok(()),
            ([0x02, 1], Some(camera)) => {
                camera.clear_halt(setup[4]);
                Ok(())
            }
            (_, Some(camera)) => camera.vendor(setup, buf).map(drop).map_err(|_| PipeError::Stall),
            _ => Err(PipeError::Stall),
        }
    }

    /// As a controller does that asks again after every NAK: packets up to a short one, or to the end of the buffer.
    async fn request_in(&mut self, buf: &mut [u8]) -> Result<usize, PipeError>
    where
        D: pipe::IsIn,
    {
        let packet_bytes = self.packet_bytes;
        let port = self.port.clone();
        let mut received = 0;
        let mut packet = |world: &mut World| {
            match world.presence {
                Presence::None | Presence::Vanished => return Some(Err(PipeError::BadResponse)),
                Presence::Hung => return None,
                Presence::There => {}
            }
            if let (Some(error), times) = world.failing
                && received == 0
            {
                world.failing = ((times > 1).then_some(error), times.saturating_sub(1));
                return Some(Err(error));
            }
            let camera = world.camera_mut()?;
            loop {
                match camera.packet() {
                    Packet::Nak => return None,
                    // What came before it is handed on first.
                    Packet::Stall if received > 0 => return Some(Ok(received)),
                    Packet::Stall => return Some(Err(PipeError::Stall)),
                    Packet::Data(bytes) => {
                        buf[received..][..bytes.len()].copy_from_slice(&bytes);
                        received += bytes.len();
                        if bytes.len() < packet_bytes || received + packet_bytes > buf.len() {
                            return Some(Ok(received));
                        }
                    }
                }
            }
        };
        // What has been received is never given up: a request that is dropped was not begun.
        port.until(|world| packet(world)).await
    }

    async fn request_out(&mut self, _: &[u8], _: bool) -> Result<(), PipeError>
    where
        D: pipe::IsOut,
    {
        poll_fn(|_| Poll::Ready(Err(PipeError::Stall))).await
    }

    fn set_timeout(&mut self, _: TimeoutConfig)
    where
        T: pipe::IsControl,
    {
    }

    fn reset_data_toggle(&mut self)
    where
        T: pipe::IsBulkOrInterrupt,
    {
    }
}

//! A session with one camera: what it is, starting it, and reading it until it goes.

use embassy_futures::select::{Either3, select3};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use embassy_usb_driver::Speed;
use embassy_usb_driver::host::{
    DeviceEvent, PipeError, UsbHostAllocator, UsbHostController, UsbPipe, pipe,
};
use embassy_usb_driver::{Direction, EndpointAddress, EndpointInfo, EndpointType};
use embassy_usb_host::handler::EnumerationInfo;
use embassy_usb_host::{BusController, BusHandle};
use evtach_core::Geometry;
use evtach_core::decode::Mounting;

use super::account::{Acquired, Camera};
use super::descriptors::data_endpoint;
use super::limit::{Abilities, Governor, Limit};
use super::model::Model;
use super::registers::{Module, Register, Registers};
use super::start::{DATA, Step};
use super::stream::Stream;
use super::trouble::{End, Trouble};
use crate::sensor::outlet::Outlet;

/// How long nothing may come from a camera before it is asked whether it is there.
pub(super) const SILENCE: Duration = Duration::from_millis(500);

/// Bytes that are asked for at once: four packets at high speed, so that there is one wake for a thousand events.
pub(super) const TRANSFER_BYTES: usize = 2048;

/// Times in a row that data may stop, or come damaged, before it is given up.
const PATIENCE: u32 = 5;

/// Time for a port to say that its device has gone, after a transfer that failed.
const PORT: Duration = Duration::from_millis(20);

/// Time between two looks at what the camera lost.
const COUNTERS: Duration = Duration::from_millis(500);

/// However much comes, acquiring rests once in such a time, for so much of it: a fifth in all.
const WORK: Duration = Duration::from_millis(1);
const SHARE: u32 = 4;

/// Registers that tell what the camera is and has.
const COLUMNS: Register = Register::new(Module::Dvs, 0);
const ROWS: Register = Register::new(Module::Dvs, 1);
const ORIENTATION: Register = Register::new(Module::Dvs, 2);
const HAS_REGION: Register = Register::new(Module::Dvs, 40);
const HAS_SKIP: Register = Register::new(Module::Dvs, 50);
const IMU_ORIENTATION: Register = Register::new(Module::Imu, 1);
const HAS_COUNTERS: Register = Register::new(Module::Mux, 80);
/// Events dropped because the FIFO was full.
const DROPPED: Register = Register::new(Module::Mux, 83);
const USB_MHZ: Register = Register::new(Module::System, 5);
/// What the clocks are off by, in permille of their stated rate.
const CLOCK_PERMILLE: Register = Register::new(Module::System, 6);
const EARLY_PACKETS: Register = Register::new(Module::Usb, 1);

/// Fastest USB clock that is believed, in MHz.
const FASTEST_MHZ: u32 = 1000;

/// Where the device is, and how it is reached.
pub(super) struct Reached<'i> {
    pub info: &'i EnumerationInfo,
    pub configuration: &'i [u8],
}

/// What goes on beside the camera itself.
pub(super) struct Surroundings<'s, 'o, 'b, M: RawMutex, T> {
    pub outlet: &'s mut Outlet<'o, 'b, M>,
    pub acquired: &'s mut Acquired,
    pub told: &'s mut T,
    /// Events a second that the instrument can use.
    pub most_ev_s: u32,
    /// Bytes of one transfer.
    pub buffer: &'s mut [u8; TRANSFER_BYTES],
}

impl<M: RawMutex, T: FnMut(&Acquired)> Surroundings<'_, '_, '_, M, T> {
    fn tell(&mut self) {
        self.acquired.delivered = self.outlet.delivered;
        (self.told)(self.acquired);
    }
}

/// A camera that has been found.
struct Found<C, D> {
    registers: Registers<C>,
    data: D,
    camera: Camera,
    abilities: Abilities,
    mounting: Mounting,
    has_counters: bool,
}

/// Talks to what was enumerated until it goes, or will not do.
pub(super) async fn run<'d, H, M, T>(
    port: &mut BusController<'d, H>,
    bus: &BusHandle<'d, H::Allocator>,
    reached: Reached<'_>,
    around: &mut Surroundings<'_, '_, '_, M, T>,
) -> End
where
    H: UsbHostController<'d>,
    M: RawMutex,
    T: FnMut(&Acquired),
{
    let mut found = match find(bus, &reached).await {
        Ok(found) => found,
        Err(end) => return end,
    };
    if let Err(end) = start(&mut found).await {
        return end;
    }
    let before_us = (around.acquired.sessions > 0).then_some(around.acquired.latest_us);
    let stream = Stream::new(found.camera.model, found.mounting, before_us);
    around.acquired.sessions = around.acquired.sessions.saturating_add(1);
    around.acquired.camera = Some(found.camera);
    around.acquired.trouble = None;
    around.acquired.limit = Limit::NONE;
    let governor = Governor::new(&found.abilities, around.most_ev_s);
    let mut reading = Reading { found, stream, governor, dropped: None, counted: Instant::now() };
    let end = reading.read(port, around).await;
    around.acquired.camera = None;
    around.acquired.limit = Limit::NONE;
    end
}

/// Finds out what was plugged in, and whether it will do.
async fn find<'d, A: UsbHostAllocator<'d>>(
    bus: &BusHandle<'d, A>,
    reached: &Reached<'_>,
) -> Result<Found<A::Pipe<pipe::Control, pipe::InOut>, A::Pipe<pipe::Bulk, pipe::In>>, End> {
    let description = &reached.info.device_desc;
    let (vendor_id, product_id) = (description.vendor_id, description.product_id);
    let model =
        Model::from_ids(vendor_id, product_id).ok_or(Trouble::Foreign { vendor_id, product_id })?;
    let [firmware, _] = description.bcd_device.to_le_bytes();
    model.check_firmware(firmware)?;
    if reached.info.speed() != Speed::High {
        return Err(Trouble::Slow.into());
    }
    let endpoint = data_endpoint(reached.configuration).ok_or(Trouble::NoData)?;
    let control = EndpointInfo {
        addr: EndpointAddress::from_parts(0, Direction::In),
        ep_type: EndpointType::Control,
        max_packet_size: description.max_packet_size0.into(),
        interval_ms: 0,
    };
    let (address, split) = (reached.info.device_address, reached.info.split());
    let control = bus.alloc_pipe(address, &control, split).map_err(|_| Trouble::NoAnswer)?;
    let data = bus.alloc_pipe(address, &endpoint, split).map_err(|_| Trouble::NoAnswer)?;

    let mut registers = Registers(control);
    let (version, patch) = Model::logic();
    let logic = (ask(&mut registers, version).await?, ask(&mut registers, patch).await?);
    model.check_logic(logic.0, logic.1)?;
    let columns = ask(&mut registers, COLUMNS).await?;
    let rows = ask(&mut registers, ROWS).await?;
    let swap_xy = ask(&mut registers, ORIENTATION).await? & 4 != 0;
    let flip_gyro_z = ask(&mut registers, IMU_ORIENTATION).await? & 1 != 0;
    let array = u16::try_from(columns).ok().zip(u16::try_from(rows).ok());
    let array = array
        .and_then(|(width_px, height_px)| Geometry::new(width_px, height_px))
        .ok_or(Trouble::Nonsense(COLUMNS))?;
    let geometry = if swap_xy {
        Geometry { width_px: array.height_px, height_px: array.width_px }
    } else {
        array
    };
    // The DVXplorer's region is the chip's own; it has no filter that skips.
    let (skips, regions) = match model {
        Model::Davis346 => {
            (ask(&mut registers, HAS_SKIP).await? != 0, ask(&mut registers, HAS_REGION).await? != 0)
        }
        Model::Dvxplorer => (false, true),
    };
    let has_counters = ask(&mut registers, HAS_COUNTERS).await? != 0;
    Ok(Found {
        registers,
        data,
        camera: Camera { model, geometry },
        abilities: Abilities { model, array, skips, regions },
        mounting: Mounting { swap_xy, flip_gyro_z },
        has_counters,
    })
}

async fn ask<P: UsbPipe<pipe::Control, pipe::InOut>>(
    registers: &mut Registers<P>,
    register: Register,
) -> Result<u32, End> {
    registers.read(register).await.map_err(End::at(register))
}

/// Takes the camera's start-up order.
async fn start<C, D>(found: &mut Found<C, D>) -> Result<(), End>
where
    C: UsbPipe<pipe::Control, pipe::InOut>,
    D: UsbPipe<pipe::Bulk, pipe::In>,
{
    for step in found.camera.model.steps() {
        match *step {
            Step::Write(module, values) => {
                for &(parameter, value) in values {
                    found.write(Register::new(module, parameter), value).await?;
                }
            }
            Step::Wide { address, bytes, value } => {
                let all = value.to_be_bytes();
                let (_, last) = all.split_at(all.len().saturating_sub(bytes.into()));
                for (parameter, &byte) in (address..).zip(last) {
                    found.write(Register::new(Module::Chip, parameter), byte.into()).await?;
                }
            }
            Step::Where { asked, is, register, value } => {
                if ask(&mut found.registers, asked).await? == is {
                    found.write(register, value).await?;
                }
            }
            Step::WaitMs(ms) => Timer::after_millis(ms.into()).await,
            Step::ClearHalt => found.clear_halt().await?,
            Step::Unlimited => found.limit(&Limit::NONE).await?,
            Step::EarlyPackets => {
                let mhz = ask(&mut found.registers, USB_MHZ).await?;
                let permille = ask(&mut found.registers, CLOCK_PERMILLE).await?;
                if mhz == 0 || mhz > FASTEST_MHZ || permille == 0 || permille > 2 * 1000 {
                    return Err(Trouble::Nonsense(USB_MHZ).into());
                }
                // A millisecond: 1000 us times MHz times permille over 1000.
                found.write(EARLY_PACKETS, mhz * permille).await?;
            }
        }
    }
    Ok(())
}

impl<C, D> Found<C, D>
where
    C: UsbPipe<pipe::Control, pipe::InOut>,
    D: UsbPipe<pipe::Bulk, pipe::In>,
{
    async fn write(&mut self, register: Register, value: u32) -> Result<(), End> {
        self.registers.write(register, value).await.map_err(End::at(register))
    }

    async fn clear_halt(&mut self) -> Result<(), End> {
        self.registers.clear_halt(DATA).await.map_err(|error| match error {
            PipeError::Disconnected => End::Gone,
            _ => End::Trouble(Trouble::Stalled),
        })?;
        // The camera begins with DATA0 again.
        self.data.reset_data_toggle();
        Ok(())
    }

    async fn limit(&mut self, limit: &Limit) -> Result<(), End> {
        for (register, value) in self.abilities.writes(limit) {
            self.write(register, value).await?;
        }
        Ok(())
    }
}

/// A camera that sends.
struct Reading<C, D> {
    found: Found<C, D>,
    stream: Stream,
    governor: Governor,
    /// What the camera's counter of dropped events said last.
    dropped: Option<u64>,
    /// When it was asked.
    counted: Instant,
}

impl<C, D> Reading<C, D>
where
    C: UsbPipe<pipe::Control, pipe::InOut>,
    D: UsbPipe<pipe::Bulk, pipe::In>,
{
    async fn read<'d, H, M, T>(
        &mut self,
        port: &mut BusController<'d, H>,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> End
    where
        H: UsbHostController<'d>,
        M: RawMutex,
        T: FnMut(&Acquired),
    {
        let mut failures = 0;
        let mut rested = Instant::now();
        loop {
            around.tell();
            let reading = self.found.data.request_in(&mut around.buffer[..]);
            let event = port.wait_for_device_event();
            let outcome = match select3(reading, event, Timer::after(SILENCE)).await {
                Either3::First(Ok(bytes)) => {
                    failures = 0;
                    let outcome = self.take(bytes, around).await;
                    if rested.elapsed() >= WORK {
                        // The camera's FIFO waits, and counts what it drops.
                        Timer::after(WORK / SHARE).await;
                        rested = Instant::now();
                    }
                    outcome
                }
                Either3::First(Err(error)) => {
                    failures += 1;
                    self.mend(error, failures, port, around).await
                }
                Either3::Second(event) => match after(event) {
                    Some(end) => Err(end),
                    None => Ok(()),
                },
                // A register that answers: the camera is there, and has nothing to say.
                Either3::Third(()) => match self.found.registers.read(COLUMNS).await {
                    Ok(_) => Ok(()),
                    Err(PipeError::Disconnected) => Err(End::Gone),
                    Err(_) => Err(End::Trouble(Trouble::NoAnswer)),
                },
            };
            if let Err(end) = outcome {
                around.acquired.delivered = around.outlet.delivered;
                return end;
            }
        }
    }

    /// Takes in a transfer of so many bytes.
    async fn take<M: RawMutex, T>(
        &mut self,
        bytes: usize,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> Result<(), End> {
        let Surroundings { outlet, acquired, buffer, .. } = around;
        let bytes = buffer.get(..bytes).unwrap_or_default();
        let before = self.damage();
        let words = self.stream.words(bytes);
        let events = outlet.deliver(words, self.found.camera.geometry).await;
        acquired.latest_us = self.stream.reached_us();
        if acquired.limit.skips {
            acquired.thinned_by_camera += u64::from(events);
        }
        let after = self.damage();
        acquired.damaged_words += after.0 - before.0;
        acquired.clock_resets += after.1 - before.1;
        self.look_after(around).await
    }

    fn damage(&self) -> (u64, u32) {
        (self.stream.unknown() + u64::from(self.stream.odd_bytes), self.stream.clock_resets)
    }

    /// Has the camera send fewer events, or more again, and asks what it lost.
    async fn look_after<M: RawMutex, T>(
        &mut self,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> Result<(), End> {
        let Surroundings { outlet, acquired, .. } = around;
        let now = Instant::now();
        if self.found.has_counters && now.saturating_duration_since(self.counted) >= COUNTERS {
            self.counted = now;
            let dropped =
                self.found.registers.read_counter(DROPPED).await.map_err(End::at(DROPPED))?;
            let before = self.dropped.replace(dropped).unwrap_or(0);
            // A counter that steps back began anew.
            let lost = dropped.checked_sub(before).unwrap_or(dropped);
            acquired.lost_by_camera += lost;
            outlet.lost += lost;
        }
        let events = outlet.delivered.received.saturating_add(acquired.lost_by_camera);
        if let Some(limit) = self.governor.update(now, events) {
            self.found.limit(&limit).await?;
            acquired.limit = limit;
        }
        Ok(())
    }

    /// After a transfer that failed: has the port lost its device? If not, is made to go on, so many times in a row.
    async fn mend<'d, H, M, T>(
        &mut self,
        error: PipeError,
        failures: u32,
        port: &mut BusController<'d, H>,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> Result<(), End>
    where
        H: UsbHostController<'d>,
        M: RawMutex,
    {
        if error == PipeError::Stall {
            around.acquired.stalls = around.acquired.stalls.saturating_add(1);
            if failures > PATIENCE {
                return Err(Trouble::Stalled.into());
            }
            return self.found.clear_halt().await;
        }
        around.acquired.errors = around.acquired.errors.saturating_add(1);
        match embassy_time::with_timeout(PORT, port.wait_for_device_event()).await {
            Ok(event) => match after(event) {
                Some(end) => Err(end),
                None => Ok(()),
            },
            // The port says that its device is there; a reset may help.
            Err(_) if failures > PATIENCE && error == PipeError::Disconnected => {
                Err(Trouble::NoAnswer.into())
            }
            Err(_) if failures > PATIENCE => Err(Trouble::Damaged.into()),
            // The words before and after may not fit together: what is damaged is counted by the decoder.
            Err(_) => Ok(()),
        }
    }
}

/// What an event of the port means for a session.
pub(super) fn after(event: DeviceEvent) -> Option<End> {
    match event {
        DeviceEvent::Disconnected => Some(End::Gone),
        DeviceEvent::Connected(speed) => Some(End::Anew(speed)),
        DeviceEvent::Overcurrent => Some(End::Trouble(Trouble::Overcurrent)),
        _ => None,
    }
}

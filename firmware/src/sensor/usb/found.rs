//! What was plugged in: what it is, and starting it.

use embassy_time::Timer;
use embassy_usb_driver::host::{PipeError, UsbHostAllocator, UsbPipe, pipe};
use embassy_usb_driver::{Direction, EndpointAddress, EndpointInfo, EndpointType, Speed};
use embassy_usb_host::BusHandle;
use embassy_usb_host::handler::EnumerationInfo;
use evtach_core::Geometry;
use evtach_core::decode::Mounting;

use super::account::Camera;
use super::descriptors::data_endpoint;
use super::limit::{Abilities, Limit};
use super::model::Model;
use super::registers::{Module, Register, Registers};
use super::start::{DATA, Step};
use super::trouble::{End, Trouble};

/// Registers that tell what the camera is and has.
pub(super) const COLUMNS: Register = Register::new(Module::Dvs, 0);
const ROWS: Register = Register::new(Module::Dvs, 1);
const ORIENTATION: Register = Register::new(Module::Dvs, 2);
const HAS_REGION: Register = Register::new(Module::Dvs, 40);
const HAS_SKIP: Register = Register::new(Module::Dvs, 50);
const IMU_ORIENTATION: Register = Register::new(Module::Imu, 1);
const HAS_COUNTERS: Register = Register::new(Module::Mux, 80);
/// Events dropped because the FIFO was full.
pub(super) const DROPPED: Register = Register::new(Module::Mux, 83);
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

/// A camera that has been found.
pub(super) struct Found<C, D> {
    pub registers: Registers<C>,
    pub data: D,
    pub camera: Camera,
    pub abilities: Abilities,
    pub mounting: Mounting,
    /// What its counter of dropped events said last; `None`: it has none.
    pub dropped: Option<u64>,
}

/// Finds out what was plugged in, and whether it will do.
pub(super) async fn find<'d, A: UsbHostAllocator<'d>>(
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
    // A camera that was only reset goes on counting.
    let dropped = match has_counters {
        true => Some(registers.read_counter(DROPPED).await.map_err(End::at(DROPPED))?),
        false => None,
    };
    Ok(Found {
        registers,
        data,
        camera: Camera { model, geometry },
        abilities: Abilities { model, array, skips, regions },
        mounting: Mounting { swap_xy, flip_gyro_z },
        dropped,
    })
}

async fn ask<P: UsbPipe<pipe::Control, pipe::InOut>>(
    registers: &mut Registers<P>,
    register: Register,
) -> Result<u32, End> {
    registers.read(register).await.map_err(End::at(register))
}

/// Takes the camera's start-up order.
pub(super) async fn start<C, D>(found: &mut Found<C, D>) -> Result<(), End>
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

    pub async fn clear_halt(&mut self) -> Result<(), End> {
        self.registers.clear_halt(DATA).await.map_err(|error| match error {
            PipeError::Disconnected => End::Gone,
            _ => End::Trouble(Trouble::Stalled),
        })?;
        // The camera begins with DATA0 again.
        self.data.reset_data_toggle();
        Ok(())
    }

    pub async fn limit(&mut self, limit: &Limit) -> Result<(), End> {
        for (register, value) in self.abilities.writes(limit) {
            self.write(register, value).await?;
        }
        Ok(())
    }
}

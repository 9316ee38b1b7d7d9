//! The cameras' registers, and how they are asked (facts: libcaer, "spi_config"; neuromorphic-drivers).

use core::fmt;

use embassy_time::{Duration, with_timeout};
use embassy_usb_driver::host::{PipeError, UsbPipe, pipe};

/// A camera answers within this time, or never.
const TIMEOUT: Duration = Duration::from_millis(500);

/// Vendor's request for a register, either way.
const CONFIGURATION: u8 = 0xbf;
/// Request types: vendor, device; to the camera and from it.
const TO_DEVICE: u8 = 0x40;
const FROM_DEVICE: u8 = 0xc0;
/// The standard request that clears the halt of an endpoint.
const CLEAR_FEATURE: [u8; 2] = [0x02, 0x01];

/// Part of a camera's logic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u16)]
pub enum Module {
    /// Multiplexer, and its clock.
    Mux = 0,
    /// Pixels that send events, and filters behind them.
    Dvs = 1,
    /// Pixels that make frames.
    Aps = 2,
    /// Inertial sensor.
    Imu = 3,
    /// External input.
    Input = 4,
    /// The chip's own registers: biases.
    Chip = 5,
    /// What the camera is.
    System = 6,
    /// USB.
    Usb = 9,
}

impl Module {
    const ALL: [Self; 8] = [
        Self::Mux,
        Self::Dvs,
        Self::Aps,
        Self::Imu,
        Self::Input,
        Self::Chip,
        Self::System,
        Self::Usb,
    ];

    /// The module of a number.
    #[must_use]
    pub fn from_number(number: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|module| *module as u16 == number)
    }
}

/// A register of 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Register {
    /// Where it is.
    pub module: Module,
    /// Its address there.
    pub parameter: u16,
}

impl Register {
    /// A register by its address.
    #[must_use]
    pub const fn new(module: Module, parameter: u16) -> Self {
        Self { module, parameter }
    }
}

/// Module and parameter as the cameras' documentation writes them.
impl fmt::Display for Register {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.module as u16, self.parameter)
    }
}

/// What was asked of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Transfer {
    /// A register was read.
    Read(Register),
    /// A register was written.
    Write(Register, u32),
    /// The halt of an endpoint was cleared.
    ClearHalt(u8),
}

/// Control pipe to a camera.
pub(super) struct Registers<P>(pub P);

impl<P: UsbPipe<pipe::Control, pipe::InOut>> Registers<P> {
    /// Reads a register.
    pub async fn read(&mut self, register: Register) -> Result<u32, PipeError> {
        let setup = setup(FROM_DEVICE, register);
        let mut bytes = [0; 4];
        let reading = self.0.control_in(&setup, &mut bytes);
        match with_timeout(TIMEOUT, reading).await {
            Ok(Ok(4)) => Ok(u32::from_be_bytes(bytes)),
            Ok(Ok(_)) => Err(PipeError::BadResponse),
            Ok(Err(error)) => Err(error),
            Err(_) => Err(PipeError::Timeout),
        }
    }

    /// Writes a register.
    pub async fn write(&mut self, register: Register, value: u32) -> Result<(), PipeError> {
        let setup = setup(TO_DEVICE, register);
        let bytes = value.to_be_bytes();
        let writing = self.0.control_out(&setup, &bytes);
        with_timeout(TIMEOUT, writing).await.unwrap_or(Err(PipeError::Timeout))
    }

    /// Reads a counter of 64 bits: the upper half, the lower one behind it, and the upper again, in case it
    /// went on in between.
    pub async fn read_counter(&mut self, register: Register) -> Result<u64, PipeError> {
        let lower = Register { parameter: register.parameter + 1, ..register };
        let mut upper = self.read(register).await?;
        loop {
            let low = self.read(lower).await?;
            let again = self.read(register).await?;
            if again == upper {
                return Ok(u64::from(upper) << 32 | u64::from(low));
            }
            upper = again;
        }
    }

    /// Clears the halt of an endpoint.
    pub async fn clear_halt(&mut self, endpoint: u8) -> Result<(), PipeError> {
        let [kind, request] = CLEAR_FEATURE;
        let setup = [kind, request, 0, 0, endpoint, 0, 0, 0];
        let clearing = self.0.control_out(&setup, &[]);
        with_timeout(TIMEOUT, clearing).await.unwrap_or(Err(PipeError::Timeout))
    }
}

fn setup(kind: u8, register: Register) -> [u8; 8] {
    let [v0, v1] = (register.module as u16).to_le_bytes();
    let [i0, i1] = register.parameter.to_le_bytes();
    [kind, CONFIGURATION, v0, v1, i0, i1, 4, 0]
}

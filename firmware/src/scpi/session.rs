//! What a command finds and changes, and how it is carried out.

use super::commands::Command;
use super::device::{Device, RecorderState};
use super::error::{ErrorCode, ErrorQueue, ScpiError};
use super::parameter::Parameters;
use super::response::Response;
use super::status::{Status, operation, questionable};
use super::{fetch, recording, setting};
use crate::instrument::{Alarm, Fault, Preferences, Sensor};

/// The state of the link that outlives a line.
#[derive(Clone, Debug)]
pub struct Session {
    /// The registers.
    pub status: Status,
    /// Errors that have not been read.
    pub errors: ErrorQueue,
    /// Whether each reading is told as it comes.
    pub log: bool,
    fault_told: bool,
}

/// How a command goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// It is done.
    Done,
    /// It waits for a reading of this rotor; with `speed`, for one that has a speed.
    Wait {
        /// Rotor asked for.
        rotor: Option<u8>,
        /// Whether a reading without a speed does not count.
        speed: bool,
    },
    /// These bytes follow the answer.
    Block(Block),
}

/// Bytes that are too many for an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// What they are.
    pub kind: BlockKind,
    /// How many were announced.
    pub length: u32,
    /// How many have been sent.
    pub sent: u32,
}

/// What a block holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockKind {
    /// A recording of events.
    Recording,
    /// The list of headers.
    Headers,
    /// The pixels on the screen.
    Screen,
}

impl Block {
    /// A block, its head written.
    pub(super) fn begin(kind: BlockKind, length: u32, out: &mut Response) -> Self {
        out.block(length);
        Self { kind, length, sent: 0 }
    }
}

impl Session {
    /// As after power-on.
    #[must_use]
    pub fn power_on() -> Self {
        Self {
            status: Status::power_on(),
            errors: ErrorQueue::new(),
            log: false,
            fault_told: false,
        }
    }

    /// Queues an error and notes its class.
    pub fn report(&mut self, error: ScpiError) {
        self.status.esr |= error.code.event();
        self.errors.push(error);
    }

    /// Brings the registers up to date with the device.
    pub fn observe(&mut self, device: &impl Device) {
        let fault = device.fault().map(|(fault, _)| fault);
        if let Some(fault) = fault.filter(|_| !self.fault_told) {
            let code = match fault {
                Fault::Preferences => ErrorCode::MemoryLost,
                Fault::Panic
                | Fault::Exception
                | Fault::Watchdog
                | Fault::Crystal
                | Fault::Memory => ErrorCode::System,
            };
            self.report(ScpiError { code, byte: None });
        }
        self.fault_told = fault.is_some();
        let reading = device.reading();
        let speed = reading.is_some_and(|reading| reading.status.reason().is_none());
        let flag = |bit, set| if set { bit } else { 0 };
        self.status.operation.update(
            flag(operation::MEASURING, reading.is_some())
                | flag(operation::RECORDING, device.recorder().state == RecorderState::Running)
                | flag(
                    operation::LOCKED,
                    reading.is_some_and(|reading| reading.status == evtach_core::Status::Locked),
                ),
        );
        self.status.questionable.update(
            flag(questionable::SPEED, !speed)
                | flag(questionable::LOST, reading.is_some_and(|reading| reading.lost > 0))
                | flag(questionable::SENSOR, device.sensor() == Sensor::Absent)
                | flag(questionable::ALARM, device.alarm())
                | flag(questionable::FAULT, fault.is_some()),
        );
    }

    /// Carries out a command.
    pub fn execute(
        &mut self,
        command: Command,
        parameters: &mut Parameters<'_>,
        device: &mut impl Device,
        out: &mut Response,
    ) -> Result<Flow, ScpiError> {
        match command {
            Command::Common(common) => self.common(common, parameters, device, out)?,
            Command::Fetch(item) => fetch::fetch(item, parameters, device, out)?,
            Command::Read | Command::Measure => {
                let rotor = fetch::rotor_parameter(parameters)?;
                parameters.end()?;
                let speed = command == Command::Measure;
                if speed {
                    device.go_live();
                }
                return Ok(Flow::Wait { rotor, speed });
            }
            Command::Configure => {
                let rotor = fetch::rotor_parameter(parameters)?;
                parameters.end()?;
                device.go_live();
                device.select(rotor);
            }
            Command::Configured => {
                parameters.end()?;
                fetch::configured(device, out);
            }
            Command::Set(setting) => setting::set(setting, parameters, device)?,
            Command::Get(setting) => {
                parameters.end()?;
                setting::get(setting, device, out);
            }
            Command::LimitFail => {
                parameters.end()?;
                out.plain(u8::from(device.alarm()));
            }
            Command::LimitClear => {
                parameters.end()?;
                let alarm = Alarm { low_rpm: None, high_rpm: None };
                setting::change(device, Preferences { alarm, ..device.preferences() });
            }
            Command::Collected(collected) => {
                parameters.end()?;
                fetch::collected(collected, device, out);
            }
            Command::CollectedClear => {
                parameters.end()?;
                device.clear_statistics();
            }
            Command::System(system) => return self.system(system, parameters, device, out),
            Command::Status(group, access) => self.register(group, access, parameters, out)?,
            Command::StatusPreset => {
                parameters.end()?;
                self.status.operation.preset();
                self.status.questionable.preset();
            }
            Command::Hardcopy => {
                parameters.end()?;
                let length = device.screen().len() as u32;
                return Ok(Flow::Block(Block::begin(BlockKind::Screen, length, out)));
            }
            Command::Record(record) => return recording::run(record, parameters, device, out),
        }
        Ok(Flow::Done)
    }
}

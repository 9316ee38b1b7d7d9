//! `DATA:RECord`: events recorded on the device, and fetched as a file that `evtach` reads.

use super::commands::Record;
use super::device::{Device, RecorderFailed, RecorderState};
use super::error::{ErrorCode, ScpiError};
use super::parameter::{Parameter, Parameters};
use super::response::Response;
use super::session::{Block, BlockKind, Flow};
use crate::record::{Header, RECORD_BYTES};

/// Carries out a command of the recorder.
pub fn run(
    record: Record,
    parameters: &mut Parameters<'_>,
    device: &mut impl Device,
    out: &mut Response,
) -> Result<Flow, ScpiError> {
    let status = device.recorder();
    let error = |code| ScpiError { code, byte: None };
    let wanted = if record == Record::Start { events(parameters, status.capacity)? } else { 0 };
    parameters.end()?;
    if status.state == RecorderState::Absent && record != Record::State {
        return Err(error(ErrorCode::HardwareMissing));
    }
    match record {
        Record::Start => {
            // Without a sensor it is not known how large the picture is.
            if device.geometry().is_none() {
                return Err(error(ErrorCode::SettingsConflict));
            }
            device.start_recording(wanted).map_err(|RecorderFailed| error(ErrorCode::Hardware))?;
        }
        Record::Stop => device.stop_recording(),
        Record::State => out.plain(match status.state {
            RecorderState::Absent => "ABSENT",
            RecorderState::Idle => "IDLE",
            RecorderState::Running => "RUN",
            RecorderState::Full => "FULL",
        }),
        Record::Events => out.plain(status.events),
        Record::Capacity => out.plain(status.capacity),
        Record::Data => {
            if status.state == RecorderState::Running {
                return Err(error(ErrorCode::SettingsConflict));
            }
            if status.events == 0 {
                return Err(error(ErrorCode::Stale));
            }
            let length = status
                .events
                .saturating_mul(RECORD_BYTES as u32)
                .saturating_add(Header::BYTES as u32);
            return Ok(Flow::Block(Block::begin(BlockKind::Recording, length, out)));
        }
    }
    Ok(Flow::Done)
}

/// How many events to record: as many as there is room for, unless said.
fn events(parameters: &mut Parameters<'_>, capacity: u32) -> Result<u32, ScpiError> {
    let Some((parameter, place)) = parameters.next()? else { return Ok(capacity) };
    let code = match parameter {
        Parameter::Word(_) => ErrorCode::DataType,
        Parameter::Number(_, [_, ..]) => ErrorCode::InvalidSuffix,
        Parameter::Number(value, []) => {
            // Beyond 16 777 216, f32 rounds the number to the next even one and so on.
            let events = value as u32;
            if value >= 1.0 && events <= capacity {
                return Ok(events);
            }
            ErrorCode::DataOutOfRange
        }
    };
    Err(ScpiError::at(code, place))
}

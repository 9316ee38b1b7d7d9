//! IEEE 488.2's commands, `SYSTem` and `STATus`.

use core::fmt::Write as _;

use heapless::String;

use super::commands::{Access, Common, Group, HEADERS_BYTES, System};
use super::device::{Device, Fate, View};
use super::error::ScpiError;
use super::parameter::Parameters;
use super::response::Response;
use super::session::{Block, BlockKind, Flow, Session};
use super::setting;
use super::status::{Register, esr, stb};
use crate::instrument::{Fault, Preferences, Sensor};
use crate::sensor::usb::TROUBLE_BYTES;

impl Session {
    pub(super) fn common(
        &mut self,
        common: Common,
        parameters: &mut Parameters<'_>,
        device: &mut impl Device,
        out: &mut Response,
    ) -> Result<(), ScpiError> {
        let mask = match common {
            Common::Ese | Common::Sre => parameters.integer(255)? as u8,
            _ => 0,
        };
        parameters.end()?;
        match common {
            Common::Cls => {
                self.status.clear();
                self.errors.clear();
            }
            Common::Ese => self.status.ese = mask,
            Common::EseQuery => out.plain(self.status.ese),
            Common::EsrQuery => out.plain(core::mem::take(&mut self.status.esr)),
            Common::IdnQuery => {
                let identity = device.identity();
                for field in ["EV-Tach", "EV-Tach", identity.serial, identity.version] {
                    out.plain(field);
                }
            }
            // Every command is done before the next begins.
            Common::Opc => self.status.esr |= esr::OPERATION_COMPLETE,
            Common::OpcQuery => out.plain(1),
            Common::Wai => {}
            Common::Rst => self.reset(device),
            // Bit 6 is the summary of the others and cannot enable itself.
            Common::Sre => self.status.sre = mask & !stb::MASTER,
            Common::SreQuery => out.plain(self.status.sre),
            Common::StbQuery => out.plain(self.status.byte(!self.errors.is_empty())),
            Common::TstQuery => {
                let sensor = u8::from(device.sensor() == Sensor::Absent);
                out.plain(sensor | u8::from(device.fault().is_some()) << 1);
            }
        }
        Ok(())
    }

    /// The instrument as from the factory, but for its calibration; no log, no recording.
    fn reset(&mut self, device: &mut impl Device) {
        let clock_trim_ppm = device.preferences().clock_trim_ppm;
        setting::change(device, Preferences { clock_trim_ppm, ..Preferences::default() });
        device.set_view(View::default());
        device.go_live();
        device.select(None);
        device.clear_statistics();
        device.stop_recording();
        self.log = false;
    }

    pub(super) fn system(
        &mut self,
        system: System,
        parameters: &mut Parameters<'_>,
        device: &mut impl Device,
        out: &mut Response,
    ) -> Result<Flow, ScpiError> {
        let log = if system == System::Log { parameters.switch()? } else { self.log };
        parameters.end()?;
        match system {
            System::Error => match self.errors.pop() {
                Some(error) => out.plain(error),
                None => out.plain("0,\"No error\""),
            },
            System::ErrorCount => out.plain(self.errors.len()),
            System::Version => out.plain("1999.0"),
            System::Log => self.log = log,
            System::LogQuery => out.plain(u8::from(log)),
            System::Sensor => match (device.sensor(), device.trouble()) {
                (Sensor::Present, _) => {
                    out.text("present");
                    out.text("");
                }
                (Sensor::Absent, None) => {
                    out.text("absent");
                    out.text("");
                }
                (Sensor::Absent, Some(trouble)) => {
                    let mut words = String::<TROUBLE_BYTES>::new();
                    write!(words, "{trouble}").ok();
                    out.text("refused");
                    out.text(&words);
                }
            },
            System::Events => {
                let Fate { used, thinned, late, lost_before, overrun } = device.fate();
                for count in [used, thinned, late, lost_before, overrun] {
                    out.plain(count);
                }
            }
            System::Fault => match device.fault() {
                Some((fault, words)) => {
                    out.text(match fault {
                        Fault::Panic => "panic",
                        Fault::Exception => "exception",
                        Fault::Watchdog => "watchdog",
                        Fault::Preferences => "preferences",
                        Fault::Crystal => "crystal",
                        Fault::Memory => "memory",
                    });
                    out.text(words);
                }
                None => {
                    out.text("none");
                    out.text("");
                }
            },
            System::FaultClear => device.acknowledge_fault(),
            System::Preset => self.reset(device),
            System::Headers => {
                return Ok(Flow::Block(Block::begin(BlockKind::Headers, HEADERS_BYTES, out)));
            }
        }
        Ok(Flow::Done)
    }

    pub(super) fn register(
        &mut self,
        group: Group,
        access: Access,
        parameters: &mut Parameters<'_>,
        out: &mut Response,
    ) -> Result<(), ScpiError> {
        let register: &mut Register = match group {
            Group::Operation => &mut self.status.operation,
            Group::Questionable => &mut self.status.questionable,
        };
        if let Access::Write(mask) = access {
            let value = parameters.integer(u16::MAX)?;
            parameters.end()?;
            *register.mask(mask) = value & 0x7fff;
            return Ok(());
        }
        parameters.end()?;
        out.plain(match access {
            Access::Event => register.take_events(),
            Access::Condition => register.condition(),
            Access::Read(mask) | Access::Write(mask) => *register.mask(mask),
        });
        Ok(())
    }
}

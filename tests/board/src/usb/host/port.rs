//! The port: power, what is plugged in, and its reset.

use super::Host;
use super::MICROFRAME_PS;
use crate::time::{MS, NEVER};
use crate::usb::function::{Attached, Function};
use crate::usb::globals::int;

pub(super) const PCSTS: u32 = 1;
pub(super) const PCDET: u32 = 1 << 1;
pub(super) const PENA: u32 = 1 << 2;
pub(super) const PENCHNG: u32 = 1 << 3;
pub(super) const POCCHNG: u32 = 1 << 5;
pub(super) const PRST: u32 = 1 << 8;
pub(super) const PPWR: u32 = 1 << 12;

/// Time from a plug to its being seen.
const CONNECT_PS: u64 = 100 * MS;

/// What an unplugged camera leaves behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unplug {
    /// Errors on open channels, and the port says so.
    Plain,
    /// The port says so; transfers that were under way just never end.
    Quiet,
    /// Errors on open channels, and not a word from the port.
    ErrorsOnly,
}

impl Host {
    /// Plugs a device in.
    pub fn plug(&mut self, function: Box<dyn Function>, now: u64) {
        self.attached = Some(Attached::new(function));
        self.seen_at = if self.port & PPWR != 0 { now + CONNECT_PS } else { NEVER };
    }

    /// Takes the device out and hands it back.
    pub fn unplug(&mut self, how: Unplug) -> Option<Box<dyn Function>> {
        let gone = self.attached.take()?;
        self.seen_at = NEVER;
        if how != Unplug::ErrorsOnly {
            self.disconnected();
        }
        if how == Unplug::Quiet {
            self.flight = None;
            for channel in &mut self.channels {
                channel.active = false;
            }
        }
        Some(gone.function)
    }

    fn disconnected(&mut self) {
        if self.port & PCSTS != 0 {
            self.globals.latched |= int::DISC;
            if self.port & PENA != 0 {
                self.port |= PENCHNG;
                self.next_sof = NEVER;
            }
            self.port &= !(PCSTS | PENA | PRST);
        }
    }

    pub(super) fn write_port(&mut self, value: u32, now: u64) {
        let before = self.port;
        self.port &= !(value & (PCDET | PENCHNG | POCCHNG));
        if value & PENA != 0 {
            self.port &= !PENA;
            self.next_sof = NEVER;
        }
        const KEPT: u32 = PRST | PPWR | 0xf << 13 | 1 << 6 | 1 << 7;
        self.port = self.port & !KEPT | value & KEPT;
        if before & PPWR == 0 && value & PPWR != 0 && self.attached.is_some() {
            self.seen_at = now + CONNECT_PS;
        }
        if value & PPWR == 0 {
            self.port &= !(PCSTS | PENA);
            self.next_sof = NEVER;
        }
        if before & PRST != 0 && value & PRST == 0 && self.port & PCSTS != 0 {
            if let Some(device) = &mut self.attached {
                device.reset();
            }
            self.port |= PENA | PENCHNG;
            self.began = now;
            self.next_sof = now + MICROFRAME_PS;
        }
    }
}

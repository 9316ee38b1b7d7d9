//! A channel of the core: one transfer after another, restarted where the core leaves that to software.

use core::sync::atomic::{Ordering, compiler_fence};

use embassy_usb_driver::host::PipeError;
use embassy_usb_synopsys_otg::otg_v1::{regs, vals};

use super::registers::{AHB_ERROR, NYET, OTG, SETUP};
use super::ring::Ring;

/// Errors in a row on the wire before a transfer is given up (USB 2.0, 8.7.1.4).
const STRIKES: u8 = 3;

/// Where a pipe leads.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Endpoint {
    pub address: u8,
    pub number: u8,
    pub kind: vals::Eptyp,
    pub packet_bytes: u16,
    /// High speed: the device is asked for room before data is sent again.
    pub pings: bool,
    pub is_low_speed: bool,
}

/// One transfer.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Transfer {
    pub endpoint: Endpoint,
    pub is_in: bool,
    /// Packet identifier of the first packet.
    pub pid: u8,
    /// Where the core reads or writes.
    pub address: u32,
    pub bytes: u32,
}

/// How a transfer ended.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Ended {
    /// Bytes that went, also before an error.
    pub bytes: u32,
    /// Packet identifier of the next one.
    pub pid: u8,
    pub error: Option<PipeError>,
}

/// What a channel is doing.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Doing {
    Nothing,
    /// What is left of a transfer, and how many bytes went before.
    Transfer {
        rest: Transfer,
        before: u32,
        strikes: u8,
    },
    Ended(Ended),
}

/// A channel.
pub struct Channel {
    /// Whether a pipe has it.
    pub taken: bool,
    /// Whether it fills the ring.
    pub fills_ring: bool,
    doing: Doing,
}

impl Transfer {
    /// Packets of it: one even when it is empty.
    const fn packets(&self) -> u32 {
        let packets = self.bytes.div_ceil(self.endpoint.packet_bytes as u32);
        if packets == 0 { 1 } else { packets }
    }

    /// Sets the core to work.
    fn begin(&self, channel: usize, ping: bool) {
        let Endpoint { address, number, kind, packet_bytes, is_low_speed, .. } = self.endpoint;
        OTG.hcint(channel).write_value(regs::Hcint(u32::MAX));
        // The core halts the channel by itself at the end of a transfer, and for whatever it leaves to software. It
        // asks again after a NAK without a word.
        OTG.hcintmsk(channel).write(|w| w.set_chhm(true));
        OTG.hctsiz(channel).write(|w| {
            // To the core, what is received comes in whole packets.
            let packets = self.packets();
            w.set_xfrsiz(if self.is_in { packets * u32::from(packet_bytes) } else { self.bytes });
            w.set_pktcnt(packets as u16);
            w.set_dpid(self.pid);
            w.set_doping(ping);
        });
        OTG.hcdma(channel).write_value(regs::Hcdma(self.address));
        // What was written to memory is there before the core looks.
        compiler_fence(Ordering::SeqCst);
        cortex_m::asm::dsb();
        OTG.hcchar(channel).write(|w| {
            w.set_mpsiz(packet_bytes);
            w.set_epnum(number);
            w.set_epdir(self.is_in);
            w.set_lsdev(is_low_speed);
            w.set_eptyp(kind);
            w.set_mcnt(1);
            w.set_dad(address);
            w.set_chena(true);
        });
    }

    /// What is left behind so many packets.
    fn behind(self, packets: u32, pid: u8) -> (Self, u32) {
        let bytes = (packets * u32::from(self.endpoint.packet_bytes)).min(self.bytes);
        let rest = Self { address: self.address + bytes, bytes: self.bytes - bytes, pid, ..self };
        (rest, bytes)
    }
}

impl Channel {
    /// Nobody's.
    pub const FREE: Self = Self { taken: false, fills_ring: false, doing: Doing::Nothing };

    /// Starts a transfer.
    pub fn start(&mut self, index: usize, transfer: Transfer) {
        self.doing = Doing::Transfer { rest: transfer, before: 0, strikes: 0 };
        OTG.haintmsk().modify(|w| w.set_haintm(w.haintm() | 1 << index));
        transfer.begin(index, false);
    }

    /// How the last transfer ended, once it has.
    pub fn take_end(&mut self) -> Option<Ended> {
        let Doing::Ended(ended) = self.doing else { return None };
        self.doing = Doing::Nothing;
        Some(ended)
    }

    /// Whether a transfer is under way.
    pub const fn is_busy(&self) -> bool {
        matches!(self.doing, Doing::Transfer { .. })
    }

    /// Forgets the transfer; the core may still be at it, until [`halt`].
    pub fn forget(&mut self) {
        self.doing = Doing::Nothing;
    }

    /// The device has gone: so have its transfers.
    pub fn lose(&mut self) {
        if let Doing::Transfer { rest, before, .. } = self.doing {
            let error = Some(PipeError::Disconnected);
            self.doing = Doing::Ended(Ended { bytes: before, pid: rest.pid, error });
        }
    }

    /// The core has halted the channel. Whether somebody is to be woken.
    pub fn on_interrupt(&mut self, index: usize, ring: &mut Ring) -> bool {
        let why = OTG.hcint(index).read();
        OTG.hcint(index).write_value(why);
        let Doing::Transfer { rest, before, strikes } = self.doing else { return false };
        let size = OTG.hctsiz(index).read();
        let error = match why {
            why if why.xfrc() => None,
            why if why.stall() => Some(PipeError::Stall),
            why if why.bberr() => Some(PipeError::Babble),
            why if why.0 & AHB_ERROR != 0 => Some(PipeError::BufferOverflow),
            why if why.txerr() || why.frmor() => Some(PipeError::BadResponse),
            why if why.dterr() => Some(PipeError::DataToggleError),
            // What was not taken is sent again, where the core does not do so itself.
            why if why.nak() || why.0 & NYET != 0 => {
                self.resume(index, size, 0, rest.endpoint.pings && !rest.is_in);
                return false;
            }
            _ => Some(PipeError::Canceled),
        };
        let ended = match error {
            None => {
                let asked = rest.packets() * u32::from(rest.endpoint.packet_bytes);
                let last = if rest.is_in { asked - size.xfrsiz() } else { rest.bytes };
                Ended { bytes: before + last.min(rest.bytes), pid: size.dpid(), error }
            }
            Some(PipeError::BadResponse | PipeError::DataToggleError) if strikes + 1 < STRIKES => {
                self.resume(index, size, strikes + 1, false);
                return false;
            }
            // The count of packets tells what went over the wire; that of bytes, what the core has moved so far.
            Some(_) => {
                let (rest, last) = rest.behind(went(&rest, size), size.dpid());
                Ended { bytes: before + last, pid: rest.pid, error }
            }
        };
        self.doing = Doing::Ended(ended);
        if self.fills_ring {
            self.doing = Doing::Nothing;
            if let Some(next) = ring.filled(ended) {
                self.start(index, next);
            }
        }
        true
    }

    /// Goes on behind the packets that went. A packet that did takes back the strikes.
    fn resume(&mut self, index: usize, size: regs::Hctsiz, strikes: u8, ping: bool) {
        let Doing::Transfer { rest, before, .. } = self.doing else { return };
        let packets = went(&rest, size);
        let (rest, last) =
            if rest.pid == SETUP { (rest, 0) } else { rest.behind(packets, size.dpid()) };
        let strikes = if packets > 0 { strikes.min(1) } else { strikes };
        self.doing = Doing::Transfer { rest, before: before + last, strikes };
        rest.begin(index, ping);
    }
}

/// Packets that went, of those that a transfer asked for.
fn went(transfer: &Transfer, size: regs::Hctsiz) -> u32 {
    transfer.packets().saturating_sub(size.pktcnt().into())
}

/// Has the core stop, and waits for it: an eighth of a millisecond at most, the length of a microframe. Not for use in an
/// interrupt, nor with interrupts held back.
pub fn halt(index: usize) {
    /// Longer than the core ever takes, at 216 MHz.
    const LOOKS: u32 = 20_000;
    OTG.hcintmsk(index).write_value(regs::Hcintmsk(0));
    if OTG.hcchar(index).read().chena() {
        OTG.hcchar(index).modify(|w| {
            w.set_chena(true);
            w.set_chdis(true);
        });
        // A port that has lost its device may not answer.
        (0..LOOKS).find(|_| !OTG.hcchar(index).read().chena());
    }
    OTG.hcint(index).write_value(regs::Hcint(u32::MAX));
}

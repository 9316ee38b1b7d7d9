//! The core's registers, with what the register definitions leave out.

use embassy_usb_synopsys_otg::otg_v1::{Otg, regs};

/// The high-speed core (RM0385, 2.2.2).
// SAFETY: the core's registers lie there, and nothing else drives it.
pub const OTG: Otg = unsafe { Otg::from_ptr(0x4004_0000 as *mut ()) };

/// Bits of HCINT that have no name there: an error on the chip's own bus, and NYET.
pub const AHB_ERROR: u32 = 1 << 2;
pub const NYET: u32 = 1 << 6;

/// Packet identifiers as HCTSIZ tells them.
pub const DATA0: u8 = 0;
pub const DATA1: u8 = 2;
pub const SETUP: u8 = 3;

/// Changes the port's register. Bits that are cleared by writing one are left as they are, among them the one that
/// disables the port.
pub fn port(change: impl FnOnce(&mut regs::Hprt)) {
    let mut port = OTG.hprt().read();
    port.set_pcdet(false);
    port.set_pena(false);
    port.set_penchng(false);
    port.set_pocchng(false);
    change(&mut port);
    OTG.hprt().write_value(port);
}

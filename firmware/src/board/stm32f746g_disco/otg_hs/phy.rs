//! The PHY outside of the chip (USB3320C), its twelve wires, and the core's start.

use embassy_stm32::gpio::{AfType, Flex, OutputType, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt as _, Priority};
use embassy_stm32::pac::RCC;
use embassy_time::Timer;
use embassy_usb_synopsys_otg::otg_v1::regs;

use super::host::Host;
use super::registers::{OTG, port};
use crate::wiring::HostPins;

/// Words of the core's FIFO memory that receive, send, and send periodically. The last of its 1024 hold what its DMA
/// remembers of the channels.
const RECEIVE_WORDS: u16 = 512;
const SEND_WORDS: u16 = 256;
const PERIODIC_WORDS: u16 = 224;

/// Bursts of the core's DMA: four words.
const BURST: u8 = 3;

/// All of the FIFOs that send.
const ALL: u8 = 0x10;

/// Looks at a bit that the core changes within microseconds.
const LOOKS: u32 = 100_000;

/// Time in which the core becomes a host (RM0385, OTG_GUSBCFG.FHMOD).
const HOST_MODE_MS: u64 = 25;

/// Gives the core its wires and its clock. It is started when somebody waits for a device.
pub fn start(p: HostPins, priority: Priority) -> Host {
    let wires = [
        Flex::new(p.clock),
        Flex::new(p.d0),
        Flex::new(p.d1),
        Flex::new(p.d2),
        Flex::new(p.d3),
        Flex::new(p.d4),
        Flex::new(p.d5),
        Flex::new(p.d6),
        Flex::new(p.d7),
        Flex::new(p.stop),
        Flex::new(p.direction),
        Flex::new(p.next),
    ];
    for mut wire in wires {
        wire.set_as_af_unchecked(10, AfType::output(OutputType::PushPull, Speed::VeryHigh));
        // A pin that is let go floats.
        core::mem::forget(wire);
    }
    critical_section::with(|_| {
        RCC.ahb1enr().modify(|w| {
            w.set_usb_otg_hsen(true);
            w.set_usb_otg_hsulpien(true);
        });
        RCC.ahb1rstr().modify(|w| w.set_usb_otg_hsrst(true));
        RCC.ahb1rstr().modify(|w| w.set_usb_otg_hsrst(false));
    });
    interrupt::OTG_HS.set_priority(priority);
    interrupt::OTG_HS.unpend();
    // SAFETY: its handler works on this driver's state only, which is ready from the start.
    unsafe { interrupt::OTG_HS.enable() };
    Host::new()
}

/// Makes the core a host with DMA, and gives the port power.
pub async fn start_core() {
    // The PHY is outside, switches the port's power, and has a clock of its own.
    OTG.gccfg_v2().modify(|w| w.set_pwrdwn(false));
    OTG.gusbcfg().modify(|w| {
        w.set_physel(false);
        w.set_tsdps(false);
        w.set_ulpifsls(false);
        w.set_ulpievbusi(false);
        w.set_ulpievbusd(true);
    });
    wait(|| OTG.grstctl().read().ahbidl());
    OTG.grstctl().modify(|w| w.set_csrst(true));
    wait(|| !OTG.grstctl().read().csrst());
    OTG.gusbcfg().modify(|w| {
        w.set_fhmod(true);
        w.set_fdmod(false);
    });
    Timer::after_millis(HOST_MODE_MS).await;

    OTG.pcgcctl().write_value(regs::Pcgcctl(0));
    OTG.hcfg().modify(|w| {
        w.set_fslspcs(0);
        w.set_fslss(false);
    });
    OTG.grxfsiz().write(|w| w.set_rxfd(RECEIVE_WORDS));
    OTG.hnptxfsiz().write(|w| {
        w.set_sa(RECEIVE_WORDS);
        w.set_fd(SEND_WORDS);
    });
    OTG.hptxfsiz().write(|w| {
        w.set_sa(RECEIVE_WORDS + SEND_WORDS);
        w.set_fd(PERIODIC_WORDS);
    });
    flush();
    OTG.gintsts().write_value(regs::Gintsts(u32::MAX));
    // No starts of frames, which come 8000 times a second, and nothing that DMA takes care of.
    OTG.gintmsk().write(|w| {
        w.set_prtim(true);
        w.set_hcim(true);
        w.set_discint(true);
    });
    port(|w| w.set_ppwr(true));
    OTG.gahbcfg().write(|w| {
        w.set_hbstlen(BURST);
        w.set_dmaen(true);
        w.set_gint(true);
    });
}

/// Empties the core's FIFOs.
pub fn flush() {
    OTG.grstctl().write(|w| {
        w.set_txfflsh(true);
        w.set_txfnum(ALL);
    });
    wait(|| !OTG.grstctl().read().txfflsh());
    OTG.grstctl().write(|w| w.set_rxfflsh(true));
    wait(|| !OTG.grstctl().read().rxfflsh());
}

/// Waits for the core, but not for ever: without its PHY's clock it stands still, and nothing is found at the port.
fn wait(done: impl Fn() -> bool) {
    (0..LOOKS).find(|_| done());
}

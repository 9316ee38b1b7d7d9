//! What becomes of a program that cannot go on: what happened is kept over a reset, and shown after it.
#![expect(unsafe_code, reason = "a handler of an exception; memory that a reset keeps")]

use core::fmt::Display;
use core::mem::MaybeUninit;

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use embassy_stm32::pac::RCC;
use evtach_firmware::instrument::Fault;
use evtach_firmware::kept::{self, KEPT_BYTES, KeptFault};

use crate::trap;

/// The last fault. Not cached: what a cache holds, a reset loses.
#[unsafe(link_section = ".kept")]
static mut KEPT: MaybeUninit<[u8; KEPT_BYTES]> = MaybeUninit::uninit();

/// The fault before this start: what was kept, or else that the watchdog reset the board.
pub fn take_kept() -> Option<KeptFault> {
    let place = (&raw mut KEPT).cast::<u8>();
    // Once a start. After power-on it holds anything, of which `take` tells a fault by its checksum.
    // SAFETY: any bytes will do, nothing refers to them, and handlers that write them do not return.
    let mut block = unsafe { trap::read_kept(place) };
    let fault = kept::take(&mut block);
    // SAFETY: as above.
    unsafe { trap::write_kept(place, &block) };
    let watchdog = RCC.csr().read().wdgrstf();
    RCC.csr().modify(|csr| csr.set_rmvf(true));
    let bitten = || KeptFault::new(Fault::Watchdog, "the screen was not drawn for four seconds");
    fault.or_else(|| watchdog.then(bitten))
}

/// Starts the program anew for what must not happen.
pub fn stop(fault: Fault, what: &dyn Display) -> ! {
    cortex_m::interrupt::disable();
    defmt::error!("{}", defmt::Display2Format(what));
    let block = kept::encode(&KeptFault::new(fault, what));
    // SAFETY: nothing refers to it, and nothing but this runs any more.
    unsafe { trap::write_kept((&raw mut KEPT).cast(), &block) };
    SCB::sys_reset();
}

/// The crystal has stopped: the chip goes on at its own clock, and nothing that is measured counts.
#[exception]
unsafe fn NonMaskableInt() {
    stop(Fault::Crystal, &"the 25 MHz from X2 stopped");
}

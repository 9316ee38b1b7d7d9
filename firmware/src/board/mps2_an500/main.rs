//! The tachometer on QEMU's mps2-an500: events from a file of the host, readings to its console.
//!
//! `cargo q -- FILE [sensor]` plays a recording of [`evtach_firmware::record`]s, as fast as it is
//! measured, or with `sensor` as fast as it was recorded. `EVTACH_FLASH=STREAM.spi cargo q -- spi [sensor]` reads
//! what a bridge sends ([`evtach_firmware::sensor::spi`]) through the SPI controller, from a serial flash that holds
//! it. Exit code 0: a speed was read; 1: none was;
//! 2: bad usage or input; 101: panic; 102: fault.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod bench;
#[cfg(target_os = "none")]
mod console;
#[cfg(target_os = "none")]
mod device;
#[cfg(target_os = "none")]
mod fault;
#[cfg(target_os = "none")]
mod injection;
#[cfg(target_os = "none")]
#[path = "../memory.rs"]
mod memory;
#[cfg(target_os = "none")]
mod pl022;
#[cfg(target_os = "none")]
mod program;
#[cfg(target_os = "none")]
mod psram;
#[cfg(target_os = "none")]
mod register;
#[cfg(target_os = "none")]
#[path = "../stack.rs"]
mod stack;
#[cfg(target_os = "none")]
#[path = "../tape.rs"]
mod tape;
#[cfg(target_os = "none")]
mod timers;
#[cfg(target_os = "none")]
#[path = "../trap.rs"]
mod trap;
#[cfg(target_os = "none")]
mod uart;
#[cfg(target_os = "none")]
mod usage;
#[cfg(target_os = "none")]
mod watchdog;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This is a program for an emulated board. `cargo q -- FILE` runs it in QEMU.");
}

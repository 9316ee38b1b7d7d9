//! The tachometer on ST's STM32F746G-DISCO: a camera in the high-speed USB port, readings on the screen and over the
//! full-speed USB port.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod apart;
#[cfg(target_os = "none")]
mod cache;
#[cfg(target_os = "none")]
mod clock;
#[cfg(target_os = "none")]
mod device;
#[cfg(target_os = "none")]
mod display;
#[cfg(target_os = "none")]
mod fault;
#[cfg(target_os = "none")]
mod flash;
#[cfg(target_os = "none")]
mod input;
#[cfg(target_os = "none")]
#[path = "../memory.rs"]
mod memory;
#[cfg(target_os = "none")]
mod otg_hs;
#[cfg(target_os = "none")]
mod panel;
#[cfg(target_os = "none")]
mod port;
#[cfg(target_os = "none")]
mod program;
#[cfg(target_os = "none")]
mod sdram;
#[cfg(target_os = "none")]
mod spare;
#[cfg(target_os = "none")]
#[path = "../stack.rs"]
mod stack;
#[cfg(target_os = "none")]
#[path = "../tape.rs"]
mod tape;
#[cfg(target_os = "none")]
#[path = "../trap.rs"]
mod trap;
#[cfg(target_os = "none")]
mod watchdog;
#[cfg(target_os = "none")]
mod wiring;

#[cfg(not(target_os = "none"))]
fn main() {
    println!(
        "This is a program for the STM32F746G-DISCO. `cargo fw` builds it, `cargo flash` flashes it."
    );
}

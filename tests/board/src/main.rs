//! An emulated STM32F746G-DISCO that runs the very image a user flashes.
//!
//! The processor is the Unicorn engine's Cortex-M7, which is GPL-2.0; so is this program, and nothing else of the
//! project links it. It is a process of its own: what crosses are files, pictures, lines of text and a
//! pseudo-terminal.
//!
//! It proves firmware, drivers and protocols together. It proves nothing about silicon: its USB cores do what the
//! reference manual and known drivers say, time is one cycle an instruction, there are no caches and nothing
//! is analogue.

mod board;
mod chip;
mod cpu;
mod image;
mod machine;
mod rtt;
mod time;
mod usb;

fn main() -> anyhow::Result<()> {
    let path = std::env::args().nth(1).unwrap_or_default();
    let image = image::Image::read(path.as_ref())?;
    let mut machine = machine::Machine::new(image)?;
    for step in 1..=20 {
        machine.run_until(step * 100 * time::MS)?;
        println!("{} {}", machine.now() / time::MS, machine.place());
        for line in machine.rtt.lines.drain(..) { println!("{line}"); }
        if let Some(at) = machine.image.symbol("LOG") { println!("{:x?}", machine.words(at, 16)); }
        for line in machine.faults.drain(..) { println!("{line}"); }
    }
    Ok(())
}

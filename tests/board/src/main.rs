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
mod injury;
mod live;
mod machine;
mod rtt;
mod script;
mod time;
mod usb;

use std::io::{BufRead as _, Write as _, stdin, stdout};
use std::path::PathBuf;

use anyhow::Result;
use clap::Parser;

/// Runs a firmware image on an emulated STM32F746G-DISCO.
#[derive(Parser)]
#[command(
    version,
    about,
    after_help = "Lines on stdin say what is done with the device; see src/script.rs."
)]
struct Args {
    /// The image, as it is flashed.
    image: PathBuf,
    /// In real time, with the serial port on a pseudo-terminal, the log on stderr, and the screen in this file.
    #[arg(long, value_name = "FILE.png")]
    live: Option<PathBuf>,
}

fn main() -> Result<()> {
    let args = Args::parse();
    let machine = machine::Machine::new(image::Image::read(&args.image)?)?;
    let mut script = script::Script::new(machine);
    if let Some(screen) = args.live {
        return live::run(script, &screen);
    }
    for line in stdin().lock().lines() {
        let answer = match script.line(&line?) {
            Ok(answer) => format!("ok {answer}"),
            Err(error) => format!("error {}", format!("{error:#}").replace('\n', " ")),
        };
        writeln!(stdout(), "{}", answer.trim_end())?;
        stdout().flush()?;
    }
    Ok(())
}

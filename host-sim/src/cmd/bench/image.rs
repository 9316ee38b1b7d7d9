//! `evtach bench image`: the image for the STM32F746G-DISCO, what it takes, and as a file that the board's own debug probe
//! flashes when it is dragged onto its drive. Exit code 1 past what is asked of flash or RAM.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use evtach_host::device;

use super::budget::{ASKED_FLASH_BYTES, ASKED_RAM_BYTES};
use super::say_line;
use crate::cmd::tell;

/// Arguments of `evtach bench image`.
#[derive(clap::Args)]
pub struct Args {
    /// Where the image goes, as it lies in flash.
    #[arg(value_name = "OUT.bin")]
    out: Option<PathBuf>,
}

/// SDRAM: two frames of the display, and what is left for recordings (firmware/src/board/stm32f746g_disco/sdram.rs).
const FRAMES_BYTES: u64 = 2 * 480 * 272 * 2;
const RECORDING_BYTES: u64 = 7 << 20;

/// Runs the subcommand.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    tell("building the firmware");
    let image = device::build_for_board()?;
    say_line(image.path.display())?;
    let ram_bytes = image.ram_bytes + image.stack_bytes;
    let mut fits = true;
    for (what, is, asked) in [
        ("flash, bytes", image.flash_bytes, ASKED_FLASH_BYTES),
        ("internal RAM, bytes", ram_bytes, ASKED_RAM_BYTES),
    ] {
        let verdict = if is <= asked { "" } else { "  TOO MUCH" };
        fits &= is <= asked;
        say_line(format!("  {what:<24}{is:>10} of {asked}{verdict}"))?;
    }
    say_line(format!("    variables             {:>10}", image.ram_bytes))?;
    say_line(format!("    stack                 {:>10}", image.stack_bytes))?;
    say_line(format!(
        "  SDRAM, bytes            {:>10} frames, {RECORDING_BYTES} recordings",
        FRAMES_BYTES
    ))?;
    if let Some(out) = &args.out {
        fs::write(out, &image.flash).with_context(|| format!("cannot write {}", out.display()))?;
        say_line(format!("{}: copy it to the drive of the board", out.display()))?;
    }
    Ok(ExitCode::from(u8::from(!fits)))
}

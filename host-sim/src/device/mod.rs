//! The firmware in QEMU: its image, and what it says to a recording.

mod image;
mod output;
mod run;
mod session;

use std::path::PathBuf;

pub use image::{Image, build, build_for_board};
pub use output::{Acquired, CallCost, DeviceReading, MemoryUse, Output};
pub use run::{Pace, qemu_present, run, run_screen, run_spi, write_recording};
pub use session::{Plugged, Session, Used, run_instrument};

/// Instructions in one tick of the board's 25 MHz timers, at QEMU's `-icount shift=0`.
pub const INSTRUCTIONS_PER_TICK: u64 = 40;

/// Instructions that a step of the measurement may take at most: while it runs no event is taken in, and the blocks between
/// acquiring and measuring hold 4 ms at 1 Mev/s.
pub const MOST_IN_STEP: u64 = 1_000_000;

/// Why the device gave no answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// A program could not be started.
    #[error("cannot start {program}: {source}; `./ci.sh install` installs what is missing")]
    Start {
        /// The program.
        program: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The firmware does not build.
    #[error("the firmware does not build: run `cargo {alias}` in {} to see why", .root.display())]
    Build {
        /// The alias in .cargo/config.toml that builds it.
        alias: &'static str,
        /// Where.
        root: PathBuf,
    },
    /// The image is not what the linker should have written.
    #[error("{}: {source}; run `cargo fw-qemu` to build it anew", .path.display())]
    Image {
        /// The image.
        path: PathBuf,
        /// What is wrong with it.
        source: object::Error,
    },
    /// A file could not be read or written.
    #[error("{}: {source}; see that there is room and permission", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// More events than the header of a recording for the device can count.
    #[error(
        "{0} events are more than a recording for the device can hold: cut it with --start and --end"
    )]
    TooManyEvents(usize),
    /// A stream that the emulated flash does not hold.
    #[error(
        "{0} bytes are more than the emulated flash holds (16 MiB): cut the recording with --start and --end"
    )]
    TooLongStream(usize),
    /// The firmware stopped on its own.
    #[error("the firmware ended with code {code}: {message}")]
    Failed {
        /// Exit code: 2 bad input, 101 panic, 102 fault.
        code: i32,
        /// What it said.
        message: String,
    },
    /// The firmware said something that nobody expects.
    #[error(
        "the firmware's line {line} is not understood: \"{text}\"; image and program differ, build both"
    )]
    Line {
        /// Line, counted from 1.
        line: usize,
        /// The line.
        text: String,
    },
}

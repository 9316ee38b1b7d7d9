//! The portable part of the handheld tachometer: what runs on every board, and on a PC under test.
//!
//! Data flows one way: a source of bytes, [`record`]s, [`intake`] (which never waits for a
//! measurement), [`measure`], and a [`report`] line for each reading. A board under `board/` names pins,
//! peripherals and interrupts, and nothing else.
#![no_std]

#[cfg(any(test, feature = "emulated-camera"))]
extern crate std;

pub mod cost;
pub mod instrument;
pub mod intake;
pub mod kept;
pub mod measure;
pub mod record;
pub mod recorder;
pub mod report;
pub mod scpi;
pub mod sensor;
pub mod settings;
pub mod tasks;
#[cfg(test)]
mod test_time;
pub mod ui;

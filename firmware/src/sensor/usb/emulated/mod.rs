//! The other end of the cable, for tests and for the emulated board: cameras that answer as iniVation's do, and a port
//! for them on the PC.
//!
//! Built with the feature `emulated-camera` or under test, for programs with an allocator; never part of an image.

mod camera;
mod port;
mod words;

use std::vec::Vec;

use evtach_core::decode::Mounting;
use evtach_core::{Event, PackedEvent};

use super::Model;
use super::stream::Stream;
use crate::sensor::outlet::{Filled, Words as _};

pub use camera::{Camera, Fault, Filters, Packet, Stalled, swinging};
pub use port::{Act, Device, Pipe, Port, World};
pub use words::{DavisWords, DvxplorerWords, GyroRange};

/// What the device makes of transfers, and how much of them it took for damage: words, and halves of words.
#[must_use]
pub fn decode<'t>(
    model: Model,
    swap_xy: bool,
    transfers: impl IntoIterator<Item = &'t [u8]>,
) -> (Vec<Event>, u64) {
    let mut stream = Stream::new(model, Mounting { swap_xy, flip_gyro_z: false }, None);
    let mut events = Vec::new();
    for transfer in transfers {
        let mut words = stream.words(transfer);
        while !words.is_done() {
            let mut space = [PackedEvent::ZERO; 64];
            let Filled { events: count, mut near_us, .. } = words.fill(&mut space);
            for packed in &space[..count] {
                let event = packed.unpack(near_us);
                near_us = event.t_us;
                events.push(event);
            }
        }
    }
    (events, stream.unknown() + u64::from(stream.odd_bytes))
}

extern crate std;

use std::boxed::Box;
use std::format;
use std::string::{String, ToString};
use std::vec;
use std::vec::Vec;

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::{Channel, Receiver};
use embassy_time::{Duration, Instant, Timer};
use embassy_usb_driver::Speed;
use embassy_usb_driver::host::PipeError;
use embassy_usb_host::BusState;
use evtach_core::{Event, Geometry, GyroSample, Polarity};

use super::emulated::{Act, Camera, Device, Fault, Port, World};
use super::*;
use crate::intake::{BLOCK_EVENTS, BLOCKS, Block};
use crate::test_time::block_on;

mod faults;
mod rates;
mod refusals;
mod start_up;
mod streams;
mod torn;

/// What came out of a port.
#[derive(Debug)]
struct Heard {
    events: Vec<Event>,
    gyro: Vec<GyroSample>,
    lost: u64,
    geometry: Option<Geometry>,
    /// Every camera and every trouble, in the order in which they were told.
    stands: Vec<(Option<Model>, Option<Trouble>)>,
    acquired: Acquired,
    /// Until it was over.
    took: Duration,
}

impl Heard {
    const NOTHING: Self = Self {
        events: Vec::new(),
        gyro: Vec::new(),
        lost: 0,
        geometry: None,
        stands: Vec::new(),
        acquired: Acquired::NONE,
        took: Duration::from_ticks(0),
    };
}

/// Lets a port run for so long, or until `done` says so, with somebody who takes every block.
fn run(port: &Port, most_ev_s: u32, ms: u64, done: impl Fn(&Acquired, &World) -> bool) -> Heard {
    let state = Box::leak(Box::new(BusState::new()));
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (mut sender, mut receiver) = channel.split();
    let mut heard = Heard::NOTHING;
    let mut stands = Vec::new();
    let mut acquired = Acquired::NONE;
    let over = core::cell::Cell::new(false);
    let told = |now: &Acquired| {
        // Before the next transfer, so that a machine that was busy elsewhere is no reason to thin.
        drain(&mut receiver, &mut heard);
        acquired = *now;
        let stand = (now.camera.map(|camera| camera.model), now.trouble);
        if stands.last() != Some(&stand) {
            stands.push(stand);
        }
        over.set(done(now, &port.0.borrow()));
    };
    let acquiring = acquire(port.clone(), state, &mut sender, most_ev_s, told);
    let took = block_on(async {
        let begun = Instant::now();
        let waiting = async {
            while begun.elapsed() < Duration::from_millis(ms) && !over.get() {
                Timer::after_micros(500).await;
            }
        };
        match select(acquiring, waiting).await {
            Either::First(never) => never,
            Either::Second(()) => begun.elapsed(),
        }
    });
    Heard { acquired, stands, took, ..heard }
}

fn drain(blocks: &mut Receiver<'_, NoopRawMutex, Block>, heard: &mut Heard) {
    while let Some(block) = blocks.try_receive() {
        heard.events.extend(block.events().iter().map(|event| event.unpack(block.t_us)));
        heard.gyro.extend(block.gyro.iter());
        heard.lost += block.lost;
        heard.geometry = Some(block.geometry);
        blocks.receive_done();
    }
}

/// A rate that nothing reaches.
const ANY: u32 = u32::MAX;

fn never(_: &Acquired, _: &World) -> bool {
    false
}

/// Every event has been sent.
fn all_sent(_: &Acquired, world: &World) -> bool {
    world.camera().is_some_and(Camera::is_done)
}

fn plug(camera: Camera) -> Act {
    Act::Plug(Device::Camera(Box::new(camera)), Speed::High)
}

/// So many events, evenly, over the whole sensor.
fn events(model: Model, count: u64, ev_s: u64) -> Vec<Event> {
    let Geometry { width_px, height_px } = model.geometry();
    (0..count)
        .map(|index| Event {
            t_us: index * 1_000_000 / ev_s,
            x: (index * 7 % u64::from(width_px)) as u16,
            y: (index / 3 * 5 % u64::from(height_px)) as u16,
            polarity: if index % 3 == 0 { Polarity::Off } else { Polarity::On },
        })
        .collect()
}

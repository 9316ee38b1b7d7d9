//! A camera at the device's USB host port: the whole way from its words to readings, by the firmware's own tasks, gives
//! what the PC gives for the events that the camera saw.

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::Channel;
use embassy_time::{Duration, MockDriver, Timer};
use embassy_usb_driver::Speed;
use embassy_usb_host::BusState;
use evtach_core::limits::{DEVICE_EVENTS, DEVICE_HEAT_CELLS};
use evtach_core::{
    Event, GyroSample, Memory, Reading, Settings, Status, StoredEvent, Tachometer, Work,
};
use evtach_firmware::cost::{Costs, Spent};
use evtach_firmware::intake::{BLOCKS, Block, Pace};
use evtach_firmware::measure::{Companion, measure};
use evtach_firmware::sensor::usb::emulated::{Act, Camera, Device, World};
use evtach_firmware::sensor::usb::{Acquired, Model, acquire};
use evtach_host::measure::{Capacity, measure_events};
use evtach_host::synth::{self, Rotor, Scene};

/// Time that passes when everything waits, and behind each step of the measurement: thousands of these in a search.
const STEP: Duration = Duration::from_micros(20);

/// Runs a future in a time that stands still while anything is worked on. One at a time: there is one time.
fn block_on<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        MockDriver::get().advance(STEP);
    }
}

#[derive(Default)]
struct Readings(Vec<Reading>);

impl Companion for Readings {
    fn measured(&mut self, reading: &Reading, _: Spent) {
        self.0.push(reading.clone());
    }
}

/// What the device reads from a camera that sees these events.
fn read_over_usb(model: Model, events: Vec<Event>) -> (Vec<Reading>, Acquired) {
    let camera = Device::Camera(Box::new(Camera::new(model, events)));
    let port = World::begin(vec![(0, Act::Plug(camera, Speed::High))]);
    let state = Box::leak(Box::new(BusState::new()));
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (mut sender, mut receiver) = channel.split();
    let mut store = vec![StoredEvent::default(); DEVICE_EVENTS];
    let (mut heat, mut weights) = (vec![0; DEVICE_HEAT_CELLS], vec![0; DEVICE_HEAT_CELLS]);
    let mut work = Box::new(Work::EMPTY);
    let memory =
        Memory { events: &mut store, heat: &mut heat, weights: &mut weights, work: &mut work };
    let mut tachometer = Tachometer::new(Settings::new(model.geometry()), memory);
    let mut readings = Readings::default();
    let mut acquired = Acquired::NONE;
    let (mut costs, looking) = (Costs::new(()), port.clone());
    let acquiring = acquire(port, state, &mut sender, u32::MAX, |now| acquired = *now);
    let measuring = measure(&mut tachometer, &mut receiver, Pace::Live, &mut costs, &mut readings);
    let watching = async {
        while !looking.0.borrow().camera().is_some_and(Camera::is_done) {
            Timer::after_millis(1).await;
        }
        // What is in the blocks is measured.
        Timer::after_millis(200).await;
    };
    block_on(select(watching, select(acquiring, measuring)));
    (readings.0, acquired)
}

fn compare(model: Model, scene: Scene) {
    let geometry = model.geometry();
    let scene = Scene { width_px: geometry.width_px, height_px: geometry.height_px, ..scene };
    let events = synth::generate(&scene).expect("a scene in range").events;
    // The gyro says a thousand times a second, or 800 times, that the camera does not roll.
    let every_us = if model == Model::Davis346 { 1_000 } else { 1_250 };
    let gyro: Vec<GyroSample> = (0..(scene.duration_ms * 1e3) as u64)
        .step_by(every_us)
        .map(|t_us| GyroSample { t_us, roll_rad_s: 0.0 })
        .collect();
    let (here, _) = measure_events(&events, &gyro, Settings::new(geometry), Capacity::Device);
    let count = events.len() as u64;
    let (there, acquired) = read_over_usb(model, events);
    assert_eq!(acquired.delivered.used(), count, "{acquired}");
    assert_eq!(acquired.seen(), count);
    // The PC reads on to the last window, which is not full.
    assert!(there.len() >= 3 && there.len() <= here.len(), "{} of {}", there.len(), here.len());
    for (there, here) in there.iter().zip(&here) {
        assert_eq!(format!("{there:?}"), format!("{here:?}"), "{model:?}");
    }
    let locked = |reading: &Reading| reading.rotors.iter().any(|r| r.status == Status::Locked);
    assert!(there.iter().any(locked), "{model:?}: nothing that is worth comparing");
}

#[test]
fn what_a_camera_saw_is_read_as_the_pc_reads_it() {
    let rotor = Rotor { x_px: 150.0, y_px: 130.0, blades: 3, rpm: 2_400.0, ..Rotor::default() };
    let scene = Scene { rotors: vec![rotor], duration_ms: 800.0, ..Scene::default() };
    for model in Model::ALL {
        compare(model, scene.clone());
    }
}

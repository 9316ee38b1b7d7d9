//! A camera at the device's USB host port: the whole way from its words to readings, by the firmware's own tasks, gives
//! what the PC gives for the events that the camera saw.

use core::pin::pin;
use core::task::{Context, Poll, Waker};
use std::sync::{Mutex, PoisonError};

use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::zerocopy_channel::Channel;
use embassy_time::{Duration, MockDriver, Timer};
use embassy_usb_driver::Speed;
use embassy_usb_host::BusState;
use evtach_core::decode::{Davis, Dvxplorer, Mounting};
use evtach_core::{Event, Frame, GyroSample, Reading, Settings, Status};
use evtach_firmware::cost::{Costs, Spent};
use evtach_firmware::intake::{BLOCKS, Block, Pace};
use evtach_firmware::measure::{Companion, measure};
use evtach_firmware::sensor::usb::emulated::{
    Act, Camera, DavisWords, Device, DvxplorerWords, GyroRange, World, swinging,
};
use evtach_firmware::sensor::usb::{Acquired, Model, acquire};
use evtach_host::measure::{Capacity, measure_events, with_tachometer};
use evtach_host::synth::{self, Rotor, Scene};

/// Time that passes when everything waits, and behind each step of the measurement: thousands of these in a search.
const STEP: Duration = Duration::from_micros(20);

/// Runs a future in a time that stands still while anything is worked on. One at a time: there is one time.
fn block_on<T>(future: impl Future<Output = T>) -> T {
    static TIME: Mutex<()> = Mutex::new(());
    // A test that failed with it leaves nothing behind.
    let _mine = TIME.lock().unwrap_or_else(PoisonError::into_inner);
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

/// What the device reads from a camera that sees these events, while its gyro swings by so much about a mean.
fn read_over_usb(
    model: Model,
    events: Vec<Event>,
    (mean_rad_s, swing_rad_s): (f32, f32),
) -> (Vec<Reading>, Acquired) {
    let mut camera = Camera::new(model, events);
    (camera.roll_rad_s, camera.swing_rad_s) = (mean_rad_s, swing_rad_s);
    let camera = Device::Camera(Box::new(camera));
    let port = World::begin(vec![(0, Act::Plug(camera, Speed::High))]);
    let state = Box::leak(Box::new(BusState::new()));
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (mut sender, mut receiver) = channel.split();
    let mut readings = Readings::default();
    let mut acquired = Acquired::NONE;
    let (mut costs, looking) = (Costs::new(()), port.clone());
    let acquiring = acquire(port, state, &mut sender, u32::MAX, |now| acquired = *now);
    let watching = async {
        while !looking.0.borrow().camera().is_some_and(Camera::is_done) {
            Timer::after_millis(1).await;
        }
        // What is in the blocks is measured.
        Timer::after_millis(200).await;
    };
    with_tachometer(Settings::new(model.geometry()), Capacity::Device, |tachometer| {
        let measuring = measure(tachometer, &mut receiver, Pace::Live, &mut costs, &mut readings);
        block_on(select(watching, select(acquiring, measuring)))
    });
    (readings.0, acquired)
}

/// What is made of the words of a camera's gyro that swings by so much about a mean: a thousand samples a second, or 800.
fn swung(model: Model, (mean_rad_s, swing_rad_s): (f32, f32), lasts_us: u64) -> Vec<GyroSample> {
    let mounting = Mounting::default();
    let mut davis = (DavisWords::default(), Davis::new(mounting));
    let mut dvxplorer = (DvxplorerWords::default(), Dvxplorer::new(mounting));
    let heard = |t_us: u64| {
        let roll_rad_s = mean_rad_s + swinging(swing_rad_s, t_us);
        let (said, mut words) = (GyroSample { t_us, roll_rad_s }, Vec::new());
        let mut samples = match model {
            Model::Davis346 => {
                davis.0.gyro(&said, GyroRange::davis346(1), &mut words);
                words.iter().filter_map(|word| davis.1.decode(*word, |_| {})).collect::<Vec<_>>()
            }
            Model::Dvxplorer => {
                dvxplorer.0.gyro(&said, GyroRange::dvxplorer(2), &mut words);
                words.iter().filter_map(|word| dvxplorer.1.decode(*word, |_| {})).collect()
            }
        };
        // In whole steps of the gyro, at the time of which the camera tells no less.
        let roll_rad_s = samples.pop().expect("a sample").roll_rad_s;
        GyroSample { t_us, roll_rad_s }
    };
    let every_us = if model == Model::Davis346 { 1_000 } else { 1_250 };
    (0..lasts_us).step_by(every_us).map(heard).collect()
}

fn compare(model: Model, scene: Scene, roll_rad_s: (f32, f32)) -> Vec<Reading> {
    let geometry = model.geometry();
    let scene = Scene { width_px: geometry.width_px, height_px: geometry.height_px, ..scene };
    let mut events = synth::generate(&scene).expect("a scene in range").events;
    // The camera's clock begins with the first event.
    let first_us = events.first().map_or(0, |event| event.t_us);
    events.iter_mut().for_each(|event| event.t_us -= first_us);
    let gyro = swung(model, roll_rad_s, (scene.duration_ms * 1e3) as u64);
    let (here, _) = measure_events(&events, &gyro, Settings::new(geometry), Capacity::Device);
    let count = events.len() as u64;
    let (there, acquired) = read_over_usb(model, events, roll_rad_s);
    assert_eq!(acquired.delivered.used(), count, "{acquired}");
    assert_eq!(acquired.seen(), count);
    // The PC reads on to the last window, which is not full.
    assert!(there.len() >= 3 && there.len() <= here.len(), "{} of {}", there.len(), here.len());
    for (there, here) in there.iter().zip(&here) {
        assert_eq!(format!("{there:?}"), format!("{here:?}"), "{model:?}");
    }
    let locked = |reading: &Reading| reading.rotors.iter().any(|r| r.status == Status::Locked);
    assert!(there.iter().any(locked), "{model:?}: nothing that is worth comparing");
    there
}

#[test]
fn what_a_camera_saw_is_read_as_the_pc_reads_it() {
    let rotor = Rotor { x_px: 150.0, y_px: 130.0, blades: 3, rpm: 2_400.0, ..Rotor::default() };
    let scene = Scene { rotors: vec![rotor], duration_ms: 800.0, ..Scene::default() };
    for model in Model::ALL {
        compare(model, scene.clone(), (0.0, 0.0));
    }
}

/// From a hand, relative to the room, once the gyro's offset is found.
#[test]
fn speeds_in_the_room_are_those_of_the_pc() {
    for model in Model::ALL {
        let (x_px, y_px) = (150.0, 130.0);
        let rotor = Rotor { x_px, y_px, rpm: 1_500.0, radius_px: 22.0, ..Rotor::default() };
        let mut scene = Scene { rotors: vec![rotor], duration_ms: 9_000.0, ..Scene::default() };
        scene.sensor.noise_hz = 0.0;
        scene.camera.tremor_px = 3.0;
        let readings = compare(model, scene, (0.02, 0.25));
        let in_the_room = |reading: &&Reading| {
            let speed = reading.rotors.first().and_then(|rotor| rotor.speed);
            speed.is_some_and(|speed| speed.frame == Frame::Room)
        };
        let count = readings.iter().filter(in_the_room).count();
        assert!(count > 10 && count < readings.len(), "{count} of {}", readings.len());
    }
}

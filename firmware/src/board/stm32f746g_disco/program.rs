//! The instrument: acquire, measure, show, answer, for good.

use core::cell::RefCell;
use core::pin::pin;

use embassy_futures::join::join3;
use embassy_stm32::uid::uid_hex;
use embassy_sync::zerocopy_channel::{Receiver, Sender};
use embassy_time::{Duration, Timer};
use embassy_usb_host::BusState;
use evtach_core::Tachometer;
use evtach_firmware::cost::Costs;
use evtach_firmware::instrument::{Fault, Picture, Preferences, SATURATION_EV_S};
use evtach_firmware::intake::{Block, Pace};
use evtach_firmware::kept::KeptFault;
use evtach_firmware::measure::measure;
use evtach_firmware::sensor::spi::{self, AlwaysReady, SpiSensor};
use evtach_firmware::sensor::usb;
use evtach_firmware::settings::Store;
use evtach_firmware::tasks::{self, Front, Measuring, Shared, Task};
use evtach_firmware::ui::Screen;
use static_cell::{ConstStaticCell, StaticCell};

use crate::apart::Apart;
use crate::flash::{self, Replay, SharedFlash};
use crate::memory::Mutex;
use crate::otg_hs::Host;
use crate::panel::Panel;
use crate::tape::Tape;
use crate::wiring::{InputPins, PortPins, WatchdogParts};
use crate::{fault, input, port, watchdog};

/// What the tasks share.
static SHARED: Shared = Shared::new();

/// The front, which screen, link, touch and button share.
pub type SharedFront = RefCell<Front<Tape, Panel>>;

/// Time between two drawings of a device that does not measure.
const DEAD_FRAME: Duration = Duration::from_millis(250);

/// What the front's task begins with.
pub struct Parts {
    pub panel: Panel,
    pub port: PortPins,
    pub watchdog: WatchdogParts,
}

/// What the front shows.
pub enum Shows {
    /// An instrument, and what happened before this start.
    Instrument { kept: Option<KeptFault>, flash: &'static SharedFlash, input: InputPins },
    /// Why nothing can be measured.
    Dead(KeptFault),
}

/// Makes the front. Not inlined, because that is built on the stack first.
#[inline(never)]
fn front(panel: Panel, preferences: Preferences, kept: Option<KeptFault>) -> &'static SharedFront {
    static FRONT: StaticCell<SharedFront> = StaticCell::new();
    static PICTURE: ConstStaticCell<Picture> = ConstStaticCell::new(Picture::EMPTY);
    SHARED.lend(PICTURE.take());
    FRONT.init_with(|| RefCell::new(Front::new(&SHARED, preferences, kept, Tape, panel, uid_hex())))
}

/// Where events come from.
pub enum Source {
    /// Whatever camera is in the USB host port.
    Camera(Host),
    /// The recording in the serial flash, for bring-up with no camera.
    Replay(&'static SharedFlash),
}

/// Reads the sensor. One task for both, so that they share its memory.
#[embassy_executor::task]
pub async fn acquire_task(source: Source, mut blocks: Sender<'static, Mutex, Block>) {
    static BUS: BusState = BusState::new();
    match source {
        Source::Camera(host) => {
            let told = |acquired: &usb::Acquired| SHARED.tell(acquired.into());
            Apart(pin!(usb::acquire(host, &BUS, &mut blocks, SATURATION_EV_S, told))).await;
        }
        Source::Replay(flash) => {
            Apart(pin!(replay(flash, &mut blocks))).await;
        }
    }
}

async fn replay(flash: &'static SharedFlash, blocks: &mut Sender<'static, Mutex, Block>) {
    let mut sensor = SpiSensor::new(Replay::new(flash), AlwaysReady);
    let told = |acquired: &spi::Acquired| SHARED.tell(acquired.into());
    // It never ends.
    spi::acquire(&mut sensor, Pace::Replay, blocks, told).await.ok();
}

#[embassy_executor::task]
pub async fn measure_task(
    tachometer: &'static mut Tachometer<'static>,
    mut blocks: Receiver<'static, Mutex, Block>,
) {
    let mut measuring = Measuring::new(&SHARED, Tape::push);
    // Nothing on the device asks what a step costs.
    let mut costs = Costs::new(());
    measure(tachometer, &mut blocks, Pace::Live, &mut costs, &mut measuring).await;
}

/// Screen, touch, button, link and keeping the preferences: one task, so that they share the front.
#[embassy_executor::task]
pub async fn front_task(parts: Parts, shows: Shows) {
    match shows {
        Shows::Instrument { kept, flash, input } => {
            Apart(pin!(live(parts, kept, flash, input))).await;
        }
        Shows::Dead(why) => Apart(pin!(lie_dead(parts, why))).await,
    }
}

async fn live(
    parts: Parts,
    kept: Option<KeptFault>,
    flash: &'static SharedFlash,
    input: InputPins,
) {
    let mut store = Store::new(flash::Preferences(flash), 0, flash::PREFERENCES_BYTES);
    let (preferences, damaged) = Apart(pin!(store.load())).await;
    let damaged = damaged.map(|fault| KeptFault::new(fault, "the stored settings are damaged"));
    let front = front(parts.panel, preferences, kept.or(damaged));
    let (mut device, mut port) = port::start(parts.port, uid_hex());
    let feed = watchdog::start(parts.watchdog);
    let hung = |task: Task| fault::stop(Fault::Watchdog, &task.as_str());
    let showing = pin!(tasks::show(front, &SHARED, feed, hung));
    let answering = pin!(tasks::link(front, &SHARED, &mut port));
    let saving = pin!(tasks::save(front, &mut store, preferences));
    let watching = pin!(input::watch(front, input));
    let running = pin!(device.run());
    let seen = join3(Apart(showing), Apart(watching), Apart(saving));
    join3(seen, Apart(answering), Apart(running)).await;
}

/// What is left when nothing can be measured: screen and link say why, and nothing takes that away.
async fn lie_dead(parts: Parts, why: KeptFault) {
    let front = front(parts.panel, Preferences::default(), None);
    let (mut device, mut port) = port::start(parts.port, uid_hex());
    let mut feed = watchdog::start(parts.watchdog);
    let showing = async {
        let mut screen = Screen::new();
        loop {
            front.borrow_mut().fail(why.clone());
            front.borrow_mut().draw(&mut screen);
            feed();
            Timer::after(DEAD_FRAME).await;
        }
    };
    let answering = pin!(tasks::link(front, &SHARED, &mut port));
    let running = pin!(device.run());
    join3(showing, Apart(answering), Apart(running)).await;
}

//! The instrument: acquire, measure, show, answer, for good.

use core::cell::RefCell;

use embassy_futures::join::join;
use embassy_sync::zerocopy_channel::{Receiver, Sender};
use embassy_time::Timer;
use evtach_core::Tachometer;
use evtach_firmware::cost::Costs;
use evtach_firmware::instrument::{Fault, Picture, Preferences};
use evtach_firmware::intake::{Block, Pace};
use evtach_firmware::kept::KeptFault;
use evtach_firmware::measure::measure;
use evtach_firmware::sensor::spi::Acquired;
use evtach_firmware::tasks::{self, Front, Measuring, Shared, Task};
use static_cell::{ConstStaticCell, StaticCell};

use crate::fault;
use crate::memory::Mutex;
use crate::panel::Panel;
use crate::tape::Tape;
use crate::watchdog;
use crate::wiring::WatchdogParts;

/// What the tasks share.
pub static SHARED: Shared = Shared::new();

/// The front, which screen and link share.
type SharedFront = RefCell<Front<Tape, Panel>>;

/// What the front's task begins with.
pub struct Parts {
    front: &'static mut SharedFront,
    watchdog: WatchdogParts,
}

/// Makes the front. Not inlined, because that is built on the stack first.
#[inline(never)]
pub fn prepare(panel: Panel, kept: Option<KeptFault>, watchdog: WatchdogParts) -> Parts {
    static FRONT: StaticCell<SharedFront> = StaticCell::new();
    static PICTURE: ConstStaticCell<Picture> = ConstStaticCell::new(Picture::EMPTY);
    SHARED.lend(PICTURE.take());
    let serial = embassy_stm32::uid::uid_hex();
    let front = FRONT.init_with(|| {
        RefCell::new(Front::new(&SHARED, Preferences::default(), kept, Tape, panel, serial))
    });
    Parts { front, watchdog }
}

#[embassy_executor::task]
pub async fn acquire_task(_blocks: Sender<'static, Mutex, Block>) {
    loop {
        SHARED.tell_acquired(&Acquired::NONE);
        Timer::after_millis(100).await;
    }
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

/// Screen, link and keeping the preferences: one task, so that they share the front.
#[embassy_executor::task]
pub async fn front_task(parts: Parts) {
    let Parts { front, watchdog } = parts;
    let feed = watchdog::start(watchdog);
    let hung = |task: Task| fault::stop(Fault::Watchdog, task.as_str());
    let showing = tasks::show(front, &SHARED, feed, hung);
    let answering = async {
        loop {
            SHARED.alive(Task::Link);
            Timer::after_millis(50).await;
        }
    };
    join(showing, answering).await;
}

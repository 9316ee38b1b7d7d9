//! The instrument: acquire, measure, show, answer, for good.

use core::cell::{Cell, RefCell};
use core::fmt::Write as _;

use embassy_futures::block_on;
use embassy_futures::join::join3;
use embassy_futures::select::select;
use embassy_sync::blocking_mutex::Mutex as BlockingMutex;
use embassy_sync::zerocopy_channel::{Receiver, Sender};
use embassy_time::Timer;
use evtach_core::Tachometer;
use evtach_firmware::cost::Costs;
use evtach_firmware::instrument::{Fault, Picture, Preferences};
use evtach_firmware::intake::{Block, Pace};
use evtach_firmware::kept::KeptFault;
use evtach_firmware::measure::measure;
use evtach_firmware::sensor::spi::{Acquired, AlwaysReady, Flash, SpiSensor, acquire};
use evtach_firmware::settings::Store;
use evtach_firmware::tasks::{self, Front, Measuring, Shared, Task};
use semihosting::process;
use static_cell::{ConstStaticCell, StaticCell};

use crate::console::Console;
use crate::fault::{self, fail};
use crate::injection::{Injection, PowerSupply};
use crate::memory::Mutex;
use crate::pl022::{AlwaysSelected, Pl022};
use crate::psram::{PREFERENCES_BYTES, Panel, Psram};
use crate::tape::Tape;
use crate::timers::Ticks;
use crate::uart::Uart;
use crate::usage::{self, USERS, User, counted};
use crate::{stack, watchdog};

/// What the tasks share.
pub static SHARED: Shared = Shared::new();

/// What became of the events, for the report.
static ACQUIRED: BlockingMutex<Mutex, Cell<Acquired>> =
    BlockingMutex::new(Cell::new(Acquired::NONE));

/// What the front begins with.
pub struct Parts {
    front: &'static mut RefCell<Front<Tape, Panel>>,
    store: Store<PowerSupply>,
    preferences: Preferences,
    /// The fault to come: none after the reset that the first one made.
    pub injection: Injection,
}

/// Reads what was kept over power-off and reset, and makes the front. Not inlined, because that is built on the stack
/// first.
#[inline(never)]
pub fn prepare(psram: Psram, injection: Injection) -> Parts {
    static FRONT: StaticCell<RefCell<Front<Tape, Panel>>> = StaticCell::new();
    static PICTURE: ConstStaticCell<Picture> = ConstStaticCell::new(Picture::EMPTY);
    fault::restart_from_now_on();
    let Psram { panel, preferences, recording, warm, .. } = psram;
    let injection = if warm { Injection::None } else { injection };
    let flash = PowerSupply::new(preferences, injection);
    let mut store = Store::new(flash, 0, PREFERENCES_BYTES as u32);
    let (preferences, damaged) = block_on(store.load());
    let damaged = damaged.map(|fault| KeptFault::new(fault, "the stored settings are damaged"));
    let kept = if warm { fault::take_kept() } else { None };
    Tape::lend(recording);
    SHARED.lend(PICTURE.take());
    let front = FRONT.init_with(|| {
        RefCell::new(Front::new(&SHARED, preferences, kept.or(damaged), Tape, panel, "0"))
    });
    Parts { front, store, preferences, injection }
}

/// Prints who used the processor in each of so many seconds, and ends the program.
#[embassy_executor::task]
pub async fn report_task(seconds: u32) {
    let mut before = usage::ticks();
    for _ in 0..seconds {
        Timer::after_secs(1).await;
        let after = usage::ticks();
        let mut console = Console::default();
        for ((_, name), (after, before)) in USERS.iter().zip(after.iter().zip(before)) {
            writeln!(console, "used ticks={} name={name}", after - before).ok();
        }
        console.flush();
        before = after;
    }
    let mut console = Console::default();
    let (starting, running) = stack::depths();
    let acquired = ACQUIRED.lock(Cell::get);
    writeln!(
        console,
        "{acquired}\nran seconds={seconds} stack_starting={starting} stack_running={running}"
    )
    .ok();
    console.flush();
    process::exit(0)
}

#[embassy_executor::task]
pub async fn acquire_task(mut blocks: Sender<'static, Mutex, Block>, injection: Injection) {
    let flash = match Flash::open(Pl022::start(), AlwaysSelected, 0).await {
        Ok(flash) => flash,
        Err(error) => fail(error),
    };
    let mut sensor = SpiSensor::new(flash, AlwaysReady);
    let told = |acquired: &Acquired| {
        ACQUIRED.lock(|cell| cell.set(*acquired));
        SHARED.tell(acquired.into());
    };
    let acquiring = acquire(&mut sensor, Pace::Replay, &mut blocks, told);
    counted(User::Acquire, select(acquiring, injection.strike("acquire"))).await;
}

#[embassy_executor::task]
pub async fn measure_task(
    tachometer: &'static mut Tachometer<'static>,
    mut blocks: Receiver<'static, Mutex, Block>,
    injection: Injection,
) {
    let mut measuring = Measuring::new(&SHARED, Tape::push);
    let mut costs = Costs::new(Ticks);
    let measuring = measure(tachometer, &mut blocks, Pace::Replay, &mut costs, &mut measuring);
    counted(User::Measure, select(measuring, injection.strike("measure"))).await;
    loop {
        // Only where the channel of blocks is to fill up: alive, but taking none.
        SHARED.alive(Task::Measure);
        Timer::after_millis(250).await;
    }
}

/// Screen, link and keeping the preferences: one task, so that they share the front.
#[embassy_executor::task]
pub async fn front_task(parts: Parts) {
    let Parts { front, mut store, preferences, injection } = parts;
    let mut port = Uart::start();
    watchdog::start();
    let hung = |task: Task| fault::stop(Fault::Watchdog, &task.as_str());
    let showing = tasks::show(front, &SHARED, watchdog::feed, hung);
    let answering = tasks::link(front, &SHARED, &mut port);
    let saving = tasks::save(front, &mut store, preferences);
    join3(
        counted(User::Show, select(showing, injection.strike("show"))),
        counted(User::Link, select(answering, injection.strike("link"))),
        counted(User::Save, saving),
    )
    .await;
}

//! Two tasks, each at an interrupt's level: intake above, measuring below in what time is left. The
//! thread sleeps: QEMU lets time pass for WFI, but spins through the WFE of embassy's thread executor.
#![expect(unsafe_code, reason = "the vector table's link to its handlers")]

use core::arch::asm;
use core::cell::Cell;
use core::ffi::CStr;
use core::fmt::{Display, Write as _};

use cortex_m_rt::{ExceptionFrame, entry, exception};
use embassy_executor::InterruptExecutor;
use embassy_sync::blocking_mutex::Mutex as BlockingMutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::zerocopy_channel::{Channel, Receiver, Sender};
use evtach_core::limits::{DEVICE_EVENTS, DEVICE_HEAT_CELLS};
use evtach_core::{Geometry, Memory, Reading, Settings, StoredEvent, Tachometer};
use evtach_firmware::cost::{Costs, Spent};
use evtach_firmware::intake::{self, BLOCKS, Block, Pace};
use evtach_firmware::measure::measure;
use evtach_firmware::report::Lines;
use evtach_firmware::sensor::spi::{Acquired, AlwaysReady, Flash, SpiSensor, acquire};
use semihosting::experimental::env;
use semihosting::{fs, process};
use static_cell::{ConstStaticCell, StaticCell};

use crate::console::{Console, File};
use crate::pl022::{AlwaysSelected, Pl022};
use crate::stack;
use crate::timers::{self, Irq, Ticks};

type Mutex = CriticalSectionRawMutex;

static BUFFERS: ConstStaticCell<[Block; BLOCKS]> =
    ConstStaticCell::new([const { Block::EMPTY }; BLOCKS]);
static CHANNEL: StaticCell<Channel<'_, Mutex, Block>> = StaticCell::new();
static STORE: StaticCell<[StoredEvent; DEVICE_EVENTS]> = StaticCell::new();
static HEAT: ConstStaticCell<[u16; DEVICE_HEAT_CELLS]> =
    ConstStaticCell::new([0; DEVICE_HEAT_CELLS]);
static WEIGHTS: ConstStaticCell<[u8; DEVICE_HEAT_CELLS]> =
    ConstStaticCell::new([0; DEVICE_HEAT_CELLS]);
static TACHOMETER: StaticCell<Tachometer<'_>> = StaticCell::new();
/// How acquisition over SPI stands.
static ACQUIRED: BlockingMutex<Mutex, Cell<Option<Acquired>>> = BlockingMutex::new(Cell::new(None));
static INTAKE: InterruptExecutor = InterruptExecutor::new();
static MEASURE: InterruptExecutor = InterruptExecutor::new();

/// Bytes of the heat map and its weights.
const HEAT_BYTES: usize =
    size_of::<[u16; DEVICE_HEAT_CELLS]>() + size_of::<[u8; DEVICE_HEAT_CELLS]>();

// What the core may take of the 320 KB: the rest is for screen, links and stack.
const _: () = {
    assert!(size_of::<Tachometer<'_>>() + HEAT_BYTES <= 96 * 1024);
    assert!(size_of::<[StoredEvent; DEVICE_EVENTS]>() <= 128 * 1024);
};

/// Longest path on the command line, in bytes.
const PATH_BYTES: usize = 256;

#[entry]
fn main() -> ! {
    let Some(mut peripherals) = cortex_m::Peripherals::take() else {
        fail("the peripherals are taken");
    };
    timers::start(&mut peripherals.NVIC);
    let (played, pace) = command_line();
    let tachometer = tachometer();
    let (sender, receiver) = CHANNEL.init(Channel::new(BUFFERS.take())).split();

    Irq::Measure.set_priority(&mut peripherals.NVIC, 0xC0);
    Irq::Intake.set_priority(&mut peripherals.NVIC, 0x80);
    match measure_all(tachometer, receiver, pace) {
        Ok(measure) => MEASURE.start(Irq::Measure).spawn(measure),
        Err(error) => fail(error),
    }
    let intake = INTAKE.start(Irq::Intake);
    let spawned = match played {
        Played::File(file) => take_in_file(file, pace, sender).map(|task| intake.spawn(task)),
        Played::Flash => take_in_spi(pace, sender).map(|task| intake.spawn(task)),
    };
    if let Err(error) = spawned {
        fail(error);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// The tachometer over the device's memory.
///
/// A function of its own, because parts of it are built on the stack first, and `main` never gives
/// back what its frame takes.
#[inline(never)]
fn tachometer() -> &'static mut Tachometer<'static> {
    let events = STORE.init_with(|| [StoredEvent::default(); DEVICE_EVENTS]);
    let memory = Memory { events, heat: HEAT.take(), weights: WEIGHTS.take() };
    // The first block tells the sensor's size, and the tachometer is set to it.
    let size = Geometry { width_px: 320, height_px: 320 };
    TACHOMETER.init_with(|| Tachometer::new(Settings::new(size), memory))
}

/// What is played.
enum Played {
    /// A file of the host.
    File(File),
    /// What lies in the flash behind the SPI controller.
    Flash,
}

/// What the command line asks for.
fn command_line() -> (Played, Pace) {
    const USAGE: &str = "usage: FILE [sensor], or: spi [sensor]";
    let Ok(arguments) = env::args::<PATH_BYTES>() else { fail("the command line is too long") };
    let mut arguments = (&arguments).skip(1).map(|argument| argument.unwrap_or_default());
    let (Some(path), pace) = (arguments.next(), arguments.next()) else { fail(USAGE) };
    let pace = match pace {
        None => Pace::File,
        Some("sensor") => Pace::Sensor,
        Some(_) => fail(USAGE),
    };
    if path == "spi" {
        return (Played::Flash, pace);
    }
    let mut bytes = [0; PATH_BYTES];
    bytes[..path.len()].copy_from_slice(path.as_bytes());
    let Ok(path) = CStr::from_bytes_until_nul(&bytes) else { fail("the path is too long") };
    match fs::File::open(path) {
        Ok(file) => (Played::File(File(file)), pace),
        Err(error) => fail(error),
    }
}

#[embassy_executor::task]
async fn take_in_file(mut file: File, pace: Pace, mut blocks: Sender<'static, Mutex, Block>) {
    let header = match intake::open(&mut file).await {
        Ok(header) => header,
        Err(error) => fail(error),
    };
    if let Err(error) = intake::take_in(&mut file, &header, pace, &mut blocks).await {
        fail(error);
    }
}

#[embassy_executor::task]
async fn take_in_spi(pace: Pace, mut blocks: Sender<'static, Mutex, Block>) {
    let flash = match Flash::open(Pl022::start(), AlwaysSelected, 0).await {
        Ok(flash) => flash,
        Err(error) => fail(error),
    };
    let mut sensor = SpiSensor::new(flash, AlwaysReady);
    let told = |acquired: &Acquired| ACQUIRED.lock(|cell| cell.set(Some(*acquired)));
    if let Err(error) = acquire(&mut sensor, pace, &mut blocks, told).await {
        fail(error);
    }
}

#[embassy_executor::task]
async fn measure_all(
    tachometer: &'static mut Tachometer<'static>,
    mut blocks: Receiver<'static, Mutex, Block>,
    pace: Pace,
) {
    let mut console = Console::default();
    let mut costs = Costs::new(Ticks);
    let mut seen_speed = false;
    let show = |reading: &Reading, Spent { push, poll }| {
        seen_speed |= reading.rotors.iter().any(|rotor| rotor.speed.is_some());
        writeln!(console, "{}spent push={push} poll={poll}", Lines(reading)).ok();
        console.flush();
    };
    measure(tachometer, &mut blocks, pace, &mut costs, show).await;
    let mut console = Console::default();
    if let Some(acquired) = ACQUIRED.lock(Cell::get) {
        writeln!(console, "{acquired}").ok();
    }
    writeln!(
        console,
        "{costs}overrun events={}\nmemory tachometer={} store={} heat={} blocks={} stack={}",
        tachometer.ignored().overrun,
        size_of::<Tachometer<'_>>(),
        size_of::<[StoredEvent; DEVICE_EVENTS]>(),
        HEAT_BYTES,
        size_of::<[Block; BLOCKS]>(),
        stack::deepest(),
    )
    .ok();
    console.flush();
    process::exit(i32::from(!seen_speed))
}

/// Ends the program for bad usage or input.
fn fail(what: impl Display) -> ! {
    semihosting::eprintln!("mps2_an500: {what}");
    process::exit(2)
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    match Irq::from_number(number) {
        Some(Irq::Alarm) => timers::on_alarm(),
        Some(Irq::Counter) => timers::on_wrap(),
        // SAFETY: these are the handlers of the interrupts that `main` starts the executors with,
        // and which are masked until then.
        Some(Irq::Intake) => unsafe { INTAKE.on_interrupt() },
        Some(Irq::Measure) => unsafe { MEASURE.on_interrupt() },
        None => fail(format_args!("interrupt {number} was never asked for")),
    }
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    // The stack may be what failed: begin it anew, since nothing is returned to.
    // SAFETY: `say_fault` takes one word and never returns.
    unsafe {
        asm!(
            "msr MSP, {start}",
            "b {say_fault}",
            start = in(reg) stack::start(),
            say_fault = sym say_fault,
            in("r0") frame,
            options(noreturn),
        )
    }
}

extern "C" fn say_fault(frame: *const ExceptionFrame) -> ! {
    if stack::contains(frame.addr()) {
        // SAFETY: the processor wrote it there, and nothing has run since but the lines above.
        let (pc, lr) = unsafe { ((*frame).pc(), (*frame).lr()) };
        semihosting::eprintln!("mps2_an500: fault at {pc:#010x}, called from {lr:#010x}");
    } else {
        semihosting::eprintln!("mps2_an500: the stack grew beyond what memory.x gives it");
    }
    process::exit(102)
}

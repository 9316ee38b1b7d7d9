//! Start-up, command line and interrupts. Tasks run on executors at interrupts' levels, each above the next: acquiring,
//! the front, measuring. The thread sleeps: QEMU lets time pass for WFI, but spins through the WFE of embassy's
//! thread executor.
#![expect(unsafe_code, reason = "the vector table's link to its handlers")]

use core::ffi::CStr;

use cortex_m::peripheral::NVIC;
use cortex_m_rt::{entry, exception};
use embassy_executor::InterruptExecutor;
use evtach_firmware::intake::Pace;
use semihosting::experimental::env;
use semihosting::fs;

use crate::console::File;
use crate::fault::fail;
use crate::injection::Injection;
use crate::timers::{self, Irq};
use crate::usage::{User, charge};
use crate::{bench, memory, program, psram, stack, uart};

static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
static MEASURE: InterruptExecutor = InterruptExecutor::new();
static FRONT: InterruptExecutor = InterruptExecutor::new();

/// Longest path on the command line, in bytes.
const PATH_BYTES: usize = 256;

const USAGE: &str =
    "usage: FILE [sensor|screen], or: spi [sensor|screen], or: instrument [FAULT] [SECONDS]";

/// What the command line asks for.
enum Asked {
    /// A file of the host is measured.
    File(File, How),
    /// So is what lies in the flash behind the SPI controller.
    Flash(How),
    /// The instrument runs, to print who used the processor after so many seconds, or for good.
    Instrument(Injection, Option<u32>),
}

/// How a recording is measured.
struct How {
    pace: Pace,
    screen: bool,
}

#[entry]
fn main() -> ! {
    let Some(mut peripherals) = cortex_m::Peripherals::take() else {
        fail("the peripherals are taken");
    };
    let nvic = &mut peripherals.NVIC;
    timers::start(nvic);
    Irq::Acquire.set_priority(nvic, 0x80);
    Irq::Front.set_priority(nvic, 0xA0);
    Irq::Measure.set_priority(nvic, 0xC0);
    let started = match command_line() {
        Asked::File(file, how) => start_bench(Some(file), how),
        Asked::Flash(how) => start_bench(None, how),
        Asked::Instrument(injection, seconds) => start_instrument(nvic, injection, seconds),
    };
    if let Err(error) = started {
        fail(error);
    }
    loop {
        // With interrupts held back, so that what they do is not taken for sleep.
        cortex_m::interrupt::free(|_| charge(User::Sleep, cortex_m::asm::wfi));
    }
}

// Neither is inlined: `main` never gives back what its frame takes.
#[inline(never)]
fn start_bench(
    file: Option<File>,
    How { pace, screen }: How,
) -> Result<(), embassy_executor::SpawnError> {
    let (sender, receiver) = memory::blocks();
    let psram = if screen { psram::take() } else { None };
    let film = psram.map(bench::film);
    let measure = bench::measure_all(memory::tachometer(), receiver, pace, film)?;
    cortex_m::interrupt::free(|_| stack::start_running());
    MEASURE.start(Irq::Measure).spawn(measure);
    let acquire = ACQUIRE.start(Irq::Acquire);
    match file {
        Some(file) => acquire.spawn(bench::take_in_file(file, pace, sender)?),
        None => acquire.spawn(bench::take_in_spi(pace, sender)?),
    }
    Ok(())
}

#[inline(never)]
fn start_instrument(
    nvic: &mut NVIC,
    injection: Injection,
    seconds: Option<u32>,
) -> Result<(), embassy_executor::SpawnError> {
    let Some(psram) = psram::take() else { fail("the external memory is taken") };
    let parts = program::prepare(psram, injection);
    let (sender, receiver) = memory::blocks();
    let (tachometer, injection) = (memory::tachometer(), parts.injection);
    cortex_m::interrupt::free(|_| stack::start_running());
    let front = FRONT.start(Irq::Front);
    front.spawn(program::front_task(parts)?);
    if let Some(seconds) = seconds {
        front.spawn(program::report_task(seconds)?);
    }
    MEASURE.start(Irq::Measure).spawn(program::measure_task(tachometer, receiver, injection)?);
    ACQUIRE.start(Irq::Acquire).spawn(program::acquire_task(sender, injection)?);
    Irq::Receive.set_priority(nvic, 0x40);
    // SAFETY: its handler touches nothing but the port and a pipe made for handlers.
    unsafe { NVIC::unmask(Irq::Receive) };
    Ok(())
}

/// What the command line asks for; without one, to be the instrument.
#[inline(never)]
fn command_line() -> Asked {
    let Ok(arguments) = env::args::<PATH_BYTES>() else { fail("the command line is too long") };
    let mut arguments = (&arguments).skip(1).map(|argument| argument.unwrap_or_default());
    let Some(first) = arguments.next() else {
        return Asked::Instrument(Injection::None, None);
    };
    if first == "instrument" {
        let (mut injection, mut seconds) = (Injection::None, None);
        for argument in arguments {
            let known = Injection::ALL.iter().find(|(name, _)| *name == argument);
            match (known, argument.parse()) {
                (Some((_, known)), _) => injection = *known,
                (None, Ok(number)) => seconds = Some(number),
                (None, Err(_)) => fail(USAGE),
            }
        }
        return Asked::Instrument(injection, seconds);
    }
    let how = match arguments.next() {
        None => How { pace: Pace::File, screen: false },
        Some("sensor") => How { pace: Pace::Sensor, screen: false },
        Some("screen") => How { pace: Pace::File, screen: true },
        Some(_) => fail(USAGE),
    };
    if first == "spi" {
        return Asked::Flash(how);
    }
    let mut bytes = [0; PATH_BYTES];
    bytes[..first.len()].copy_from_slice(first.as_bytes());
    let Ok(path) = CStr::from_bytes_until_nul(&bytes) else { fail("the path is too long") };
    match fs::File::open(path) {
        Ok(file) => Asked::File(File(file), how),
        Err(error) => fail(error),
    }
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    let irq = Irq::from_number(number);
    charge(User::System, || match irq {
        Some(Irq::Receive) => uart::on_receive(),
        Some(Irq::Alarm) => timers::on_alarm(),
        Some(Irq::Counter) => timers::on_wrap(),
        // SAFETY: these are the handlers of the interrupts that the executors are started with, and
        // which are masked until then.
        Some(Irq::Acquire) => unsafe { ACQUIRE.on_interrupt() },
        Some(Irq::Measure) => unsafe { MEASURE.on_interrupt() },
        Some(Irq::Front) => unsafe { FRONT.on_interrupt() },
        None => fail(format_args!("interrupt {number} was never asked for")),
    });
}

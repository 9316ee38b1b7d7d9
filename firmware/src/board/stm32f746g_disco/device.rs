//! Start-up and interrupts. Tasks run on executors at interrupts' levels, each above the next: acquiring, the front,
//! measuring. The thread sleeps.
#![expect(unsafe_code, reason = "the vector table's link to its handlers")]

use cortex_m_rt::entry;
use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, SpawnError};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt as _, Priority};

use crate::clock::Source;
use crate::sdram::{RECORDING, RECORDING_BYTES};
use crate::tape::{RecordingMemory, Tape};
use crate::wiring::AssignedResources;
use crate::{cache, clock, display, fault, memory, panel, program, sdram, stack, wiring};

static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
static FRONT: InterruptExecutor = InterruptExecutor::new();
static MEASURE: InterruptExecutor = InterruptExecutor::new();

#[entry]
fn main() -> ! {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        cache::start(&mut core.MPU, &mut core.SCB, &mut core.CPUID);
    }
    let source = clock::start_crystal();
    let board = wiring::share_out(embassy_stm32::init(clock::config(source)));
    defmt::info!("EV-Tach {=str}", env!("CARGO_PKG_VERSION"));
    match source {
        Source::Crystal => clock::watch_crystal(),
        Source::Internal => defmt::error!("the crystal does not swing"),
    }
    if let Err(error) = start(board) {
        defmt::error!("{}", defmt::Debug2Format(&error));
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// Not inlined: `main` never gives back what its frame takes.
#[inline(never)]
fn start(board: AssignedResources) -> Result<(), SpawnError> {
    if let Err(error) = sdram::start(board.sdram) {
        defmt::error!("{}", defmt::Display2Format(&error));
    }
    let Some(panel) = panel::take() else { return Ok(()) };
    display::start(board.display, panel.address());
    // SAFETY: the SDRAM has been started, and this runs once.
    Tape::lend(unsafe { RecordingMemory::new(RECORDING, RECORDING_BYTES) });
    let parts = program::prepare(panel, fault::take_kept(), board.watchdog);
    let (sender, receiver) = memory::blocks();
    let tachometer = memory::tachometer();
    cortex_m::interrupt::free(|_| stack::start_running());
    interrupt::UART4.set_priority(Priority::P6);
    interrupt::UART5.set_priority(Priority::P8);
    interrupt::UART7.set_priority(Priority::P10);
    FRONT.start(interrupt::UART5).spawn(program::front_task(parts)?);
    MEASURE.start(interrupt::UART7).spawn(program::measure_task(tachometer, receiver)?);
    ACQUIRE.start(interrupt::UART4).spawn(program::acquire_task(sender)?);
    let (deepest, _) = stack::depths();
    defmt::info!("started; stack so far {=usize} B", deepest);
    Ok(())
}

/// Nothing is wired to this serial port: by software it runs acquiring.
#[interrupt]
unsafe fn UART4() {
    // SAFETY: the handler of the interrupt that the executor is started with, masked until then.
    unsafe { ACQUIRE.on_interrupt() }
}

/// So it runs the front.
#[interrupt]
unsafe fn UART5() {
    // SAFETY: as above.
    unsafe { FRONT.on_interrupt() }
}

/// And measuring.
#[interrupt]
unsafe fn UART7() {
    // SAFETY: as above.
    unsafe { MEASURE.on_interrupt() }
}

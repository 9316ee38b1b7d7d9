//! Start-up and interrupts. Tasks run on executors at interrupts' levels, each above the next: acquiring, the front,
//! measuring. The thread sleeps.
#![expect(unsafe_code, reason = "the vector table's link to its handlers")]

use cortex_m::peripheral::{CPUID, SCB};
use cortex_m_rt::entry;
use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, SpawnError};
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt as _, Priority};
use evtach_firmware::instrument::Fault;
use evtach_firmware::kept::KeptFault;
use static_cell::StaticCell;

use crate::flash::{Flash, SharedFlash};
use crate::panel::Panel;
use crate::program::{Parts, Shows, Source};
use crate::sdram::{RECORDING, RECORDING_BYTES};
use crate::tape::{RecordingMemory, Tape};
use crate::wiring::AssignedResources;
use crate::{
    cache, clock, display, fault, memory, otg_hs, panel, program, sdram, spare, stack, wiring,
};

static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
static FRONT: InterruptExecutor = InterruptExecutor::new();
static MEASURE: InterruptExecutor = InterruptExecutor::new();

#[entry]
fn main() -> ! {
    let Some(mut core) = cortex_m::Peripherals::take() else {
        fault::stop(Fault::Panic, &"the peripherals are taken");
    };
    cache::start(&mut core.MPU, &mut core.SCB, &mut core.CPUID);
    let source = clock::start_crystal();
    let board = wiring::share_out(embassy_stm32::init(clock::config(source)));
    defmt::info!("EV-Tach {=str}", env!("CARGO_PKG_VERSION"));
    let started = start(board, source, &mut core.SCB, &mut core.CPUID);
    if let Err(error) = started {
        fault::stop(Fault::Panic, &format_args!("a task is there twice: {error:?}"));
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// Not inlined: `main` never gives back what its frame takes.
#[inline(never)]
fn start(
    board: AssignedResources,
    clock: clock::Source,
    scb: &mut SCB,
    cpuid: &mut CPUID,
) -> Result<(), SpawnError> {
    let kept = fault::take_kept();
    let (panel, dead) = match sdram::start(board.sdram).map(|()| panel::frames()) {
        Ok(Some(frames)) => {
            display::start(board.display, frames.address(), None);
            (Panel::Frames(frames), None)
        }
        Ok(None) => fault::stop(Fault::Panic, &"the SDRAM is taken"),
        Err(error) => {
            scb.disable_dcache(cpuid);
            let spare = spare::take();
            display::start(board.display, spare.address(), Some(&spare::colours()));
            (Panel::Spare(spare), Some(KeptFault::new(Fault::Memory, error)))
        }
    };
    let dead = dead.or(match clock {
        clock::Source::Crystal => {
            clock::watch_crystal();
            None
        }
        clock::Source::Internal => Some(KeptFault::new(Fault::Crystal, "no 25 MHz from X2")),
    });
    interrupt::UART4.set_priority(Priority::P6);
    interrupt::UART5.set_priority(Priority::P8);
    interrupt::UART7.set_priority(Priority::P10);
    let parts = Parts { panel, port: board.port, watchdog: board.watchdog };
    if let Some(dead) = dead {
        defmt::error!("dead: {=str}", dead.text);
        FRONT.start(interrupt::UART5).spawn(program::front_task(parts, Shows::Dead(dead))?);
        return Ok(());
    }
    static FLASH: StaticCell<SharedFlash> = StaticCell::new();
    let flash: &SharedFlash = FLASH.init(SharedFlash::new(Flash::start(board.flash)));
    // SAFETY: the SDRAM has been started, and this runs once.
    Tape::lend(unsafe { RecordingMemory::new(RECORDING, RECORDING_BYTES) });
    let mut input = board.input;
    // Whoever holds the button while the board starts has no camera.
    let replays = Input::new(input.button.reborrow(), Pull::Down).is_high();
    let source = if replays {
        defmt::warn!("the recording in the serial flash is played");
        Source::Replay(flash)
    } else {
        Source::Camera(otg_hs::start(board.host, Priority::P4))
    };
    let shows = Shows::Instrument { kept, flash, input };
    let (sender, receiver) = memory::blocks();
    let tachometer = memory::tachometer();
    cortex_m::interrupt::free(|_| stack::start_running());
    let (deepest, _) = stack::depths();
    defmt::info!("stack at the start {=usize} B", deepest);
    FRONT.start(interrupt::UART5).spawn(program::front_task(parts, shows)?);
    MEASURE.start(interrupt::UART7).spawn(program::measure_task(tachometer, receiver)?);
    ACQUIRE.start(interrupt::UART4).spawn(program::acquire_task(source, sender)?);
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

/// The USB host port.
#[interrupt]
fn OTG_HS() {
    otg_hs::on_interrupt();
}

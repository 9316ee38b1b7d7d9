//! Processor, memory and board together: runs the image in virtual time.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use anyhow::{Result, anyhow, bail};
use unicorn_engine::unicorn_const::{Arch, HookType, MemType, Mode};
use unicorn_engine::{ArmCpuModel, RegisterARM as R, Unicorn, uc_error};

use crate::board::Board;
use crate::chip::ltdc::Picture;
use crate::chip::rcc::Cause;
use crate::cpu::{self, Engine, nvic};
use crate::image::{FLASH, FLASH_BYTES, Image, instructions};
use crate::injury::Injury;
use crate::memories::{Memories, Ram};
use crate::rtt::Rtt;
use crate::time::{MS, NEVER, Pulse, S};

/// Address that no code ever reaches.
const NOWHERE: u64 = 0xdead_beee;
/// How often the log is read.
const PROBE_PS: u64 = MS;
const WFE: u16 = 0xbf20;
const WFI: u16 = 0xbf30;
const SEV: u16 = 0xbf40;

/// Why the engine came back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    /// By itself, which it does not.
    Plain,
    /// Time is up, or something wants to be looked at, before the block at this address.
    Before(u32),
    /// `wfe` at this address.
    Wfe(u32),
    /// `wfi` at this address.
    Wfi(u32),
    /// An exception of the engine: its number.
    Exception(u32),
    /// An access to this address that nobody answers.
    Access(u32, bool),
}

/// Asleep until something happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sleep {
    Awake,
    /// Until an event.
    Event,
    /// Until an interrupt.
    Interrupt,
    /// For ever: a fault in the handler of a fault.
    Locked,
}

/// A power cut to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cut {
    None,
    /// In the middle of the next write.
    Writing,
    At(u64),
}

/// A running device.
pub struct Machine {
    engine: Engine,
    /// Everything but processor and memory.
    pub board: Rc<RefCell<Board>>,
    /// Time, and instructions by what ran.
    pub pulse: Rc<Pulse>,
    /// The image.
    pub image: Rc<Image>,
    /// Its log.
    pub rtt: Rtt,
    stop: Rc<Cell<Stop>>,
    event: Rc<Cell<bool>>,
    sleep: Sleep,
    next_probe: u64,
    memories: Memories,
    /// Resets so far, with their causes.
    pub resets: Vec<Cause>,
    /// Faults of the processor, told with symbols.
    pub faults: Vec<String>,
    /// Exceptions entered.
    pub entered: u64,
    /// Time spent asleep.
    pub slept: u64,
    /// Power goes in the middle of the next write to the serial flash; then it knows when.
    cut: Cut,
    /// What will be done to the program.
    pub injury: Option<Injury>,
}

impl Machine {
    /// A device with this image in its flash, and power.
    ///
    /// # Errors
    /// When the engine does not start.
    pub fn new(image: Image) -> Result<Self> {
        let failed = |error: uc_error| anyhow!("the engine: {error:?}");
        let mut engine = Unicorn::new(Arch::ARM, Mode::THUMB | Mode::MCLASS).map_err(failed)?;
        engine.ctl_set_cpu_model(ArmCpuModel::UC_CPU_ARM_CORTEX_M7 as i32).map_err(failed)?;
        let (image, pulse) = (Rc::new(image), Rc::new(Pulse::default()));
        let board = Rc::new(RefCell::new(Board::new(Rc::clone(&pulse))));
        let (stop, event) = (Rc::new(Cell::new(Stop::Plain)), Rc::new(Cell::new(false)));
        let memories = Memories::new(&mut engine, &image.flash).map_err(failed)?;
        for (start, bytes) in [
            (0x4000_0000_u32, 0x8_0000),
            (0x5000_0000, 0x8_0000),
            (0xa000_0000, 0x2000),
            (0xe000_0000, 0x10_0000),
        ] {
            let (reads, writes) = (Rc::clone(&board), Rc::clone(&board));
            engine
                .mmio_map(
                    u64::from(start),
                    bytes,
                    Some(move |_: &mut Unicorn<'_, ()>, at: u64, size: usize| {
                        u64::from(reads.borrow_mut().read(start + at as u32, size as u8))
                    }),
                    Some(move |_: &mut Unicorn<'_, ()>, at: u64, size: usize, value: u64| {
                        let at = start + at as u32;
                        writes.borrow_mut().write(at, value as u32, size as u8);
                    }),
                )
                .map_err(failed)?;
        }
        let rtt = Rtt::new(&image)?;
        let mut machine = Self {
            engine,
            board,
            pulse,
            image,
            rtt,
            stop,
            event,
            sleep: Sleep::Awake,
            next_probe: 0,
            memories,
            resets: Vec::new(),
            faults: Vec::new(),
            entered: 0,
            slept: 0,
            cut: Cut::None,
            injury: None,
        };
        machine.hook().map_err(failed)?;
        machine.reset(Cause::Power)?;
        Ok(machine)
    }

    /// Watches blocks of code, the instructions that the engine does not know, and accesses that go nowhere.
    fn hook(&mut self) -> Result<(), uc_error> {
        let (pulse, image) = (Rc::clone(&self.pulse), Rc::clone(&self.image));
        let (board, stopped) = (Rc::clone(&self.board), Rc::clone(&self.stop));
        // Bytes and instructions of the block at each halfword of the flash, once it has been met.
        let mut counts: Vec<(u32, u32)> = vec![(0, 0); FLASH_BYTES / 2];
        self.engine.add_block_hook(1, 0, move |engine, at, size| {
            let stop = pulse.now.get() >= pulse.due.get()
                || pulse.attention.get()
                || pulse.pending.get()
                    && board
                        .borrow()
                        .nvic
                        .preempting()
                        .is_some_and(|(_, priority)| cpu::unmasked(engine, priority));
            if stop {
                // Beside hooks on single instructions the engine leaves the program counter where it was some blocks ago.
                stopped.set(Stop::Before(at as u32));
                let _ = engine.emu_stop();
                return;
            }
            let known = counts.get_mut((at as u32).wrapping_sub(FLASH) as usize / 2);
            let count = match known {
                Some((bytes, count)) if *bytes == size => *count,
                Some(known) => {
                    let first = (at as u32 - FLASH) as usize;
                    let code = image.flash.get(first..first + size as usize).unwrap_or_default();
                    *known = (size, instructions(code) as u32);
                    known.1
                }
                // There is none in RAM but the loop of an injury.
                None => size / 2,
            };
            pulse.spend(u64::from(count));
        })?;
        for (instruction, kind) in [(WFE, 0), (WFI, 1), (SEV, 2)] {
            for at in self.image.find(instruction).collect::<Vec<_>>() {
                let (stop, event) = (Rc::clone(&self.stop), Rc::clone(&self.event));
                self.engine.add_code_hook(u64::from(at), u64::from(at), move |engine, _, _| {
                    match kind {
                        0 => stop.set(Stop::Wfe(at)),
                        1 => stop.set(Stop::Wfi(at)),
                        _ => return event.set(true),
                    }
                    let _ = engine.emu_stop();
                })?;
            }
        }
        let stop = Rc::clone(&self.stop);
        self.engine.add_intr_hook(move |engine, number| {
            stop.set(Stop::Exception(number));
            let _ = engine.emu_stop();
        })?;
        let stop = Rc::clone(&self.stop);
        let invalid = HookType::MEM_UNMAPPED | HookType::MEM_PROT;
        self.engine.add_mem_hook(invalid, 1, 0, move |_, kind, at, _, _| {
            let writes = matches!(kind, MemType::WRITE_UNMAPPED | MemType::WRITE_PROT);
            stop.set(Stop::Access(at as u32, writes));
            false
        })?;
        Ok(())
    }

    fn reset(&mut self, cause: Cause) -> Result<()> {
        self.drain_log();
        let failed = |error: uc_error| anyhow!("the engine: {error:?}");
        if cause == Cause::Power {
            self.memories.lose(&mut self.engine).map_err(failed)?;
        }
        self.board.borrow_mut().reset(cause, FLASH);
        // The SDRAM answers again once it has been started again.
        self.follow_controllers()?;
        self.sleep = Sleep::Awake;
        self.event.set(false);
        self.pulse.level.set(0);
        self.resets.push(cause);
        cpu::reset(&mut self.engine, FLASH).map_err(|error| anyhow!("no vectors: {error:?}"))
    }

    /// Power goes in the middle of the next write to the serial flash.
    pub fn cut_while_writing(&mut self) {
        self.cut = Cut::Writing;
    }

    /// Time since power first came, in picoseconds.
    pub fn now(&self) -> u64 {
        self.pulse.now.get()
    }

    /// Runs until this time.
    ///
    /// # Errors
    /// When the engine gives up.
    pub fn run_until(&mut self, until: u64) -> Result<()> {
        while self.now() < until {
            self.look_after()?;
            let cut = if let Cut::At(at) = self.cut { at } else { NEVER };
            let due = self.pulse.due.get().min(cut);
            if self.now() >= due {
                continue;
            }
            if self.sleep != Sleep::Awake {
                let to = due.min(until).min(self.next_probe.max(self.now() + 1));
                self.slept += to - self.now();
                self.pulse.now.set(to);
                continue;
            }
            self.pulse.due.set(due.min(until).min(self.next_probe));
            self.carry_on()?;
        }
        self.look_after()
    }

    /// Everything that wants to be looked at between two runs of the engine.
    fn look_after(&mut self) -> Result<()> {
        self.pulse.attention.set(false);
        self.board.borrow_mut().advance(&mut Ram(&mut self.engine));
        if self.now() >= self.next_probe {
            self.next_probe = self.now() + PROBE_PS;
            self.drain_log();
        }
        match self.cut {
            Cut::Writing => {
                let middle = self.board.borrow().quadspi.flash.middle();
                self.cut = middle.map_or(Cut::Writing, Cut::At);
            }
            Cut::At(at) if at <= self.now() => {
                self.cut = Cut::None;
                self.board.borrow_mut().power_off();
            }
            _ => {}
        }
        let asked = self.board.borrow_mut().asked.take();
        if let Some(cause) = asked {
            return self.reset(cause);
        }
        self.follow_controllers()?;
        let first = self.board.borrow().nvic.preempting();
        if let Some((exception, priority)) = first {
            if self.sleep == Sleep::Interrupt {
                self.sleep = Sleep::Awake;
            }
            if self.sleep != Sleep::Locked && cpu::unmasked(&self.engine, priority) {
                self.enter(exception);
                let strikes = |injury: &mut Injury| injury.exception == usize::from(exception);
                if let Some(injury) = self.injury.take_if(strikes) {
                    injury.strike(&mut self.engine, &self.image)?;
                }
            }
        }
        if self.sleep == Sleep::Event && self.event.take() {
            self.sleep = Sleep::Awake;
        }
        Ok(())
    }

    fn follow_controllers(&mut self) -> Result<()> {
        self.memories
            .follow(&mut self.engine, &mut self.board.borrow_mut())
            .map_err(|error| anyhow!("the engine: {error:?}"))
    }

    /// A bit of SDRAM that reads as zero from now on.
    ///
    /// # Errors
    /// When one is broken already, or the engine takes no more hooks.
    pub fn break_sdram(&mut self, offset: u32) -> Result<()> {
        self.memories.break_sdram(&mut self.engine, offset)
    }

    /// Someone has mended SDRAM and crystal.
    pub fn mend(&mut self) {
        self.memories.mend_sdram();
        self.board.borrow_mut().rcc.mend_crystal();
    }

    fn enter(&mut self, exception: u16) {
        let mut board = self.board.borrow_mut();
        let vtor = board.system.vtor;
        let entered = cpu::enter(&mut self.engine, &mut board.nvic, exception, vtor);
        self.entered += 1;
        self.event.set(true);
        self.sleep = Sleep::Awake;
        self.pulse.level.set(usize::from(exception));
        board.disturbed();
        if let Err(error) = entered {
            let place = self.image.place(cpu::register(&self.engine, R::LR));
            self.faults.push(format!(
                "{}: no frame for it at {place}: {error:?}",
                cpu::name(exception.into())
            ));
        }
    }

    fn leave(&mut self, link: u32) -> Result<()> {
        let mut board = self.board.borrow_mut();
        cpu::leave(&mut self.engine, &mut board.nvic, link)
            .map_err(|error| anyhow!("no frame to return to: {error:?}"))?;
        self.event.set(true);
        self.pulse.level.set(usize::from(board.nvic.current()));
        board.disturbed();
        Ok(())
    }

    /// Runs the engine until it stops, and does what it cannot.
    fn carry_on(&mut self) -> Result<()> {
        self.stop.set(Stop::Plain);
        let from = u64::from(cpu::register(&self.engine, R::PC) | 1);
        let ended = self.engine.emu_start(from, NOWHERE, 0, 0);
        let pc = cpu::register(&self.engine, R::PC);
        match (self.stop.get(), ended) {
            (Stop::Plain, Ok(())) => {
                bail!("the engine stopped at {} by itself", self.image.place(pc))
            }
            (Stop::Before(at), _) => {
                cpu::set_register(&mut self.engine, R::PC, at);
                Ok(())
            }
            (Stop::Wfe(at), _) => {
                cpu::set_register(&mut self.engine, R::PC, at + 2);
                if !self.event.take() {
                    self.sleep = Sleep::Event;
                }
                Ok(())
            }
            (Stop::Wfi(at), _) => {
                cpu::set_register(&mut self.engine, R::PC, at + 2);
                self.sleep = Sleep::Interrupt;
                Ok(())
            }
            (Stop::Exception(_), _) if cpu::is_return(pc) => self.leave(pc | 1),
            (Stop::Exception(2), _) => {
                self.board.borrow_mut().nvic.pend(nvic::SV_CALL);
                Ok(())
            }
            (Stop::Exception(number), _) => {
                self.fault(&format!("exception {number} of the engine"), 0)
            }
            (Stop::Access(at, writes), _) => {
                let what = if writes { "write to" } else { "read of" };
                {
                    let mut board = self.board.borrow_mut();
                    // Precise, with a valid address.
                    board.system.cfsr |= 0x8200;
                    board.system.bfar = at;
                }
                self.fault(&format!("{what} {at:#010x}, where nothing is"), at)
            }
            (Stop::Plain, Err(uc_error::INSN_INVALID)) => {
                self.board.borrow_mut().system.cfsr |= 1 << 16;
                self.fault("an instruction that the processor does not know", pc)
            }
            (Stop::Plain, Err(error)) => bail!("the engine at {}: {error:?}", self.image.place(pc)),
        }
    }

    fn fault(&mut self, what: &str, _at: u32) -> Result<()> {
        let (pc, link) = (cpu::register(&self.engine, R::PC), cpu::register(&self.engine, R::LR));
        let place = self.image.place(pc);
        self.faults.push(format!(
            "{:.6} s: {what}, at {place}, called from {}",
            self.now() as f64 / S as f64,
            self.image.place(link)
        ));
        let locked = {
            let mut board = self.board.borrow_mut();
            board.system.hfsr |= 1 << 30;
            board.nvic.running() <= -1
        };
        if locked {
            self.faults.push("locked up: a fault in the handler of a fault".to_owned());
            self.sleep = Sleep::Locked;
        } else {
            self.enter(nvic::HARD_FAULT);
        }
        Ok(())
    }

    fn drain_log(&mut self) {
        self.rtt.drain(&mut Ram(&mut self.engine));
    }

    /// What is on the panel.
    pub fn picture(&mut self) -> Option<Picture> {
        let board = Rc::clone(&self.board);
        let board = board.borrow();
        board.ltdc.picture(&Ram(&mut self.engine))
    }

    /// Bytes of the stack that were never written since power came, between two symbols of the image.
    pub fn stack_untouched(&mut self, low: u32, high: u32) -> usize {
        let mut stack = vec![0; high.saturating_sub(low) as usize];
        if self.engine.mem_read(u64::from(low), &mut stack).is_err() {
            return 0;
        }
        let first = stack.first().copied().unwrap_or(0);
        stack.iter().position(|byte| *byte != first).unwrap_or(stack.len())
    }

    /// Where the processor is.
    pub fn place(&self) -> String {
        let asleep = match self.sleep {
            Sleep::Awake => "",
            Sleep::Event | Sleep::Interrupt => ", asleep",
            Sleep::Locked => ", locked up",
        };
        format!("{}{asleep}", self.image.place(cpu::register(&self.engine, R::PC)))
    }
}

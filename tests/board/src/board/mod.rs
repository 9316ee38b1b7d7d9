//! The board: the chip's peripherals, what is soldered around it, and where all of it is in the address space.

pub mod ft5336;
pub mod n25q;

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::chip::exti::Exti;
use crate::chip::flash::Flash;
use crate::chip::fmc::Fmc;
use crate::chip::gpio::Gpio;
use crate::chip::i2c::I2c;
use crate::chip::iwdg::Iwdg;
use crate::chip::ltdc::Ltdc;
use crate::chip::plain::Plain;
use crate::chip::pwr::Pwr;
use crate::chip::quadspi::QuadSpi;
use crate::chip::rcc::{Cause, Rcc};
use crate::chip::tim::Tim;
use crate::chip::{Device, Memory};
use crate::cpu::nvic::Nvic;
use crate::cpu::system::{Asked, System};
use crate::time::{Pulse, S};
use crate::usb::device::Port;
use crate::usb::host::Host;
use ft5336::Ft5336;

/// Cycles that an access to a register takes more than one to memory.
const ACCESS_CYCLES: u64 = 6;
/// Clock beyond which the chip needs over-drive.
const WITHOUT_OVER_DRIVE_HZ: u64 = 180_000_000;

/// Port and pin of the button that a user presses.
const BUTTON: (u8, u8) = (8, 11);
/// Port and pin at which the touch controller asks for attention; it pulls it low.
const TOUCH: (u8, u8) = (8, 13);

/// Blocks of registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    Tim(usize),
    Iwdg,
    I2c(usize),
    Pwr,
    Syscfg,
    Exti,
    Ltdc,
    Gpio(usize),
    Rcc,
    Flash,
    Host,
    Port,
    Fmc,
    QuadSpi,
    /// Known by name, and without behaviour.
    Quiet(&'static str),
}

/// Timers: where they are, which interrupt, and how wide.
const TIMERS: [(u32, u8, u8); 12] = [
    (0x4000_0000, 28, 32),
    (0x4000_0400, 29, 16),
    (0x4000_0800, 30, 16),
    (0x4000_0c00, 50, 32),
    (0x4000_1000, 54, 16),
    (0x4000_1400, 55, 16),
    (0x4000_1800, 43, 16),
    (0x4000_1c00, 44, 16),
    (0x4000_2000, 45, 16),
    (0x4001_4000, 24, 16),
    (0x4001_4400, 25, 16),
    (0x4001_4800, 26, 16),
];

/// The block at an address, and where it begins.
fn block(address: u32) -> Option<(Block, u32)> {
    let page = address & !0x3ff;
    if let Some(index) = TIMERS.iter().position(|(start, ..)| *start == page) {
        return Some((Block::Tim(index), page));
    }
    let found = match page {
        0x4000_3000 => Block::Iwdg,
        0x4000_5400..=0x4000_6000 => Block::I2c((page as usize - 0x4000_5400) / 0x400),
        0x4000_7000 => Block::Pwr,
        0x4001_3800 => Block::Syscfg,
        0x4001_3c00 => Block::Exti,
        0x4001_6800 => Block::Ltdc,
        0x4002_0000..=0x4002_2800 => Block::Gpio((page as usize - 0x4002_0000) / 0x400),
        0x4002_3800 => Block::Rcc,
        0x4002_3c00 => Block::Flash,
        0x4004_0000..=0x4007_fc00 => return Some((Block::Host, 0x4004_0000)),
        0x5000_0000..=0x5003_fc00 => return Some((Block::Port, 0x5000_0000)),
        0xa000_0000..=0xa000_0c00 => return Some((Block::Fmc, 0xa000_0000)),
        0xa000_1000 => Block::QuadSpi,
        0x4002_3000 => Block::Quiet("CRC"),
        0x4002_6000 => Block::Quiet("DMA1"),
        0x4002_6400 => Block::Quiet("DMA2"),
        _ => return None,
    };
    Some((found, page))
}

/// Everything but processor and memory.
pub struct Board {
    pulse: Rc<Pulse>,
    /// Interrupt controller.
    pub nvic: Nvic,
    /// System control space.
    pub system: System,
    /// Clocks.
    pub rcc: Rcc,
    /// Power.
    pub pwr: Pwr,
    /// Flash interface.
    pub flash: Flash,
    /// Memory controller.
    pub fmc: Fmc,
    /// Display controller.
    pub ltdc: Ltdc,
    /// Serial flash and its controller.
    pub quadspi: QuadSpi,
    /// USB port of the camera.
    pub host: Host,
    /// USB port of the PC.
    pub port: Port,
    exti: Exti,
    gpio: [Gpio; 11],
    timers: Vec<Tim>,
    i2c: [I2c; 4],
    iwdg: Iwdg,
    syscfg: Plain,
    quiet: BTreeMap<u32, Plain>,
    touch: Ft5336,
    /// A reset was asked for.
    pub asked: Option<Cause>,
    /// Registers that nobody knows, by address: reads, writes.
    pub unknown: BTreeMap<u32, (u64, u64)>,
    /// What a person with a meter would notice, each once.
    pub remarks: Vec<String>,
}

impl Board {
    /// A board without power.
    pub fn new(pulse: Rc<Pulse>) -> Self {
        let timers = TIMERS.iter().map(|(_, line, bits)| Tim::new(*line, *bits)).collect();
        let mut board = Self {
            pulse,
            nvic: Nvic::default(),
            system: System::default(),
            rcc: Rcc::default(),
            pwr: Pwr::default(),
            flash: Flash::default(),
            fmc: Fmc::default(),
            ltdc: Ltdc::default(),
            quadspi: QuadSpi::default(),
            host: Host::default(),
            port: Port::default(),
            exti: Exti::default(),
            gpio: Default::default(),
            timers,
            i2c: [31, 33, 72, 95].map(I2c::new),
            iwdg: Iwdg::default(),
            syscfg: Plain::default(),
            quiet: BTreeMap::new(),
            touch: Ft5336::default(),
            asked: None,
            unknown: BTreeMap::new(),
            remarks: Vec::new(),
        };
        // Nobody touches the panel.
        board.gpio[usize::from(TOUCH.0)].drive(TOUCH.1, true);
        board.clocks_changed();
        board
    }

    /// A reset of the chip; what is soldered around it goes on.
    pub fn reset(&mut self, cause: Cause, vtor: u32) {
        self.nvic = Nvic::default();
        self.system = System::default();
        self.system.vtor = vtor;
        self.quiet.clear();
        let gpio = self.gpio.iter_mut().map(|port| port as &mut dyn Device);
        let timers = self.timers.iter_mut().map(|timer| timer as &mut dyn Device);
        let i2c = self.i2c.iter_mut().map(|i2c| i2c as &mut dyn Device);
        let rest: [&mut dyn Device; 12] = [
            &mut self.rcc,
            &mut self.pwr,
            &mut self.flash,
            &mut self.fmc,
            &mut self.ltdc,
            &mut self.quadspi,
            &mut self.host,
            &mut self.port,
            &mut self.exti,
            &mut self.iwdg,
            &mut self.syscfg,
            &mut Plain::default(),
        ];
        for device in gpio.chain(timers).chain(i2c).chain(rest) {
            device.reset();
        }
        self.rcc.caused(cause);
        self.clocks_changed();
        self.settle();
    }

    fn device(&mut self, block: Block, start: u32) -> &mut dyn Device {
        match block {
            Block::Tim(index) => &mut self.timers[index],
            Block::Iwdg => &mut self.iwdg,
            Block::I2c(index) => &mut self.i2c[index],
            Block::Pwr => &mut self.pwr,
            Block::Syscfg => &mut self.syscfg,
            Block::Exti => &mut self.exti,
            Block::Ltdc => &mut self.ltdc,
            Block::Gpio(index) => &mut self.gpio[index],
            Block::Rcc => &mut self.rcc,
            Block::Flash => &mut self.flash,
            Block::Host => &mut self.host,
            Block::Port => &mut self.port,
            Block::Fmc => &mut self.fmc,
            Block::QuadSpi => &mut self.quadspi,
            Block::Quiet(_) => self.quiet.entry(start).or_default(),
        }
    }

    /// The processor reads a register.
    pub fn read(&mut self, address: u32, size: u8) -> u32 {
        self.pulse.wait(ACCESS_CYCLES);
        let now = self.pulse.now.get();
        let shift = 8 * (address & 3);
        if address >> 28 == 0xe {
            let at = address & 0xf_ffff & !3;
            return self.system.read(at, &self.nvic, &self.pulse) >> shift;
        }
        let Some((block, start)) = block(address) else {
            self.unknown.entry(address & !3).or_default().0 += 1;
            return self.quiet.entry(address & !0x3ff).or_default().read(address & 0x3fc, 4, now)
                >> shift;
        };
        let value = self.device(block, start).read((address - start) & !3, size, now) >> shift;
        self.changed(block, start);
        value
    }

    /// The processor writes a register.
    pub fn write(&mut self, address: u32, value: u32, size: u8) {
        self.pulse.wait(ACCESS_CYCLES);
        let now = self.pulse.now.get();
        if address >> 28 == 0xe {
            let at = address & 0xf_ffff;
            if self.system.write(at, value, size, &mut self.nvic, &self.pulse) == Asked::Reset {
                self.ask(Cause::Software);
            }
            return self.settle();
        }
        let Some((block, start)) = block(address) else {
            self.unknown.entry(address & !3).or_default().1 += 1;
            let page = self.quiet.entry(address & !0x3ff).or_default();
            return page.write(address & 0x3fc, value, 4, now);
        };
        let at = (address - start) & !3;
        let device = self.device(block, start);
        // A queue takes as many bytes as are written; a register keeps its others.
        let whole = size == 4 || matches!(block, Block::QuadSpi);
        let value = if whole {
            value
        } else {
            let (shift, mask) = (8 * (address & 3), (1_u32 << (8 * size)) - 1);
            device.read(at, 4, now) & !(mask << shift) | (value & mask) << shift
        };
        device.write(at, value, size, now);
        match block {
            Block::Rcc | Block::Pwr => self.clocks_changed(),
            Block::Syscfg if (0x08..0x18).contains(&at) => {
                self.exti.select((at as usize - 0x08) / 4 * 4, value);
            }
            Block::Fmc | Block::QuadSpi => self.pulse.attention.set(true),
            Block::Flash if self.flash.unlocked => {
                self.remark("the flash was opened for programming, which is not modelled");
            }
            _ => {}
        }
        self.changed(block, start);
    }

    /// Asks for a reset, which comes when the processor has stopped.
    pub fn ask(&mut self, cause: Cause) {
        self.asked = Some(cause);
        self.pulse.attention.set(true);
    }

    fn remark(&mut self, what: &str) {
        if !self.remarks.iter().any(|remark| remark == what) {
            self.remarks.push(what.to_owned());
        }
    }

    /// To be called when they may have.
    pub fn clocks_changed(&mut self) {
        let clocks = self.rcc.clocks();
        let now = self.pulse.now.get();
        self.pulse.instruction_ps.set(S.div_ceil(clocks.hclk_hz.max(1)));
        for (timer, (start, ..)) in self.timers.iter_mut().zip(TIMERS) {
            let fast = start >= 0x4001_0000;
            timer.set_clock(if fast { clocks.timers2_hz } else { clocks.timers1_hz }, now);
        }
        for i2c in &mut self.i2c {
            i2c.set_clock(clocks.pclk1_hz);
        }
        if clocks.hclk_hz > WITHOUT_OVER_DRIVE_HZ && !self.pwr.over_drive() {
            self.remark("the processor runs beyond 180 MHz without over-drive");
        }
        if clocks.hclk_hz > 210_000_000 && self.flash.latency() < 7 {
            self.remark("the flash has fewer wait states than 216 MHz need");
        }
    }

    fn changed(&mut self, block: Block, start: u32) {
        let Self { nvic, .. } = self;
        // Split by hand: the controller is beside the device.
        let mut lines = std::mem::take(nvic);
        self.device(block, start).lines(&mut lines);
        self.nvic = lines;
        self.settle();
    }

    /// Works out what is due next, and whether an exception waits.
    fn settle(&mut self) {
        self.pulse.pending.set(self.nvic.preempting().is_some());
        self.pulse.due.set(self.next());
    }

    fn next(&self) -> u64 {
        let rest: [&dyn Device; 6] =
            [&self.iwdg, &self.ltdc, &self.quadspi, &self.host, &self.port, &self.exti];
        let timers = self.timers.iter().map(|timer| timer.next());
        let i2c = self.i2c.iter().map(|i2c| i2c.next());
        let next = timers.chain(i2c).chain(rest.iter().map(|device| device.next())).min();
        next.unwrap_or(u64::MAX).min(self.system.next(&self.pulse))
    }

    /// Does everything that is due by now.
    pub fn advance(&mut self, memory: &mut dyn Memory) {
        let now = self.pulse.now.get();
        self.system.advance(&mut self.nvic, &self.pulse);
        for i2c in &mut self.i2c {
            i2c.advance_with(now, &mut [&mut self.touch]);
            i2c.lines(&mut self.nvic);
        }
        let timers = self.timers.iter_mut().map(|timer| timer as &mut dyn Device);
        let rest: [&mut dyn Device; 5] =
            [&mut self.ltdc, &mut self.quadspi, &mut self.host, &mut self.port, &mut self.exti];
        for device in timers.chain(rest) {
            if device.next() <= now {
                device.advance(now, memory);
            }
            device.lines(&mut self.nvic);
        }
        if self.iwdg.has_bitten(now) {
            self.ask(Cause::Watchdog);
        }
        self.settle();
    }

    /// Looks again at what is due, after something from outside.
    pub fn disturbed(&mut self) {
        self.exti.lines(&mut self.nvic);
        self.settle();
    }

    /// Looks again at the host port, after a plug was pulled.
    pub fn host_disturbed(&mut self) {
        self.host.lines(&mut self.nvic);
        self.settle();
    }

    fn drive(&mut self, (port, pin): (u8, u8), high: bool) {
        if self.gpio[usize::from(port)].drive(pin, high) {
            self.exti.edge(port, pin, high);
        }
        self.disturbed();
    }

    /// A finger on the screen, in pixels, or none.
    pub fn touch(&mut self, finger: Option<(u16, u16)>) {
        self.touch.touch(finger);
        // The controller pulses its line for every report; a level does for one that looks at the edge.
        self.drive(TOUCH, true);
        if finger.is_some() {
            self.drive(TOUCH, false);
        }
    }

    /// The blue button goes down or up.
    pub fn button(&mut self, down: bool) {
        self.drive(BUTTON, down);
    }

    /// Power goes and comes back: what is in mid-write in the serial flash is torn.
    pub fn power_off(&mut self) {
        self.quadspi.flash.power_off(self.pulse.now.get());
        self.ask(Cause::Power);
    }

    /// Whether the panel's own switch is on, where the pin that drives it is one.
    pub fn panel_on(&self) -> bool {
        self.gpio[8].output(12).unwrap_or(false) && self.gpio[10].output(3).unwrap_or(false)
    }
}

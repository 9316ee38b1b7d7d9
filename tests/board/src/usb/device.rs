//! The device core, with a PC at the other end of the cable.

use std::collections::VecDeque;

use super::globals::{Globals, at, int};
use super::pc::{Pc, Token};
use crate::chip::{Device, Memory};
use crate::cpu::nvic::Nvic;

const LINE: u8 = 67;
const ENDPOINTS: usize = 6;
const ID: u32 = 0x3000;

const DCFG: u32 = 0x800;
const DCTL: u32 = 0x804;
const DSTS: u32 = 0x808;
const DIEPMSK: u32 = 0x810;
const DOEPMSK: u32 = 0x814;
const DAINT: u32 = 0x818;
const DAINTMSK: u32 = 0x81c;
const DIEPEMPMSK: u32 = 0x834;
const IN: u32 = 0x900;
const OUT: u32 = 0xb00;

const SDIS: u32 = 1 << 1;
const USBAEP: u32 = 1 << 15;
const NAKSTS: u32 = 1 << 17;
const STALL: u32 = 1 << 21;
const CNAK: u32 = 1 << 26;
const SNAK: u32 = 1 << 27;
const EPDIS: u32 = 1 << 30;
const EPENA: u32 = 1 << 31;

const XFRC: u32 = 1;
const EPDISD: u32 = 1 << 1;
const STUP: u32 = 1 << 3;
const INEPNE: u32 = 1 << 6;
const TXFE: u32 = 1 << 7;

/// Packet status in the receive FIFO.
const OUT_DATA: u32 = 2;
const OUT_DONE: u32 = 3;
const SETUP_DONE: u32 = 4;
const SETUP_DATA: u32 = 6;

/// One direction of an endpoint.
#[derive(Clone, Debug, Default)]
struct Endpoint {
    control: u32,
    interrupts: u32,
    size: u32,
    fifo: Vec<u8>,
}

impl Endpoint {
    fn length(&self) -> usize {
        (self.size & 0x7_ffff) as usize
    }

    fn write_control(&mut self, value: u32, first: bool) {
        const KEPT: u32 = 0x7ff | USBAEP | 3 << 18 | STALL | 0xf << 22;
        let mut control = self.control & (NAKSTS | EPENA) | value & KEPT;
        if value & CNAK != 0 {
            control &= !NAKSTS;
        }
        if value & SNAK != 0 {
            control |= NAKSTS;
            self.interrupts |= INEPNE;
        }
        if value & EPENA != 0 {
            control |= EPENA;
        }
        if value & EPDIS != 0 && control & EPENA != 0 {
            control &= !EPENA;
            self.interrupts |= EPDISD;
            self.fifo.clear();
        }
        if first {
            // Endpoint 0 is always there.
            control |= USBAEP;
        }
        self.control = control;
    }
}

/// What an endpoint says to the PC.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Said {
    /// A packet, or that one was taken.
    Done(Vec<u8>),
    /// Not now.
    Nak,
    /// The request is refused.
    Stall,
}

/// OTG_FS as a device.
pub struct Port {
    globals: Globals,
    core: Core,
    /// The PC.
    pub pc: Pc,
}

/// The part of the core that the PC talks to.
pub struct Core {
    latched: u32,
    config: u32,
    control: u32,
    masks: [u32; 2],
    all_mask: u32,
    empty_mask: u32,
    fifo_sizes: [u32; 16],
    input: [Endpoint; ENDPOINTS],
    output: [Endpoint; ENDPOINTS],
    received: VecDeque<(u32, Vec<u8>)>,
    reading: VecDeque<u32>,
}

impl Default for Core {
    fn default() -> Self {
        let mut core = Self {
            latched: 0,
            config: 0,
            control: SDIS,
            masks: [0; 2],
            all_mask: 0,
            empty_mask: 0,
            fifo_sizes: [0; 16],
            input: Default::default(),
            output: Default::default(),
            received: VecDeque::new(),
            reading: VecDeque::new(),
        };
        core.input[0].control = USBAEP;
        core.output[0].control = USBAEP | NAKSTS;
        core
    }
}

impl Core {
    /// The pull-up on the data line that tells the PC of the device.
    pub fn is_connected(&self) -> bool {
        self.control & SDIS == 0
    }

    /// A reset on the bus begins, or ends.
    pub fn bus_reset(&mut self, begins: bool) {
        if begins {
            for endpoint in self.input.iter_mut().chain(&mut self.output) {
                endpoint.control &= !(STALL | EPENA);
                endpoint.fifo.clear();
            }
            self.received.clear();
            self.config &= !0x7f0;
            self.latched |= int::USBRST;
        } else {
            self.latched |= int::ENUMDNE;
        }
    }

    /// A setup packet: never refused.
    pub fn setup(&mut self, packet: [u8; 8]) {
        self.input[0].control &= !STALL;
        self.output[0].control &= !STALL;
        self.output[0].control |= NAKSTS;
        self.received.push_back((8 << 4 | SETUP_DATA << 17, packet.to_vec()));
        self.received.push_back((SETUP_DONE << 17, Vec::new()));
    }

    /// Whether a token would be answered with anything but "not now".
    pub fn would_answer(&self, token: &Token) -> bool {
        match token {
            Token::In(number) => {
                let endpoint = &self.input[usize::from(*number)];
                let ready = endpoint.control & EPENA != 0
                    && endpoint.control & NAKSTS == 0
                    && endpoint.fifo.len() >= endpoint.length();
                endpoint.control & STALL != 0 || ready
            }
            Token::Out(number, _) => {
                let endpoint = &self.output[usize::from(*number)];
                endpoint.control & STALL != 0
                    || endpoint.control & NAKSTS == 0 && endpoint.control & USBAEP != 0
            }
        }
    }

    /// Answers a token of the PC.
    pub fn answer(&mut self, token: Token) -> Said {
        if !self.would_answer(&token) {
            return Said::Nak;
        }
        match token {
            Token::In(number) => {
                let endpoint = &mut self.input[usize::from(number)];
                if endpoint.control & STALL != 0 {
                    return Said::Stall;
                }
                let length = endpoint.length();
                let mut packet = std::mem::take(&mut endpoint.fifo);
                packet.truncate(length);
                endpoint.control = endpoint.control & !EPENA | NAKSTS;
                endpoint.size = 0;
                endpoint.interrupts |= XFRC;
                Said::Done(packet)
            }
            Token::Out(number, data) => {
                let endpoint = &mut self.output[usize::from(number)];
                if endpoint.control & STALL != 0 {
                    return Said::Stall;
                }
                endpoint.control |= NAKSTS;
                endpoint.size &= !0x1ff8_0000;
                let count = (data.len() as u32) << 4 | u32::from(number);
                self.received.push_back((count | OUT_DATA << 17, data));
                self.received.push_back((u32::from(number) | OUT_DONE << 17, Vec::new()));
                Said::Done(Vec::new())
            }
        }
    }

    fn all_interrupts(&self) -> u32 {
        let mut word = 0;
        for (number, endpoint) in self.input.iter().enumerate() {
            let empty = endpoint.fifo.is_empty() && self.empty_mask & 1 << number != 0;
            let waiting = endpoint.interrupts & self.masks[0] != 0 || empty;
            word |= u32::from(waiting) << number;
        }
        for (number, endpoint) in self.output.iter().enumerate() {
            word |= u32::from(endpoint.interrupts & self.masks[1] != 0) << (16 + number);
        }
        word
    }

    fn status(&self) -> u32 {
        let all = self.all_interrupts() & self.all_mask;
        let mut status = self.latched;
        for (bits, flag) in [(0xffff, int::IEP), (0xffff_0000, int::OEP)] {
            if all & bits != 0 {
                status |= flag;
            }
        }
        if !self.received.is_empty() {
            status |= int::RXFLVL;
        }
        status
    }

    fn pop(&mut self) -> u32 {
        let Some((status, bytes)) = self.received.pop_front() else { return 0 };
        self.reading.clear();
        for chunk in bytes.chunks(4) {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            self.reading.push_back(u32::from_le_bytes(word));
        }
        let endpoint = &mut self.output[(status & 0xf) as usize];
        match status >> 17 & 0xf {
            SETUP_DONE => endpoint.interrupts |= STUP,
            OUT_DONE => endpoint.interrupts |= XFRC,
            _ => {}
        }
        status
    }

    fn endpoint(&mut self, at: u32) -> Option<(&mut Endpoint, usize)> {
        let (endpoints, base) =
            if at < OUT { (&mut self.input, IN) } else { (&mut self.output, OUT) };
        let number = ((at - base) / 0x20) as usize;
        endpoints.get_mut(number).map(|endpoint| (endpoint, number))
    }
}

impl Default for Port {
    fn default() -> Self {
        Self { globals: Globals::new(ID), core: Core::default(), pc: Pc::default() }
    }
}

impl Device for Port {
    fn read(&mut self, at: u32, _size: u8, now: u64) -> u32 {
        match at {
            at::GINTSTS => {
                let host = if self.globals.is_host() { int::CMOD } else { 0 };
                self.core.status() | self.globals.latched | host
            }
            at::GRXSTSR => self.core.received.front().map_or(0, |(status, _)| *status),
            at::GRXSTSP => self.core.pop(),
            0x100..0x140 => self.core.fifo_sizes[(at - 0x100) as usize / 4],
            DCFG => self.core.config,
            DCTL => self.core.control,
            // Full speed; a frame every millisecond.
            DSTS => 3 << 1 | ((now / crate::time::MS) as u32 % 0x4000) << 8,
            DIEPMSK => self.core.masks[0],
            DOEPMSK => self.core.masks[1],
            DAINT => self.core.all_interrupts(),
            DAINTMSK => self.core.all_mask,
            DIEPEMPMSK => self.core.empty_mask,
            IN..0xd00 => {
                let output = at >= OUT;
                let Some((endpoint, _)) = self.core.endpoint(at) else { return 0 };
                match at & 0x1f {
                    0x00 => endpoint.control,
                    0x08 if output => endpoint.interrupts,
                    0x08 => endpoint.interrupts | if endpoint.fifo.is_empty() { TXFE } else { 0 },
                    0x10 => endpoint.size,
                    // Words that are free in its FIFO.
                    0x18 => 0x80_u32.saturating_sub(endpoint.fifo.len() as u32 / 4),
                    _ => 0,
                }
            }
            at::FIFO.. => self.core.reading.pop_front().unwrap_or(0),
            _ => self.globals.read(at).unwrap_or(0),
        }
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, _now: u64) {
        match at {
            0x100..0x140 => self.core.fifo_sizes[(at - 0x100) as usize / 4] = value,
            DCFG => self.core.config = value,
            DCTL => self.core.control = value,
            DIEPMSK => self.core.masks[0] = value,
            DOEPMSK => self.core.masks[1] = value,
            DAINTMSK => self.core.all_mask = value,
            DIEPEMPMSK => self.core.empty_mask = value,
            IN..0xd00 => {
                let Some((endpoint, number)) = self.core.endpoint(at) else { return };
                match at & 0x1f {
                    0x00 => endpoint.write_control(value, number == 0),
                    0x08 => endpoint.interrupts &= !value,
                    0x10 => endpoint.size = value,
                    _ => {}
                }
            }
            at::FIFO.. => {
                let number = ((at - at::FIFO) / 0x1000) as usize;
                if let Some(endpoint) = self.core.input.get_mut(number) {
                    endpoint.fifo.extend(value.to_le_bytes());
                }
            }
            _ => {
                if at == at::GINTSTS {
                    self.core.latched &= !value;
                }
                let flush = self.globals.write(at, value);
                if flush.core {
                    self.core = Core::default();
                }
                if flush.rx {
                    self.core.received.clear();
                    self.core.reading.clear();
                }
                if let Some(number) = flush.tx {
                    for (index, endpoint) in self.core.input.iter_mut().enumerate() {
                        if number == 0x10 || usize::from(number) == index {
                            endpoint.fifo.clear();
                        }
                    }
                }
            }
        }
    }

    fn next(&self) -> u64 {
        self.pc.next(&self.core)
    }

    fn advance(&mut self, now: u64, _memory: &mut dyn Memory) {
        self.pc.advance(&mut self.core, now);
    }

    fn lines(&self, nvic: &mut Nvic) {
        let status = self.core.status() | self.globals.latched;
        nvic.set_line(LINE, self.globals.interrupts(status));
    }

    fn reset(&mut self) {
        (self.globals, self.core) = (Globals::new(ID), Core::default());
        self.pc.lost();
    }
}

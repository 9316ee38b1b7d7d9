//! The host core with its 16 channels, with and without DMA.

mod port;
mod wire;

use std::collections::VecDeque;

use super::channel::{CHDIS, CHENA, Channel, hcint};
use super::function::Attached;
use super::globals::{DMAEN, Globals, at, int};
use crate::chip::{Device, Memory};
use crate::cpu::nvic::Nvic;
use crate::time::{NEVER, US};

pub use port::Unplug;
use port::{PCDET, PCSTS, PENA, PENCHNG, POCCHNG};
use wire::Flight;
pub use wire::Traffic;

const LINE: u8 = 77;
const CHANNELS: usize = 16;
const ID: u32 = 0x3100;

const HCFG: u32 = 0x400;
const HFIR: u32 = 0x404;
const HFNUM: u32 = 0x408;
const HPTXSTS: u32 = 0x410;
const HAINT: u32 = 0x414;
const HAINTMSK: u32 = 0x418;
const HPRT: u32 = 0x440;
const CHANNEL: u32 = 0x500;

/// Packet status in the receive FIFO.
const IN_DATA: u32 = 2;
const IN_DONE: u32 = 3;

/// A start of frame every 125 us.
const MICROFRAME_PS: u64 = 125 * US;

/// A word of the receive FIFO with what belongs to it.
struct Received {
    status: u32,
    words: VecDeque<u32>,
}

/// OTG_HS as a host.
pub struct Host {
    globals: Globals,
    channels: [Channel; CHANNELS],
    haintmsk: u32,
    hcfg: u32,
    hfir: u32,
    hptxfsiz: u32,
    port: u32,
    received: VecDeque<Received>,
    /// Words that are still to be read from the FIFO.
    reading: VecDeque<u32>,
    attached: Option<Attached>,
    /// When the plug is seen.
    seen_at: u64,
    flight: Option<Flight>,
    turn: usize,
    next_sof: u64,
    began: u64,
    /// Transactions to come that go wrong on the wire.
    pub broken: u32,
    /// What crossed the port.
    pub traffic: Traffic,
}

impl Default for Host {
    fn default() -> Self {
        Self {
            globals: Globals::new(ID),
            channels: Default::default(),
            haintmsk: 0,
            hcfg: 0,
            hfir: 0xea60,
            hptxfsiz: 0,
            port: 0,
            received: VecDeque::new(),
            reading: VecDeque::new(),
            attached: None,
            seen_at: NEVER,
            flight: None,
            turn: 0,
            next_sof: NEVER,
            began: 0,
            broken: 0,
            traffic: Traffic::default(),
        }
    }
}

impl Host {
    fn dma(&self) -> bool {
        self.globals.gahbcfg & DMAEN != 0
    }

    fn status(&self) -> u32 {
        let mut status = self.globals.latched | int::NPTXFE | int::PTXFE;
        if self.globals.is_host() {
            status |= int::CMOD;
        }
        if !self.received.is_empty() {
            status |= int::RXFLVL;
        }
        if self.port & (PCDET | PENCHNG | POCCHNG) != 0 {
            status |= int::HPRT;
        }
        if self.haint() & self.haintmsk != 0 {
            status |= int::HC;
        }
        status
    }

    fn haint(&self) -> u32 {
        self.channels.iter().enumerate().fold(0, |word, (index, channel)| {
            word | u32::from(channel.interrupts & channel.mask != 0) << index
        })
    }

    /// A channel is enabled or halted.
    fn set_character(&mut self, index: usize, value: u32, now: u64) {
        let channel = &mut self.channels[index];
        let was_on = channel.character & CHENA != 0;
        channel.character = value;
        if value & CHDIS != 0 {
            channel.active = false;
            if value & CHENA != 0 || was_on {
                // What is on the wire ends first.
                let wire = self.flight.as_ref().filter(|flight| flight.channel == index);
                channel.halting = wire.map_or(now + US, |flight| flight.ends + US);
            }
            return;
        }
        if value & CHENA != 0 {
            channel.active = true;
            channel.parked = 0;
            channel.halting = NEVER;
        }
    }

    fn pop(&mut self) -> u32 {
        let Some(packet) = self.received.pop_front() else { return 0 };
        self.reading = packet.words;
        if packet.status >> 17 & 0xf == IN_DONE {
            let channel = &mut self.channels[(packet.status & 0xf) as usize];
            channel.interrupts |= hcint::XFRC | hcint::ACK;
            channel.character &= !CHENA;
        }
        packet.status
    }
}

impl Device for Host {
    fn read(&mut self, at: u32, _size: u8, now: u64) -> u32 {
        match at {
            at::GINTSTS => self.status(),
            at::GRXSTSR => self.received.front().map_or(0, |packet| packet.status),
            at::GRXSTSP => self.pop(),
            // Room for a packet, and for eight requests.
            at::GNPTXSTS | HPTXSTS => 8 << 16 | 0x200,
            0x100 => self.hptxfsiz,
            HCFG => self.hcfg,
            HFIR => self.hfir,
            HFNUM => (now.saturating_sub(self.began) / MICROFRAME_PS) as u32 & 0x3fff,
            HAINT => self.haint(),
            HAINTMSK => self.haintmsk,
            HPRT => self.port,
            CHANNEL..0x700 => {
                let channel = &self.channels[((at - CHANNEL) / 0x20) as usize];
                match at & 0x1f {
                    0x00 => channel.character,
                    0x08 => channel.interrupts,
                    0x0c => channel.mask,
                    0x10 => channel.size,
                    0x14 => channel.dma,
                    _ => 0,
                }
            }
            at::FIFO.. => self.reading.pop_front().unwrap_or(0),
            _ => self.globals.read(at).unwrap_or(0),
        }
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, now: u64) {
        match at {
            0x100 => self.hptxfsiz = value,
            HCFG => self.hcfg = value,
            HFIR => self.hfir = value,
            HAINTMSK => self.haintmsk = value,
            HPRT => self.write_port(value, now),
            CHANNEL..0x700 => {
                let index = ((at - CHANNEL) / 0x20) as usize;
                let channel = &mut self.channels[index];
                match at & 0x1f {
                    0x00 => self.set_character(index, value, now),
                    0x08 => channel.interrupts &= !value,
                    0x0c => channel.mask = value,
                    0x10 => {
                        channel.size = value;
                        channel.out.clear();
                    }
                    0x14 => channel.dma = value,
                    _ => {}
                }
            }
            at::FIFO.. => {
                let index = ((at - at::FIFO) / 0x1000) as usize;
                if let Some(channel) = self.channels.get_mut(index) {
                    channel.out.extend(value.to_le_bytes());
                }
            }
            _ => {
                let flush = self.globals.write(at, value);
                if flush.core {
                    self.channels = Default::default();
                    self.flight = None;
                }
                if flush.rx || flush.core {
                    self.received.clear();
                    self.reading.clear();
                }
            }
        }
    }

    fn next(&self) -> u64 {
        let mut next = self.seen_at;
        if let Some(flight) = &self.flight {
            next = next.min(flight.ends);
        } else if self.port & PENA != 0 {
            for channel in &self.channels {
                if channel.active && self.may_go(channel, NEVER) {
                    next = next.min(channel.parked);
                }
            }
        }
        for channel in &self.channels {
            if channel.character & CHDIS != 0 {
                next = next.min(channel.halting);
            }
        }
        if self.globals.gintmsk & int::SOF != 0 {
            next = next.min(self.next_sof);
        }
        next
    }

    fn advance(&mut self, now: u64, memory: &mut dyn Memory) {
        if self.seen_at <= now {
            self.seen_at = NEVER;
            self.port |= PCSTS | PCDET;
        }
        if self.next_sof <= now {
            self.globals.latched |= int::SOF;
            let frames = (now - self.next_sof) / MICROFRAME_PS + 1;
            self.next_sof += frames * MICROFRAME_PS;
        }
        for channel in &mut self.channels {
            if channel.character & CHDIS != 0 && channel.halting <= now {
                channel.halting = NEVER;
                channel.character &= !(CHENA | CHDIS);
                channel.interrupts |= hcint::CHH;
            }
        }
        if let Some(flight) = self.flight.take_if(|flight| flight.ends <= now) {
            self.land(flight, memory);
        }
        self.start_one(now, memory);
    }

    fn lines(&self, nvic: &mut Nvic) {
        nvic.set_line(LINE, self.globals.interrupts(self.status()));
    }

    fn reset(&mut self) {
        let (attached, traffic, broken) = (self.attached.take(), self.traffic, self.broken);
        *self = Self { attached, traffic, broken, ..Self::default() };
    }
}

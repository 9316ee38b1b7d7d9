//! The host core with its 16 channels, with and without DMA.

use std::collections::VecDeque;

use super::channel::{CHDIS, CHENA, Channel, hcint};
use super::function::{Answer, Attached, Function};
use super::globals::{DMAEN, Globals, at, int};
use crate::chip::{Device, Memory};
use crate::cpu::nvic::Nvic;
use crate::time::{MS, NEVER, S, US};

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

const PCSTS: u32 = 1;
const PCDET: u32 = 1 << 1;
const PENA: u32 = 1 << 2;
const PENCHNG: u32 = 1 << 3;
const POCCHNG: u32 = 1 << 5;
const PRST: u32 = 1 << 8;
const PPWR: u32 = 1 << 12;

/// Packet status in the receive FIFO.
const IN_DATA: u32 = 2;
const IN_DONE: u32 = 3;

/// A start of frame every 125 us.
const MICROFRAME_PS: u64 = 125 * US;
/// Token, turnaround, headers and handshake of a bulk transaction, as so many bytes more.
const OVERHEAD_BYTES: u64 = 55;
/// Bits a second on the wire.
const WIRE_HZ: u64 = 480_000_000;
/// A token that is answered NAK.
const NAK_PS: u64 = 667_000;
/// Time in which a device that is gone would have answered three times.
const ERROR_PS: u64 = 5 * US;
/// Time from a plug to its being seen.
const CONNECT_PS: u64 = 100 * MS;

/// What an unplugged camera leaves behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unplug {
    /// Errors on open channels, and the port says so.
    Plain,
    /// The port says so; transfers that were under way just never end.
    Quiet,
    /// Errors on open channels, and not a word from the port.
    ErrorsOnly,
}

/// A word of the receive FIFO with what belongs to it.
struct Received {
    status: u32,
    words: VecDeque<u32>,
}

/// A transaction on the wire.
struct Flight {
    channel: usize,
    answer: Answer,
    ends: u64,
}

/// What crossed the port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Packets with data that came.
    pub packets: u64,
    /// Bytes that came.
    pub bytes: u64,
    /// Tokens that were answered NAK and told to the driver.
    pub naks: u64,
    /// Packets thrown away because their toggle was not the one waited for.
    pub toggle_errors: u64,
    /// Tokens that nobody answered.
    pub errors: u64,
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
    /// Plugs a device in.
    pub fn plug(&mut self, function: Box<dyn Function>, now: u64) {
        self.attached = Some(Attached::new(function));
        self.seen_at = if self.port & PPWR != 0 { now + CONNECT_PS } else { NEVER };
    }

    /// Takes the device out and hands it back.
    pub fn unplug(&mut self, how: Unplug) -> Option<Box<dyn Function>> {
        let gone = self.attached.take()?;
        self.seen_at = NEVER;
        if how != Unplug::ErrorsOnly {
            self.disconnected();
        }
        if how == Unplug::Quiet {
            self.flight = None;
            for channel in &mut self.channels {
                channel.active = false;
            }
        }
        Some(gone.function)
    }

    fn disconnected(&mut self) {
        if self.port & PCSTS != 0 {
            self.globals.latched |= int::DISC;
            if self.port & PENA != 0 {
                self.port |= PENCHNG;
                self.next_sof = NEVER;
            }
            self.port &= !(PCSTS | PENA | PRST);
        }
    }

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

    /// Words that wait in the receive FIFO, with the status word of each packet.
    fn waiting_words(&self) -> usize {
        self.received.iter().map(|packet| packet.words.len() + 1).sum()
    }

    /// Whether a channel may go on the wire now.
    fn may_go(&self, channel: &Channel, now: u64) -> bool {
        if !channel.active || channel.parked > now {
            return false;
        }
        if channel.is_in() {
            let room = self.globals.grxfsiz as usize;
            self.dma() || self.waiting_words() + channel.max_packet() / 4 + 2 <= room
        } else {
            self.dma() || channel.out.len() >= channel.length().min(channel.max_packet())
        }
    }

    /// Puts the next transaction on the wire, when it is free.
    fn start_one(&mut self, now: u64, memory: &dyn Memory) {
        if self.flight.is_some() || self.port & PENA == 0 {
            return;
        }
        let order = (0..CHANNELS).map(|step| (self.turn + step) % CHANNELS);
        let Some(index) = order.into_iter().find(|index| self.may_go(&self.channels[*index], now))
        else {
            return;
        };
        self.turn = (index + 1) % CHANNELS;
        let dma = self.dma();
        let channel = &mut self.channels[index];
        let (address, endpoint) = (channel.address(), channel.endpoint());
        let mut sent = 0;
        let answer = match (&mut self.attached, self.broken > 0) {
            (None, _) => Answer::Silence,
            (Some(_), true) => {
                self.broken -= 1;
                Answer::Silence
            }
            (Some(device), false) if channel.is_in() => device.input(address, endpoint, now),
            (Some(device), false) => {
                let length = channel.length().min(channel.max_packet());
                let mut data = vec![0; length];
                if dma {
                    memory.read(channel.dma, &mut data);
                } else {
                    data.copy_from_slice(&channel.out[..length]);
                }
                sent = length as u64;
                match <[u8; 8]>::try_from(data.as_slice()) {
                    Ok(setup) if channel.pid() == 3 => device.setup(address, setup, now),
                    _ => device.output(address, endpoint, &data, now),
                }
            }
        };
        let takes = match &answer {
            Answer::Data(bytes, _) => wire_ps(bytes.len() as u64),
            Answer::Ack => wire_ps(sent),
            Answer::Nak | Answer::Stall => NAK_PS,
            Answer::Silence => ERROR_PS,
        };
        self.flight = Some(Flight { channel: index, answer, ends: now + takes });
    }

    fn land(&mut self, flight: Flight, memory: &mut dyn Memory) {
        let dma = self.dma();
        let index = flight.channel;
        let now = flight.ends;
        let channel = &mut self.channels[index];
        match flight.answer {
            Answer::Data(bytes, toggle) => {
                let wanted = channel.pid() == 2;
                if toggle != wanted {
                    // Taken for one that was sent again: acknowledged and thrown away.
                    self.traffic.toggle_errors += 1;
                    channel.interrupts |= hcint::DTERR;
                    channel.active &= dma;
                    return;
                }
                self.traffic.packets += 1;
                self.traffic.bytes += bytes.len() as u64;
                let fits = bytes.len().min(channel.length());
                channel.set_length(channel.length() - fits);
                channel.set_packets(channel.packets().saturating_sub(1));
                let short = bytes.len() < channel.max_packet();
                let pid = channel.pid();
                channel.toggle();
                let done = short || channel.packets() == 0;
                if dma {
                    memory.write(channel.dma, &bytes[..fits]);
                    channel.dma += fits as u32;
                    channel.interrupts |= hcint::ACK;
                    if done {
                        channel.finish(hcint::XFRC | hcint::CHH);
                    }
                } else {
                    let status = |kind, count| index as u32 | count << 4 | pid << 15 | kind << 17;
                    let mut words: VecDeque<u32> = VecDeque::new();
                    for chunk in bytes.chunks(4) {
                        let mut word = [0; 4];
                        word[..chunk.len()].copy_from_slice(chunk);
                        words.push_back(u32::from_le_bytes(word));
                    }
                    let count = bytes.len() as u32;
                    self.received.push_back(Received { status: status(IN_DATA, count), words });
                    if done {
                        let words = VecDeque::new();
                        self.received.push_back(Received { status: status(IN_DONE, 0), words });
                    }
                    // Each packet wants a request of its own.
                    self.channels[index].active = false;
                }
            }
            Answer::Ack => {
                let length = channel.length().min(channel.max_packet());
                channel.set_length(channel.length() - length);
                channel.set_packets(channel.packets().saturating_sub(1));
                channel.toggle();
                if dma {
                    channel.dma += length as u32;
                } else {
                    let words = length.div_ceil(4) * 4;
                    channel.out.drain(..words.min(channel.out.len()));
                }
                channel.interrupts |= hcint::ACK;
                if channel.packets() == 0 || channel.length() == 0 {
                    channel.finish(hcint::XFRC | hcint::CHH);
                }
            }
            Answer::Nak => {
                channel.interrupts |= hcint::NAK;
                if dma {
                    // The core asks again by itself; nobody hears of it, so time may be skipped.
                    let endpoint = channel.endpoint();
                    let ready = self
                        .attached
                        .as_ref()
                        .map_or(now, |device| device.function.ready_at(endpoint, now));
                    let again = if endpoint == 0 { now + NAK_PS } else { ready.max(now + NAK_PS) };
                    channel.parked = again;
                    if channel.mask & hcint::NAK != 0 {
                        self.traffic.naks += 1;
                        channel.parked = now + NAK_PS;
                    }
                } else {
                    self.traffic.naks += 1;
                    channel.active = false;
                }
            }
            Answer::Stall => channel.finish(hcint::STALL | if dma { hcint::CHH } else { 0 }),
            Answer::Silence => {
                self.traffic.errors += 1;
                channel.finish(hcint::TXERR | if dma { hcint::CHH } else { 0 });
            }
        }
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

    fn write_port(&mut self, value: u32, now: u64) {
        let before = self.port;
        self.port &= !(value & (PCDET | PENCHNG | POCCHNG));
        if value & PENA != 0 {
            self.port &= !PENA;
            self.next_sof = NEVER;
        }
        const KEPT: u32 = PRST | PPWR | 0xf << 13 | 1 << 6 | 1 << 7;
        self.port = self.port & !KEPT | value & KEPT;
        if before & PPWR == 0 && value & PPWR != 0 && self.attached.is_some() {
            self.seen_at = now + CONNECT_PS;
        }
        if value & PPWR == 0 {
            self.port &= !(PCSTS | PENA);
            self.next_sof = NEVER;
        }
        if before & PRST != 0 && value & PRST == 0 && self.port & PCSTS != 0 {
            if let Some(device) = &mut self.attached {
                device.reset();
            }
            self.port |= PENA | PENCHNG;
            self.began = now;
            self.next_sof = now + MICROFRAME_PS;
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

/// Time of a transaction with so many bytes.
fn wire_ps(bytes: u64) -> u64 {
    (bytes + OVERHEAD_BYTES) * 8 * (S / WIRE_HZ)
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

//! The wire: which channel goes next, what is answered, and what becomes of that.

use std::collections::VecDeque;

use super::port::PENA;
use super::{CHANNELS, Host, IN_DATA, IN_DONE, Received};
use crate::chip::Memory;
use crate::time::{S, US};
use crate::usb::channel::{Channel, hcint};
use crate::usb::function::Answer;

/// Token, turnaround, headers and handshake of a bulk transaction, as so many bytes more.
const OVERHEAD_BYTES: u64 = 55;
/// Bits a second on the wire.
const WIRE_HZ: u64 = 480_000_000;
/// A token that is answered NAK.
const NAK_PS: u64 = 667_000;
/// Time in which a device that is gone would have answered three times.
const ERROR_PS: u64 = 5 * US;
/// A transaction on the wire.
pub(super) struct Flight {
    pub channel: usize,
    pub answer: Answer,
    pub ends: u64,
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

impl Host {
    /// Words that wait in the receive FIFO, with the status word of each packet.
    fn waiting_words(&self) -> usize {
        self.received.iter().map(|packet| packet.words.len() + 1).sum()
    }

    /// Whether a channel may go on the wire now.
    pub(super) fn may_go(&self, channel: &Channel, now: u64) -> bool {
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
    pub(super) fn start_one(&mut self, now: u64, memory: &dyn Memory) {
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

    pub(super) fn land(&mut self, flight: Flight, memory: &mut dyn Memory) {
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
}

/// Time of a transaction with so many bytes.
fn wire_ps(bytes: u64) -> u64 {
    (bytes + OVERHEAD_BYTES) * 8 * (S / WIRE_HZ)
}

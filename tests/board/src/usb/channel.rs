//! A channel of the host core: one transfer at a time.

/// Bit of a channel's character: it is to work.
pub const CHENA: u32 = 1 << 31;
/// It is to stop.
pub const CHDIS: u32 = 1 << 30;

/// Bits of a channel's interrupts.
pub mod hcint {
    pub const XFRC: u32 = 1;
    pub const CHH: u32 = 1 << 1;
    pub const STALL: u32 = 1 << 3;
    pub const NAK: u32 = 1 << 4;
    pub const ACK: u32 = 1 << 5;
    pub const TXERR: u32 = 1 << 7;
    pub const DTERR: u32 = 1 << 10;
}

/// A channel.
#[derive(Clone, Debug, Default)]
pub struct Channel {
    /// HCCHAR: whom it talks to.
    pub character: u32,
    /// HCINT.
    pub interrupts: u32,
    /// HCINTMSK.
    pub mask: u32,
    /// HCTSIZ: what is left.
    pub size: u32,
    /// HCDMA: where it goes on.
    pub dma: u32,
    /// Wants the bus.
    pub active: bool,
    /// Not before this: its device had nothing.
    pub parked: u64,
    /// Words written to the FIFO for it.
    pub out: Vec<u8>,
    /// A halt that will be reported then.
    pub halting: u64,
}

impl Channel {
    /// Bytes of a whole packet.
    pub fn max_packet(&self) -> usize {
        (self.character & 0x7ff) as usize
    }
    /// Number of the endpoint.
    pub fn endpoint(&self) -> u8 {
        (self.character >> 11 & 0xf) as u8
    }
    /// Whether the device sends.
    pub fn is_in(&self) -> bool {
        self.character & 1 << 15 != 0
    }
    /// Address of the device.
    pub fn address(&self) -> u8 {
        (self.character >> 22 & 0x7f) as u8
    }
    /// Bytes that are left.
    pub fn length(&self) -> usize {
        (self.size & 0x7_ffff) as usize
    }
    /// Packets that are left.
    pub fn packets(&self) -> u32 {
        self.size >> 19 & 0x3ff
    }
    /// Packet identifier that comes next.
    pub fn pid(&self) -> u32 {
        self.size >> 29 & 3
    }
    /// Sets the bytes that are left.
    pub fn set_length(&mut self, length: usize) {
        self.size = self.size & !0x7_ffff | length as u32 & 0x7_ffff;
    }
    /// Sets the packets that are left.
    pub fn set_packets(&mut self, packets: u32) {
        self.size = self.size & !(0x3ff << 19) | (packets & 0x3ff) << 19;
    }
    /// The next packet has the other identifier.
    pub fn toggle(&mut self) {
        // DATA0 is 0, DATA1 is 2; after a setup comes DATA1.
        let next = if self.pid() == 0 || self.pid() == 3 { 2 } else { 0 };
        self.size = self.size & !(3 << 29) | next << 29;
    }

    /// The transfer is over.
    pub fn finish(&mut self, interrupts: u32) {
        self.interrupts |= interrupts;
        self.active = false;
        if interrupts & hcint::CHH != 0 {
            self.character &= !(CHENA | CHDIS);
        }
    }
}

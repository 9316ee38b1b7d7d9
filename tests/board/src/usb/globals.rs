//! Registers that host and device share.

/// Offsets of the registers.
pub mod at {
    pub const GOTGCTL: u32 = 0x00;
    pub const GOTGINT: u32 = 0x04;
    pub const GAHBCFG: u32 = 0x08;
    pub const GUSBCFG: u32 = 0x0c;
    pub const GRSTCTL: u32 = 0x10;
    pub const GINTSTS: u32 = 0x14;
    pub const GINTMSK: u32 = 0x18;
    pub const GRXSTSR: u32 = 0x1c;
    pub const GRXSTSP: u32 = 0x20;
    pub const GRXFSIZ: u32 = 0x24;
    pub const GNPTXFSIZ: u32 = 0x28;
    pub const GNPTXSTS: u32 = 0x2c;
    pub const GCCFG: u32 = 0x38;
    pub const CID: u32 = 0x3c;
    pub const FIFO: u32 = 0x1000;
}

/// Bits of GINTSTS.
pub mod int {
    pub const CMOD: u32 = 1;
    pub const OTG: u32 = 1 << 2;
    pub const SOF: u32 = 1 << 3;
    pub const RXFLVL: u32 = 1 << 4;
    pub const NPTXFE: u32 = 1 << 5;
    pub const USBRST: u32 = 1 << 12;
    pub const ENUMDNE: u32 = 1 << 13;
    pub const IEP: u32 = 1 << 18;
    pub const OEP: u32 = 1 << 19;
    pub const HPRT: u32 = 1 << 24;
    pub const HC: u32 = 1 << 25;
    pub const PTXFE: u32 = 1 << 26;
    pub const DISC: u32 = 1 << 29;
}

/// Bit of GAHBCFG: the core moves data by itself.
pub const DMAEN: u32 = 1 << 5;
/// Bit of GRSTCTL: the bus is idle. Resets and flushes are over at once.
const AHBIDL: u32 = 1 << 31;
/// Bits of GINTSTS that stand for something else and cannot be cleared.
const DERIVED: u32 = int::CMOD
    | int::OTG
    | int::RXFLVL
    | int::NPTXFE
    | int::PTXFE
    | int::IEP
    | int::OEP
    | int::HPRT
    | int::HC;

/// A core reset or a flush was asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flush {
    /// The whole core.
    pub core: bool,
    /// What has been received.
    pub rx: bool,
    /// What waits to be sent: all of it, or by the number of its FIFO.
    pub tx: Option<u8>,
}

/// The shared registers.
#[derive(Clone, Debug)]
pub struct Globals {
    /// Version of the core.
    id: u32,
    /// Control of sessions.
    pub gotgctl: u32,
    /// What happened to sessions.
    pub gotgint: u32,
    /// Of the bus inside the chip.
    pub gahbcfg: u32,
    /// Of the USB.
    pub gusbcfg: u32,
    /// Latched bits of GINTSTS.
    pub latched: u32,
    /// Which of them interrupt.
    pub gintmsk: u32,
    /// Words of the receive FIFO.
    pub grxfsiz: u32,
    /// Of the first transmit FIFO.
    pub gnptxfsiz: u32,
    /// Power of the PHY.
    pub gccfg: u32,
}

impl Globals {
    /// A core of this version.
    pub const fn new(id: u32) -> Self {
        Self {
            id,
            gotgctl: 0,
            gotgint: 0,
            gahbcfg: 0,
            gusbcfg: 0x1400,
            latched: 0,
            gintmsk: 0,
            grxfsiz: 0x200,
            gnptxfsiz: 0x0200_0200,
            gccfg: 0,
        }
    }

    /// Reads one of these; `None` when it is none of them.
    pub fn read(&self, at: u32) -> Option<u32> {
        Some(match at {
            at::GOTGCTL => self.gotgctl,
            at::GOTGINT => self.gotgint,
            at::GAHBCFG => self.gahbcfg,
            at::GUSBCFG => self.gusbcfg,
            at::GRSTCTL => AHBIDL,
            at::GINTMSK => self.gintmsk,
            at::GRXFSIZ => self.grxfsiz,
            at::GNPTXFSIZ => self.gnptxfsiz,
            at::GCCFG => self.gccfg,
            at::CID => self.id,
            _ => return None,
        })
    }

    /// Writes one of these.
    pub fn write(&mut self, at: u32, value: u32) -> Flush {
        let mut flush = Flush::default();
        match at {
            at::GOTGCTL => self.gotgctl = value,
            at::GOTGINT => self.gotgint &= !value,
            at::GAHBCFG => self.gahbcfg = value,
            at::GUSBCFG => self.gusbcfg = value,
            at::GRSTCTL => {
                flush.core = value & 1 != 0;
                flush.rx = value & 1 << 4 != 0;
                flush.tx = (value & 1 << 5 != 0).then_some((value >> 6 & 0x1f) as u8);
            }
            at::GINTSTS => self.latched &= !(value & !DERIVED),
            at::GINTMSK => self.gintmsk = value,
            at::GRXFSIZ => self.grxfsiz = value,
            at::GNPTXFSIZ => self.gnptxfsiz = value,
            at::GCCFG => self.gccfg = value,
            _ => {}
        }
        flush
    }

    /// Whether these bits of GINTSTS, with the latched ones, interrupt.
    pub fn interrupts(&self, status: u32) -> bool {
        self.gahbcfg & 1 != 0 && status & self.gintmsk != 0
    }

    /// Forced to be a host.
    pub fn is_host(&self) -> bool {
        self.gusbcfg & 1 << 29 != 0
    }
}

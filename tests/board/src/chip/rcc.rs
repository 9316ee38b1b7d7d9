//! Clocks: what runs how fast follows from the registers, so that a wrong setting shows as wrong time.

use super::{Device, plain::Plain};

const CR: u32 = 0x00;
const PLLCFGR: u32 = 0x04;
const CFGR: u32 = 0x08;
const BDCR: u32 = 0x70;
const CSR: u32 = 0x74;
const DCKCFGR1: u32 = 0x8c;
/// Oscillators and PLLs in CR: their "on" bits; each is ready at the bit above.
const CR_ON: u32 = 1 | 1 << 16 | 1 << 24 | 1 << 26 | 1 << 28;
const HSEON: u32 = 1 << 16;
/// The crystal is watched.
const CSSON: u32 = 1 << 19;
const HSI_HZ: u64 = 16_000_000;
/// The crystal on the Discovery board.
const HSE_HZ: u64 = 25_000_000;
/// Bits of CSR: why the chip was reset.
const CSR_CAUSES: u32 = 0xfe00_0000;
const CSR_CLEAR: u32 = 1 << 24;

/// Why the chip was reset, as its register of causes tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Power came.
    Power,
    /// The reset pin, which is the black button.
    Pin,
    /// Software asked.
    Software,
    /// The watchdog.
    Watchdog,
}

impl Cause {
    const fn bits(self) -> u32 {
        match self {
            Self::Power => 1 << 27 | 1 << 26 | 1 << 25,
            Self::Pin => 1 << 26,
            Self::Software => 1 << 28 | 1 << 26,
            Self::Watchdog => 1 << 29 | 1 << 26,
        }
    }
}

/// What runs how fast, in Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// Processor and AHB.
    pub hclk_hz: u64,
    /// Peripherals on APB1.
    pub pclk1_hz: u64,
    /// Timers on APB1.
    pub timers1_hz: u64,
    /// Timers on APB2.
    pub timers2_hz: u64,
}

/// RCC.
pub struct Rcc {
    words: Plain,
    causes: u32,
    /// The crystal does not swing.
    still: bool,
}

impl Default for Rcc {
    fn default() -> Self {
        const RESET: &[(u32, u32)] = &[(CR, 0x83), (PLLCFGR, 0x2400_3010), (0x30, 0x0010_0000)];
        Self { words: Plain::new(RESET), causes: Cause::Power.bits(), still: false }
    }
}

impl Rcc {
    /// Notes why the chip is reset.
    pub fn caused(&mut self, cause: Cause) {
        self.causes |= cause.bits();
    }

    /// Clocks as the registers set them.
    pub fn clocks(&self) -> Clocks {
        let config = self.words.get(CFGR);
        let sysclk_hz = match config & 3 {
            1 => HSE_HZ,
            2 => self.pll_hz(),
            _ => HSI_HZ,
        };
        let ahb = match config >> 4 & 0xf {
            code @ 8..=11 => code - 7,
            code @ 12.. => code - 6,
            _ => 0,
        };
        let apb = |at: u32| match config >> at & 7 {
            code @ 4.. => code - 3,
            _ => 0,
        };
        let hclk_hz = sysclk_hz >> ahb;
        // Timers run at twice the bus, where the bus is divided (four times with TIMPRE).
        let most = if self.words.get(DCKCFGR1) & 1 << 24 != 0 { 2 } else { 1 };
        let timers = |shift: u32| hclk_hz >> shift.saturating_sub(most);
        Clocks {
            hclk_hz,
            pclk1_hz: hclk_hz >> apb(10),
            timers1_hz: timers(apb(10)),
            timers2_hz: timers(apb(13)),
        }
    }

    fn pll_hz(&self) -> u64 {
        let config = self.words.get(PLLCFGR);
        let source = if config & 1 << 22 != 0 { HSE_HZ } else { HSI_HZ };
        let (m, n, p) = (config & 0x3f, config >> 6 & 0x1ff, (config >> 16 & 3) * 2 + 2);
        source * u64::from(n) / u64::from(m.max(1)) / u64::from(p)
    }

    /// The crystal swings again when it is next switched on.
    pub fn mend_crystal(&mut self) {
        self.still = false;
    }

    /// The crystal stops, until it is mended. Whether the chip's clock security system notices: it goes on at its own oscillator then, and
    /// raises the non-maskable interrupt.
    pub fn stop_crystal(&mut self) -> bool {
        self.still = true;
        let control = self.words.get(CR);
        let noticed = control & CSSON != 0 && control & HSEON != 0;
        if noticed {
            self.words.write(CR, control & !HSEON | 1, 4, 0);
            self.words.write(CFGR, self.words.get(CFGR) & !3, 4, 0);
        }
        noticed
    }

    /// The crystal runs and is what the processor's clock is made from.
    pub fn on_crystal(&self) -> bool {
        match self.words.get(CFGR) & 3 {
            1 => true,
            2 => self.words.get(PLLCFGR) & 1 << 22 != 0,
            _ => false,
        }
    }
}

impl Device for Rcc {
    fn read(&mut self, at: u32, _size: u8, _now: u64) -> u32 {
        let value = self.words.get(at);
        match at {
            CR => {
                let dead = if self.still { HSEON } else { 0 };
                let on = value & CR_ON & !dead;
                value & !(CR_ON << 1) | on << 1
            }
            CFGR => value & !0xc | (value & 3) << 2,
            BDCR => value & !2 | (value & 1) << 1,
            CSR => value & 1 | (value & 1) << 1 | self.causes & CSR_CAUSES,
            _ => value,
        }
    }

    fn write(&mut self, at: u32, value: u32, size: u8, now: u64) {
        if at == CSR && value & CSR_CLEAR != 0 {
            self.causes = 0;
        }
        self.words.write(at, value, size, now);
    }

    fn reset(&mut self) {
        self.words.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_follow_the_registers() {
        let mut rcc = Rcc::default();
        assert_eq!(rcc.clocks().hclk_hz, 16_000_000);
        // 25 MHz / 25 * 432 / 2; APB1 a quarter, APB2 a half.
        rcc.write(PLLCFGR, 1 << 22 | 432 << 6 | 25, 4, 0);
        rcc.write(CFGR, 2 | 5 << 10 | 4 << 13, 4, 0);
        let clocks = rcc.clocks();
        assert_eq!((clocks.hclk_hz, clocks.pclk1_hz), (216_000_000, 54_000_000));
        assert_eq!((clocks.timers1_hz, clocks.timers2_hz), (108_000_000, 216_000_000));
    }

    #[test]
    fn ready_follows_on_and_off() {
        let mut rcc = Rcc::default();
        rcc.write(CR, 1 << 24, 4, 0);
        assert_eq!(rcc.read(CR, 4, 0) & 3 << 24, 3 << 24);
        rcc.write(CR, 0, 4, 0);
        assert_eq!(rcc.read(CR, 4, 0) & 3 << 24, 0);
    }
}

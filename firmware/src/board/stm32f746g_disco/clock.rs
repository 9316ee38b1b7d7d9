//! Clocks: 216 MHz from the board's crystal of 25 MHz. A reading is only as good as its clock, so that there is none
//! without the crystal.

use embassy_stm32::Config;
use embassy_stm32::pac::RCC;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllRDiv,
    PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;

/// What the board's clocks come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The crystal.
    Crystal,
    /// The chip's own oscillator, 1 % off: the crystal does not swing. Good enough to say so.
    Internal,
}

/// How often the crystal is looked at: a look takes ten cycles of 16 MHz at least, so that this is a tenth of a second,
/// fifty times what a crystal takes.
const LOOKS: u32 = 160_000;

/// Starts the crystal and says whether it swings. embassy-stm32 would wait for it for ever.
pub fn start_crystal() -> Source {
    RCC.cr().modify(|cr| cr.set_hseon(true));
    if (0..LOOKS).any(|_| RCC.cr().read().hserdy()) { Source::Crystal } else { Source::Internal }
}

/// From now on a crystal that stops raises the non-maskable interrupt, instead of leaving the board on its own oscillator.
pub fn watch_crystal() {
    RCC.cr().modify(|cr| cr.set_csson(true));
}

/// 216 MHz for the processor and the memory controller, 54 and 108 MHz for peripherals, 48 MHz for USB, 38.4 MHz for
/// the display.
pub fn config(source: Source) -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    // Both sources are divided down to 1 MHz.
    let prediv = match source {
        Source::Crystal => {
            rcc.hse = Some(Hse { freq: Hertz(25_000_000), mode: HseMode::Oscillator });
            rcc.hsi = false;
            rcc.pll_src = PllSource::HSE;
            PllPreDiv::DIV25
        }
        Source::Internal => {
            rcc.pll_src = PllSource::HSI;
            PllPreDiv::DIV16
        }
    };
    rcc.pll = Some(Pll {
        prediv,
        mul: PllMul::MUL432,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV9),
        divr: None,
    });
    rcc.pllsai = Some(Pll {
        prediv,
        mul: PllMul::MUL192,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV5),
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    rcc.apb1_pre = APBPrescaler::DIV4;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

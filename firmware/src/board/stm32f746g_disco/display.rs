//! The board's display: 480x272 pixels behind the LTDC (Rocktech RK043FN48H; its times are those of ST's board support).

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Speed};
use embassy_stm32::ltdc::{
    InterruptHandler, Ltdc, LtdcConfiguration, LtdcLayer, LtdcLayerConfig, PixelFormat,
    PolarityActive, PolarityEdge,
};
use embassy_stm32::pac;
use embassy_stm32::pac::RCC;
use embassy_stm32::pac::ltdc::vals::{Imr, Vbr};
use embassy_stm32::pac::rcc::vals::Pllsaidivr;
use embassy_stm32::{bind_interrupts, peripherals as pin};

use crate::panel::{HEIGHT, WIDTH};

bind_interrupts!(struct Irqs {
    LTDC => InterruptHandler<pin::LTDC>;
});

/// The pins that it hangs on.
pub struct Pins {
    pub ltdc: Peri<'static, pin::LTDC>,
    pub clock: Peri<'static, pin::PI14>,
    pub hsync: Peri<'static, pin::PI10>,
    pub vsync: Peri<'static, pin::PI9>,
    pub enable: Peri<'static, pin::PK7>,
    pub blue: (
        Peri<'static, pin::PE4>,
        Peri<'static, pin::PJ13>,
        Peri<'static, pin::PJ14>,
        Peri<'static, pin::PJ15>,
        Peri<'static, pin::PG12>,
        Peri<'static, pin::PK4>,
        Peri<'static, pin::PK5>,
        Peri<'static, pin::PK6>,
    ),
    pub green: (
        Peri<'static, pin::PJ7>,
        Peri<'static, pin::PJ8>,
        Peri<'static, pin::PJ9>,
        Peri<'static, pin::PJ10>,
        Peri<'static, pin::PJ11>,
        Peri<'static, pin::PK0>,
        Peri<'static, pin::PK1>,
        Peri<'static, pin::PK2>,
    ),
    pub red: (
        Peri<'static, pin::PI15>,
        Peri<'static, pin::PJ0>,
        Peri<'static, pin::PJ1>,
        Peri<'static, pin::PJ2>,
        Peri<'static, pin::PJ3>,
        Peri<'static, pin::PJ4>,
        Peri<'static, pin::PJ5>,
        Peri<'static, pin::PJ6>,
    ),
    /// LCD_DISP: high switches the panel on.
    pub display: Peri<'static, pin::PI12>,
    /// LCD_BL_CTRL: high switches the light behind it on.
    pub backlight: Peri<'static, pin::PK3>,
}

/// Switches the display on, showing the frame at an address.
#[inline(never)]
pub fn start(pins: Pins, frame: usize) {
    let Pins { ltdc, clock, hsync, vsync, blue: b, green: g, red: r, .. } = pins;
    let mut ltdc = Ltdc::new_with_pins(
        ltdc, Irqs, clock, hsync, vsync, b.0, b.1, b.2, b.3, b.4, b.5, b.6, b.7, g.0, g.1, g.2,
        g.3, g.4, g.5, g.6, g.7, r.0, r.1, r.2, r.3, r.4, r.5, r.6, r.7,
    );
    // The driver does not know the line that says which pixels count.
    let mut enable = Flex::new(pins.enable);
    enable.set_as_af_unchecked(14, AfType::output(OutputType::PushPull, Speed::VeryHigh));
    // The driver divides by 2: 38.4 MHz / 4 = 9.6 MHz, 59 frames a second.
    RCC.dckcfgr1().modify(|dividers| dividers.set_pllsaidivr(Pllsaidivr::DIV4));
    ltdc.init(&LtdcConfiguration {
        active_width: WIDTH as u16,
        active_height: HEIGHT as u16,
        h_sync: 41,
        h_back_porch: 13,
        h_front_porch: 32,
        v_sync: 10,
        v_back_porch: 2,
        v_front_porch: 2,
        h_sync_polarity: PolarityActive::ActiveLow,
        v_sync_polarity: PolarityActive::ActiveLow,
        data_enable_polarity: PolarityActive::ActiveLow,
        pixel_clock_polarity: PolarityEdge::FallingEdge,
    });
    ltdc.init_layer(
        &LtdcLayerConfig {
            layer: LtdcLayer::Layer1,
            pixel_format: PixelFormat::RGB565,
            window_x0: 0,
            window_x1: WIDTH as u16,
            window_y0: 0,
            window_y1: HEIGHT as u16,
        },
        None,
    );
    pac::LTDC.layer(0).cfbar().write(|address| address.set_cfbadd(frame as u32));
    pac::LTDC.srcr().write(|reload| reload.set_imr(Imr::RELOAD));
    // Pins that are let go float, and the panel would go dark.
    core::mem::forget(Output::new(pins.display, Level::High, Speed::Low));
    core::mem::forget(Output::new(pins.backlight, Level::High, Speed::Low));
    core::mem::forget(enable);
    core::mem::forget(ltdc);
}

/// Shows another frame, from the next one on.
pub fn show(frame: usize) {
    pac::LTDC.layer(0).cfbar().write(|address| address.set_cfbadd(frame as u32));
    pac::LTDC.srcr().write(|reload| reload.set_vbr(Vbr::RELOAD));
}

/// Whether the frame asked for last is shown.
pub fn shown() -> bool {
    pac::LTDC.srcr().read().vbr() != Vbr::RELOAD
}

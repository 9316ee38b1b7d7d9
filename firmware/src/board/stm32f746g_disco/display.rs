//! The board's display: 480x272 pixels behind the LTDC (Rocktech RK043FN48H; its times are those of ST's board support).

use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Speed};
use embassy_stm32::ltdc::{
    InterruptHandler, Ltdc, LtdcConfiguration, LtdcLayer, LtdcLayerConfig, PixelFormat,
    PolarityActive, PolarityEdge, RgbColor,
};
use embassy_stm32::pac;
use embassy_stm32::pac::RCC;
use embassy_stm32::pac::ltdc::vals::{Imr, Vbr};
use embassy_stm32::pac::rcc::vals::Pllsaidivr;
use embassy_stm32::{bind_interrupts, peripherals};

use crate::panel::{HEIGHT, WIDTH};
use crate::wiring::DisplayPins;

bind_interrupts!(struct Irqs {
    LTDC => InterruptHandler<peripherals::LTDC>;
});

/// Switches the display on, showing the frame at an address; with these colours its pixels are numbers of them, without
/// they are 16 bits.
#[inline(never)]
pub fn start(p: DisplayPins, frame: usize, colours: Option<&[RgbColor; 256]>) {
    let mut ltdc = Ltdc::new_with_pins(
        p.ltdc, Irqs, p.clock, p.hsync, p.vsync, p.b0, p.b1, p.b2, p.b3, p.b4, p.b5, p.b6, p.b7,
        p.g0, p.g1, p.g2, p.g3, p.g4, p.g5, p.g6, p.g7, p.r0, p.r1, p.r2, p.r3, p.r4, p.r5, p.r6,
        p.r7,
    );
    // The driver does not know the line that says which pixels count.
    let mut enable = Flex::new(p.enable);
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
            pixel_format: if colours.is_some() { PixelFormat::L8 } else { PixelFormat::RGB565 },
            window_x0: 0,
            window_x1: WIDTH as u16,
            window_y0: 0,
            window_y1: HEIGHT as u16,
        },
        colours.map(<[_; 256]>::as_slice),
    );
    pac::LTDC.layer(0).cfbar().write(|address| address.set_cfbadd(frame as u32));
    pac::LTDC.srcr().write(|reload| reload.set_imr(Imr::RELOAD));
    // Pins that are let go float, and the panel would go dark.
    core::mem::forget(Output::new(p.display, Level::High, Speed::Low));
    core::mem::forget(Output::new(p.backlight, Level::High, Speed::Low));
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

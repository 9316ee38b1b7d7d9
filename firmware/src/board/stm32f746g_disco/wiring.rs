//! Which pin of the chip leads where on the board (ST UM1907, tables 15 to 24 and the schematics of MB1191).

use embassy_stm32::peripherals as pin;
use embassy_stm32::{Peri, Peripherals};

use crate::{display, sdram};

/// The board's parts.
pub struct Board {
    pub sdram: sdram::Pins,
    pub display: display::Pins,
    pub watchdog: Peri<'static, pin::IWDG>,
}

/// Shares the chip's pins and peripherals out.
pub fn share_out(p: Peripherals) -> Board {
    Board {
        sdram: sdram::Pins {
            fmc: p.FMC,
            address: (
                p.PF0, p.PF1, p.PF2, p.PF3, p.PF4, p.PF5, p.PF12, p.PF13, p.PF14, p.PF15, p.PG0,
                p.PG1,
            ),
            bank: (p.PG4, p.PG5),
            data: (
                p.PD14, p.PD15, p.PD0, p.PD1, p.PE7, p.PE8, p.PE9, p.PE10, p.PE11, p.PE12, p.PE13,
                p.PE14, p.PE15, p.PD8, p.PD9, p.PD10,
            ),
            mask: (p.PE0, p.PE1),
            clock_enable: p.PC3,
            clock: p.PG8,
            column: p.PG15,
            chip: p.PH3,
            row: p.PF11,
            write: p.PH5,
        },
        display: display::Pins {
            ltdc: p.LTDC,
            clock: p.PI14,
            hsync: p.PI10,
            vsync: p.PI9,
            enable: p.PK7,
            blue: (p.PE4, p.PJ13, p.PJ14, p.PJ15, p.PG12, p.PK4, p.PK5, p.PK6),
            green: (p.PJ7, p.PJ8, p.PJ9, p.PJ10, p.PJ11, p.PK0, p.PK1, p.PK2),
            red: (p.PI15, p.PJ0, p.PJ1, p.PJ2, p.PJ3, p.PJ4, p.PJ5, p.PJ6),
            display: p.PI12,
            backlight: p.PK3,
        },
        watchdog: p.IWDG,
    }
}

//! Which pin of the chip leads where on the board (ST UM1907, and the schematics of MB1191).

use assign_resources::assign_resources;
use embassy_stm32::{Peri, Peripherals, peripherals};

assign_resources! {
    sdram: SdramPins {
        fmc: FMC,
        a0: PF0, a1: PF1, a2: PF2, a3: PF3, a4: PF4, a5: PF5,
        a6: PF12, a7: PF13, a8: PF14, a9: PF15, a10: PG0, a11: PG1,
        bank0: PG4, bank1: PG5,
        d0: PD14, d1: PD15, d2: PD0, d3: PD1, d4: PE7, d5: PE8, d6: PE9, d7: PE10,
        d8: PE11, d9: PE12, d10: PE13, d11: PE14, d12: PE15, d13: PD8, d14: PD9, d15: PD10,
        mask0: PE0, mask1: PE1,
        clock_enable: PC3, clock: PG8, column: PG15, chip: PH3, row: PF11, write: PH5,
    }
    display: DisplayPins {
        ltdc: LTDC,
        clock: PI14, hsync: PI10, vsync: PI9, enable: PK7,
        b0: PE4, b1: PJ13, b2: PJ14, b3: PJ15, b4: PG12, b5: PK4, b6: PK5, b7: PK6,
        g0: PJ7, g1: PJ8, g2: PJ9, g3: PJ10, g4: PJ11, g5: PK0, g6: PK1, g7: PK2,
        r0: PI15, r1: PJ0, r2: PJ1, r3: PJ2, r4: PJ3, r5: PJ4, r6: PJ5, r7: PJ6,
        // LCD_DISP, high: on. LCD_BL_CTRL, high: the light behind it.
        display: PI12, backlight: PK3,
    }
    input: InputPins {
        i2c: I2C3,
        scl: PH7, sda: PH8,
        // Low while a finger is on the screen.
        touched: PI13,
        // High while the blue button is pressed.
        button: PI11,
    }
    flash: FlashPins {
        qspi: QUADSPI,
        clock: PB2, chip: PB6, d0: PD11, d1: PD12, d2: PE2, d3: PD13,
    }
    port: PortPins {
        usb: USB_OTG_FS,
        plus: PA12, minus: PA11,
        // High: the board does not feed this port; it is the device here.
        feed: PD5,
    }
    // The PHY outside of the chip, a USB3320C.
    host: HostPins {
        otg: USB_OTG_HS,
        clock: PA5,
        d0: PA3, d1: PB0, d2: PB1, d3: PB10, d4: PB11, d5: PB12, d6: PB13, d7: PB5,
        stop: PC0, direction: PC2, next: PH4,
    }
    watchdog: WatchdogParts {
        iwdg: IWDG,
    }
}

/// Shares the chip's pins and peripherals out.
pub fn share_out(p: Peripherals) -> AssignedResources {
    split_resources!(p)
}

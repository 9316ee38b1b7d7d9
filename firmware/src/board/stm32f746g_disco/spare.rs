//! A screen without SDRAM: eight bits a pixel, in the memory of the events, which are not measured then.
#![expect(unsafe_code, reason = "memory as bytes that is handed out once")]

use core::mem::MaybeUninit;
use core::ops::Range;

use embassy_stm32::ltdc;
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;

use crate::memory::{STORE, STORE_BYTES};
use crate::panel::{HEIGHT, WIDTH};

const PIXELS: usize = WIDTH * HEIGHT;

const _: () = assert!(PIXELS <= STORE_BYTES);

/// The colours of the pixels: three bits of red, three of green, two of blue.
pub fn colours() -> [ltdc::RgbColor; 256] {
    core::array::from_fn(|code| {
        let (red, green, blue) = (code >> 5, code >> 2 & 7, code & 3);
        ltdc::RgbColor {
            red: (red * 255 / 7) as u8,
            green: (green * 255 / 7) as u8,
            blue: (blue * 255 / 3) as u8,
        }
    })
}

/// The pixels.
pub struct Spare(&'static mut [u8; PIXELS]);

/// Takes the memory of the events. The data cache must be off: the display does not see what is in it.
pub fn take() -> Spare {
    let store = core::ptr::from_mut(STORE.take()).cast::<MaybeUninit<[u8; PIXELS]>>();
    // SAFETY: the memory is as large (see above), has no other name any more, and zeros are pixels.
    unsafe {
        store.write_bytes(0, 1);
        Spare((*store).assume_init_mut())
    }
}

impl Spare {
    /// Where it lies.
    pub fn address(&self) -> usize {
        self.0.as_ptr().expose_provenance()
    }

    /// Sets a pixel; whether it is on the screen.
    pub fn set(&mut self, x: usize, y: usize, colour: Rgb565) -> bool {
        let pixel = self.0.get_mut(y * WIDTH + x).filter(|_| x < WIDTH && y < HEIGHT);
        pixel.map(|pixel| *pixel = code(colour)).is_some()
    }

    /// Sets the pixels of a row in these columns, which are on the screen.
    pub fn fill(&mut self, y: usize, columns: Range<usize>, colour: Rgb565) {
        let row = y * WIDTH;
        if let Some(pixels) = self.0.get_mut(row + columns.start..row + columns.end) {
            pixels.fill(code(colour));
        }
    }
}

/// What stands for a colour.
fn code(colour: Rgb565) -> u8 {
    colour.r() >> 2 << 5 | colour.g() >> 3 << 2 | colour.b() >> 3
}

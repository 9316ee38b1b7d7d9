//! The board's 16 MiB of external memory, which keeps what is in it over a reset: frame buffer, preferences,
//! the last fault, recordings. On the STM32F746G-DISCO these are SDRAM, QSPI flash and backup memory.
#![expect(unsafe_code, reason = "memory at fixed addresses, each handed out once")]

use core::convert::Infallible;
use core::ptr;
use core::sync::atomic::{AtomicBool, Ordering};

use embedded_graphics::framebuffer::{Framebuffer, buffer_size};
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::pixelcolor::raw::{LittleEndian, RawU16};
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use evtach_firmware::kept::KEPT_BYTES;
use evtach_firmware::settings::MemoryFlash;
use evtach_firmware::tasks;

use crate::tape::RecordingMemory;
use crate::trap;

/// Where it lies, and what is in it.
const START: usize = 0x6000_0000;
const PREFERENCES: usize = START + 0x4_0000;
const KEPT: usize = START + 0x5_0000;
const COOKIE: usize = START + 0x6_0000;
const SCRATCH: usize = START + 0x8_0000;
const SCRATCH_BYTES: usize = 0x8_0000;
const RECORDING: usize = START + 0x10_0000;
const RECORDING_BYTES: usize = 0xf0_0000;

/// What stands in [`COOKIE`] once the rest has been written for the first time.
const WRITTEN: u64 = 0x4556_5461_6368_2031;

/// Bytes for preferences: eight pages.
pub const PREFERENCES_BYTES: usize = 2048;

/// The frame buffer: 480x272 pixels of 16 bits.
type Frame =
    Framebuffer<Rgb565, RawU16, LittleEndian, 480, 272, { buffer_size::<Rgb565>(480, 272) }>;

/// Flash for preferences. The board has none: this stands in for it.
pub type Preferences = MemoryFlash<PREFERENCES_BYTES>;

const _: () = {
    assert!(size_of::<Frame>() <= PREFERENCES - START);
    assert!(size_of::<Preferences>() <= KEPT - PREFERENCES);
};

/// The external memory, to be taken once.
pub struct Psram {
    /// What the screen shows.
    pub panel: Panel,
    /// The preferences.
    pub preferences: &'static mut Preferences,
    /// Room for recordings.
    pub recording: RecordingMemory,
    /// Room for one thing more.
    pub scratch: Scratch,
    /// Whether it still holds what it held before a reset.
    pub warm: bool,
}

/// Takes the external memory; `None` the second time.
pub fn take() -> Option<Psram> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    let cookie = ptr::with_exposed_provenance_mut::<u64>(COOKIE);
    let frame = ptr::with_exposed_provenance_mut::<Frame>(START);
    let preferences = ptr::with_exposed_provenance_mut::<Preferences>(PREFERENCES);
    // SAFETY: the memory is there, aligned, apart from each other (see the constants), named by nothing else, and
    // this runs once. What is handed out has been written: now, or before the reset that the cookie outlived.
    unsafe {
        let warm = cookie.read_volatile() == WRITTEN;
        // All zeros are a black frame; one built on the stack would not fit there.
        frame.write_bytes(0, 1);
        if !warm {
            preferences.write(Preferences::new([0xff; PREFERENCES_BYTES]));
            cookie.write_volatile(WRITTEN);
        }
        let (recording, scratch) = (RecordingMemory::new(RECORDING, RECORDING_BYTES), Scratch(()));
        Some(Psram {
            panel: Panel(&mut *frame),
            preferences: &mut *preferences,
            recording,
            scratch,
            warm,
        })
    }
}

/// The frame buffer as the screen.
pub struct Panel(&'static mut Frame);

impl OriginDimensions for Panel {
    fn size(&self) -> Size {
        self.0.size()
    }
}

impl DrawTarget for Panel {
    type Color = Rgb565;
    type Error = Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Infallible>
    where
        I: IntoIterator<Item = Pixel<Rgb565>>,
    {
        self.0.draw_iter(pixels)
    }

    fn fill_solid(&mut self, area: &Rectangle, colour: Rgb565) -> Result<(), Infallible> {
        let area = area.intersection(&self.bounding_box());
        let [low, high] = colour.into_storage().to_le_bytes();
        let rows = self.0.data_mut().as_chunks_mut::<2>().0.chunks_exact_mut(480);
        let top = area.top_left.y as usize;
        for row in rows.skip(top).take(area.size.height as usize) {
            let left = area.top_left.x as usize;
            row[left..left + area.size.width as usize].fill([low, high]);
        }
        Ok(())
    }
}

impl tasks::Panel for Panel {
    fn bytes(&self) -> &[u8] {
        self.0.data()
    }
}

/// The block of the last fault.
pub fn read_kept() -> [u8; KEPT_BYTES] {
    // SAFETY: the memory is there, holds bytes, and nothing refers to it.
    unsafe { trap::read_kept(ptr::with_exposed_provenance(KEPT)) }
}

/// Writes the block of the last fault.
pub fn write_kept(block: &[u8; KEPT_BYTES]) {
    // SAFETY: as above.
    unsafe { trap::write_kept(ptr::with_exposed_provenance_mut(KEPT), block) }
}

/// Room for one thing.
#[derive(Debug)]
pub struct Scratch(());

impl Scratch {
    /// Puts it there for good.
    pub fn put<T>(self, value: T) -> &'static mut T {
        const { assert!(size_of::<T>() <= SCRATCH_BYTES && align_of::<T>() <= 8) };
        let place = ptr::with_exposed_provenance_mut::<T>(SCRATCH);
        // SAFETY: the memory is there, large enough and aligned, and named by `self` alone, which is used up.
        unsafe {
            place.write(value);
            &mut *place
        }
    }
}

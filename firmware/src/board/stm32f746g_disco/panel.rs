//! What is drawn on: the two frames in SDRAM, one shown while the other is drawn on, or, where that memory fails, the
//! [`Spare`].
#![expect(unsafe_code, reason = "memory at fixed addresses, handed out once")]

use core::convert::Infallible;
use core::ops::Range;
use core::ptr;
use core::sync::atomic::{AtomicBool, Ordering};

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use evtach_firmware::tasks;

use crate::display;
use crate::sdram::{FRAME_BYTES, FRAMES};
use crate::spare::Spare;

/// Pixels across.
pub const WIDTH: usize = 480;
/// Pixels down.
pub const HEIGHT: usize = 272;

/// A pixel as the display reads it: 16 bits, little-endian.
type Row = [[u8; 2]; WIDTH];
type Frame = [Row; HEIGHT];

const _: () = assert!(size_of::<Frame>() <= FRAME_BYTES);

/// How often the display is asked whether it has changed frames: longer than the 17 ms that a frame takes.
const LOOKS: u32 = 1_000_000;

/// The screen.
pub enum Panel {
    /// As it should be.
    Frames(Frames),
    /// Without SDRAM.
    Spare(Spare),
}

/// Two frames.
pub struct Frames {
    back: &'static mut Frame,
    front: &'static mut Frame,
    /// Rows drawn since the frames were exchanged.
    drawn: Range<usize>,
    /// Rows in which the frame to be drawn on is older than the one that is shown.
    stale: Range<usize>,
}

/// Makes both frames black; `None` the second time. The SDRAM must have been started.
pub fn frames() -> Option<Frames> {
    static TAKEN: AtomicBool = AtomicBool::new(false);
    if TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    let [front, back] =
        [0, 1].map(|frame| ptr::with_exposed_provenance_mut::<Frame>(FRAMES + frame * FRAME_BYTES));
    // SAFETY: the memory is there, aligned for bytes, named by nothing else, and all zeros are two frames.
    let (front, back) = unsafe {
        front.write_bytes(0, 1);
        back.write_bytes(0, 1);
        (&mut *front, &mut *back)
    };
    Some(Frames { back, front, drawn: 0..0, stale: 0..0 })
}

impl Frames {
    /// Where the frame lies that is shown.
    pub fn address(&self) -> usize {
        ptr::from_ref(&*self.front).addr()
    }

    /// Makes the frame to be drawn on like the one that is shown.
    fn catch_up(&mut self) {
        if !self.stale.is_empty() {
            // Drawn four times a second, so that the display has long changed frames; one that hangs shows nothing anyway.
            (0..LOOKS).any(|_| display::shown());
            let stale = core::mem::take(&mut self.stale);
            self.back[stale.clone()].copy_from_slice(&self.front[stale]);
        }
    }

    /// Notes that these rows were drawn on.
    fn drew(&mut self, rows: Range<usize>) {
        if !rows.is_empty() {
            let drawn = &self.drawn;
            self.drawn = if drawn.is_empty() {
                rows
            } else {
                drawn.start.min(rows.start)..drawn.end.max(rows.end)
            };
        }
    }
}

impl Panel {
    /// To be called before pixels are set.
    fn begin(&mut self) {
        if let Self::Frames(frames) = self {
            frames.catch_up();
        }
    }

    /// Sets a pixel; whether it is on the screen.
    #[inline]
    fn set(&mut self, x: usize, y: usize, colour: Rgb565) -> bool {
        match self {
            Self::Frames(Frames { back, .. }) => {
                let pixel = back.get_mut(y).and_then(|row| row.get_mut(x));
                pixel.map(|pixel| *pixel = colour.into_storage().to_le_bytes()).is_some()
            }
            Self::Spare(spare) => spare.set(x, y, colour),
        }
    }

    /// To be called when pixels in these rows were set.
    fn end(&mut self, rows: Range<usize>) {
        if let Self::Frames(frames) = self {
            frames.drew(rows);
        }
    }
}

impl OriginDimensions for Panel {
    fn size(&self) -> Size {
        Size::new(WIDTH as u32, HEIGHT as u32)
    }
}

impl DrawTarget for Panel {
    type Color = Rgb565;
    type Error = Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Infallible>
    where
        I: IntoIterator<Item = Pixel<Rgb565>>,
    {
        self.begin();
        let (mut first, mut end) = (HEIGHT, 0);
        for Pixel(Point { x, y }, colour) in pixels {
            let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { continue };
            if self.set(x, y, colour) {
                (first, end) = (first.min(y), end.max(y + 1));
            }
        }
        self.end(first..end);
        Ok(())
    }

    fn fill_solid(&mut self, area: &Rectangle, colour: Rgb565) -> Result<(), Infallible> {
        self.begin();
        let (columns, rows) = spans(&area.intersection(&self.bounding_box()));
        for y in rows.clone() {
            match self {
                Self::Frames(frames) => {
                    frames.back[y][columns.clone()].fill(colour.into_storage().to_le_bytes());
                }
                Self::Spare(spare) => spare.fill(y, columns.clone(), colour),
            }
        }
        self.end(rows);
        Ok(())
    }
}

/// Columns and rows of an area on the screen.
fn spans(area: &Rectangle) -> (Range<usize>, Range<usize>) {
    let (left, top) = (area.top_left.x as usize, area.top_left.y as usize);
    (left..left + area.size.width as usize, top..top + area.size.height as usize)
}

impl tasks::Panel for Panel {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Frames(frames) => frames.front.as_flattened().as_flattened(),
            Self::Spare(_) => &[],
        }
    }

    fn present(&mut self) {
        if let Self::Frames(frames) = self
            && !frames.drawn.is_empty()
        {
            core::mem::swap(&mut frames.front, &mut frames.back);
            frames.stale = core::mem::take(&mut frames.drawn);
            // What was drawn must have arrived before the display reads it.
            cortex_m::asm::dsb();
            display::show(frames.address());
        }
    }
}

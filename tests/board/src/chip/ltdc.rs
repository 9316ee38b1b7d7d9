//! The display controller: fetches a frame from memory and shows it.

use super::{Device, Memory};
use crate::cpu::nvic::Nvic;
use crate::time::{NEVER, S};

const LINE: u8 = 88;
const BPCR: u32 = 0x0c;
const AWCR: u32 = 0x10;
const TWCR: u32 = 0x14;
const GCR: u32 = 0x18;
const SRCR: u32 = 0x24;
const BCCR: u32 = 0x2c;
const IER: u32 = 0x34;
const ISR: u32 = 0x38;
const ICR: u32 = 0x3c;
const CPSR: u32 = 0x44;
/// First layer; the second lies 0x80 further.
const LAYER: u32 = 0x84;
const LAYER_BYTES: u32 = 0x80;
/// Bits that a reset of GCR leaves set: widths of the dither steps.
const GCR_RESET: u32 = 0x2220;
const RELOADED: u32 = 1 << 3;
const LINE_FLAG: u32 = 1;
/// Pixel clock that BSPs of the board set.
const PIXEL_HZ: u64 = 9_600_000;

/// Offsets within a layer.
mod layer {
    pub const CR: usize = 0;
    pub const WHPCR: usize = 1;
    pub const WVPCR: usize = 2;
    pub const PFCR: usize = 4;
    pub const CACR: usize = 5;
    pub const CFBAR: usize = 10;
    pub const CFBLR: usize = 11;
    pub const CFBLNR: usize = 12;
    pub const CLUTWR: usize = 16;
}

const WORDS: usize = 24;

#[derive(Clone)]
struct Layer {
    /// As written.
    next: [u32; WORDS],
    /// As shown.
    shown: [u32; WORDS],
    clut: [u32; 256],
}

impl Default for Layer {
    fn default() -> Self {
        Self { next: [0; WORDS], shown: [0; WORDS], clut: [0; 256] }
    }
}

/// A picture as it is on the panel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Red, green and blue, row by row.
    pub rgb: Vec<u8>,
}

/// LTDC.
pub struct Ltdc {
    registers: [u32; 0x60 / 4],
    layers: [Layer; 2],
    status: u32,
    reload_at_blank: bool,
    frame_began: u64,
    /// Frames shown since the reset.
    pub frames: u64,
}

impl Default for Ltdc {
    fn default() -> Self {
        let mut registers = [0; 0x60 / 4];
        registers[(GCR / 4) as usize] = GCR_RESET;
        Self {
            registers,
            layers: Default::default(),
            status: 0,
            reload_at_blank: false,
            frame_began: NEVER,
            frames: 0,
        }
    }
}

impl Ltdc {
    fn get(&self, at: u32) -> u32 {
        self.registers[(at / 4) as usize]
    }

    fn on(&self) -> bool {
        self.get(GCR) & 1 != 0
    }

    /// Rows and columns of the panel as they are set.
    fn size(&self) -> (u32, u32) {
        let (porch, active) = (self.get(BPCR), self.get(AWCR));
        let width = (active >> 16 & 0xfff).saturating_sub(porch >> 16 & 0xfff);
        let height = (active & 0x7ff).saturating_sub(porch & 0x7ff);
        (width, height)
    }

    fn frame_ps(&self) -> u64 {
        let total = self.get(TWCR);
        let (columns, rows) = ((total >> 16 & 0xfff) + 1, (total & 0x7ff) + 1);
        u64::from(columns) * u64::from(rows) * S / PIXEL_HZ
    }

    fn reload(&mut self) {
        for layer in &mut self.layers {
            layer.shown = layer.next;
        }
        self.status |= RELOADED;
    }

    /// The picture on the panel; nothing while the controller is off.
    pub fn picture(&self, memory: &dyn Memory) -> Option<Picture> {
        let (width, height) = self.size();
        if !self.on() || width == 0 || height == 0 {
            return None;
        }
        let back = self.get(BCCR).to_be_bytes();
        let mut rgb: Vec<u8> = back[1..].repeat((width * height) as usize);
        for layer in &self.layers {
            self.blend(layer, memory, &mut rgb, width, height);
        }
        Some(Picture { width_px: width, height_px: height, rgb })
    }

    fn blend(&self, layer: &Layer, memory: &dyn Memory, rgb: &mut [u8], width: u32, height: u32) {
        let words = &layer.shown;
        if words[layer::CR] & 1 == 0 {
            return;
        }
        let porch = self.get(BPCR);
        let window = |word: u32, porch: u32| {
            let first = (word & 0xffff).saturating_sub(porch + 1);
            (first, (word >> 16 & 0xffff).saturating_sub(porch))
        };
        let (x0, x1) = window(words[layer::WHPCR] & 0x0fff_0fff, porch >> 16 & 0xfff);
        let (y0, y1) = window(words[layer::WVPCR] & 0x07ff_07ff, porch & 0x7ff);
        let pitch = words[layer::CFBLR] >> 16 & 0x1fff;
        let bytes = (words[layer::CFBLR] & 0x1fff).saturating_sub(3);
        let alpha = u32::from(words[layer::CACR] as u8);
        let rows = words[layer::CFBLNR] & 0x7ff;
        let mut line = vec![0; bytes as usize];
        for y in y0..y1.min(y0 + rows).min(height) {
            if !memory.read(words[layer::CFBAR] + (y - y0) * pitch, &mut line) {
                return;
            }
            for x in x0..x1.min(width) {
                let Some(pixel) = colour(words[layer::PFCR] & 7, &line, (x - x0) as usize, layer)
                else {
                    continue;
                };
                let at = 3 * (y * width + x) as usize;
                for (old, new) in rgb[at..at + 3].iter_mut().zip(pixel) {
                    let mixed = u32::from(new) * alpha + u32::from(*old) * (255 - alpha);
                    *old = (mixed / 255) as u8;
                }
            }
        }
    }
}

/// A pixel of a line in one of the layer's formats.
fn colour(format: u32, line: &[u8], index: usize, layer: &Layer) -> Option<[u8; 3]> {
    let wide = |bits: u32, count: u32| (bits << (8 - count) | bits >> (2 * count - 8)) as u8;
    Some(match format {
        0 => {
            let &[b, g, r, _] = line.as_chunks::<4>().0.get(index)?;
            [r, g, b]
        }
        1 => {
            let &[b, g, r] = line.as_chunks::<3>().0.get(index)?;
            [r, g, b]
        }
        2 => {
            let word = u32::from(u16::from_le_bytes(*line.as_chunks::<2>().0.get(index)?));
            [wide(word >> 11, 5), wide(word >> 5 & 0x3f, 6), wide(word & 0x1f, 5)]
        }
        5 => {
            let [_, r, g, b] = layer.clut[usize::from(*line.get(index)?)].to_be_bytes();
            [r, g, b]
        }
        _ => return None,
    })
}

impl Device for Ltdc {
    fn read(&mut self, at: u32, _size: u8, now: u64) -> u32 {
        match at {
            SRCR => u32::from(self.reload_at_blank) << 1,
            ISR => self.status,
            CPSR if self.on() && self.frame_began != NEVER => {
                let rows = u64::from(self.get(TWCR) & 0x7ff) + 1;
                (now.saturating_sub(self.frame_began) * rows / self.frame_ps().max(1)) as u32
            }
            LAYER.. => {
                let (layer, word) = place(at);
                self.layers.get(layer).and_then(|layer| layer.next.get(word)).copied().unwrap_or(0)
            }
            _ => self.registers.get((at / 4) as usize).copied().unwrap_or(0),
        }
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, now: u64) {
        match at {
            SRCR => {
                if value & 1 != 0 {
                    self.reload();
                }
                self.reload_at_blank |= value & 2 != 0;
            }
            ICR => self.status &= !value,
            ISR | CPSR => {}
            LAYER.. => {
                let (layer, word) = place(at);
                let Some(layer) = self.layers.get_mut(layer) else { return };
                if word == layer::CLUTWR {
                    layer.clut[(value >> 24) as usize] = value & 0xff_ffff;
                }
                if let Some(register) = layer.next.get_mut(word) {
                    *register = value;
                }
            }
            _ => {
                let was_on = self.on();
                if let Some(register) = self.registers.get_mut((at / 4) as usize) {
                    *register = if at == GCR { value & !0x7770 | GCR_RESET } else { value };
                }
                if self.on() && !was_on {
                    self.frame_began = now;
                } else if !self.on() {
                    self.frame_began = NEVER;
                }
            }
        }
    }

    fn next(&self) -> u64 {
        // The blank after the frame matters only to one who waits for it.
        let waits = self.reload_at_blank || self.get(IER) & LINE_FLAG != 0;
        if self.frame_began == NEVER || !waits {
            return NEVER;
        }
        self.frame_began.saturating_add(self.frame_ps())
    }

    fn advance(&mut self, now: u64, _memory: &mut dyn Memory) {
        if self.frame_began == NEVER || self.frame_ps() == 0 {
            return;
        }
        let frames = now.saturating_sub(self.frame_began) / self.frame_ps();
        if frames > 0 {
            self.frames += frames;
            self.frame_began += frames * self.frame_ps();
            self.status |= LINE_FLAG;
            if std::mem::take(&mut self.reload_at_blank) {
                self.reload();
            }
        }
    }

    fn lines(&self, nvic: &mut Nvic) {
        nvic.set_line(LINE, self.status & self.get(IER) != 0);
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

fn place(at: u32) -> (usize, usize) {
    let at = at - LAYER;
    ((at / LAYER_BYTES) as usize, (at % LAYER_BYTES / 4) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Ram(Vec<u8>);

    impl Memory for Ram {
        fn read(&self, at: u32, bytes: &mut [u8]) -> bool {
            bytes.copy_from_slice(&self.0[at as usize..at as usize + bytes.len()]);
            true
        }
        fn write(&mut self, _at: u32, _bytes: &[u8]) -> bool {
            false
        }
    }

    #[test]
    fn shows_what_was_loaded_at_the_blank() {
        let mut ltdc = Ltdc::default();
        for (at, value) in [
            (BPCR, 1 << 16 | 1),
            (AWCR, 5 << 16 | 3),
            (TWCR, 6 << 16 | 4),
            (LAYER, 1),
            (LAYER + 4, 5 << 16 | 2),
            (LAYER + 8, 3 << 16 | 2),
            (LAYER + 0x10, 2),
            (LAYER + 0x14, 255),
            (LAYER + 0x28, 0),
            (LAYER + 0x2c, 8 << 16 | 11),
            (LAYER + 0x30, 2),
            (GCR, 1),
        ] {
            ltdc.write(at, value, 4, 0);
        }
        let mut ram = Ram(vec![0; 16]);
        ram.0[14..].copy_from_slice(&0xf81f_u16.to_le_bytes());
        assert_eq!(ltdc.next(), NEVER);
        let black = ltdc.picture(&ram).expect("it is on");
        assert!((black.width_px, black.height_px) == (4, 2) && black.rgb.iter().all(|c| *c == 0));
        ltdc.write(SRCR, 2, 4, 0);
        ltdc.advance(ltdc.next(), &mut ram);
        let shown = ltdc.picture(&ram).expect("it is on").rgb;
        assert_eq!(shown[21..], [255, 0, 255]);
        assert!(shown[..21].iter().all(|c| *c == 0));
    }
}

//! The device's screen in memory, and as PNG.

use std::convert::Infallible;
use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::{Path, PathBuf};

use embedded_graphics::pixelcolor::{Rgb565, Rgb888};
use embedded_graphics::prelude::*;
use evtach_firmware::ui::SIZE;

/// Why a picture could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The file system says no.
    #[error("{}: {source}; check that the folder exists and may be written to", .path.display())]
    File {
        /// The picture.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The PNG cannot be written.
    #[error("{}: {source}; write it to another place", .path.display())]
    Encode {
        /// The picture.
        path: PathBuf,
        /// What the encoder says.
        source: png::EncodingError,
    },
    /// The PNG cannot be read.
    #[error("{}: {source}; write it anew with `evtach screen`", .path.display())]
    Decode {
        /// The picture.
        path: PathBuf,
        /// What the decoder says.
        source: png::DecodingError,
    },
    /// The picture is not one of the device's screen.
    #[error("{}: not 480x272 pixels of eight bits a colour; write it anew with `evtach screen`", .0.display())]
    Foreign(PathBuf),
}

/// A frame buffer of the screen's size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    pixels: Vec<Rgb565>,
}

impl Default for Frame {
    fn default() -> Self {
        Self { pixels: vec![Rgb565::BLACK; (SIZE.width * SIZE.height) as usize] }
    }
}

impl Frame {
    /// Pixels row by row.
    #[must_use]
    pub fn pixels(&self) -> &[Rgb565] {
        &self.pixels
    }

    /// The picture as PNG, eight bits a colour.
    ///
    /// # Errors
    ///
    /// None that is known: memory takes what the encoder writes.
    pub fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, SIZE.width, SIZE.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb())?;
        writer.finish()?;
        Ok(bytes)
    }

    /// Writes it as PNG.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<(), FrameError> {
        let png = self.png().map_err(|source| FrameError::Encode { path: path.into(), source })?;
        std::fs::write(path, png).map_err(|source| FrameError::File { path: path.into(), source })
    }

    /// Eight bits a colour, row by row.
    fn rgb(&self) -> Vec<u8> {
        let wide = self.pixels.iter().map(|pixel| Rgb888::from(*pixel));
        wide.flat_map(|pixel| [pixel.r(), pixel.g(), pixel.b()]).collect()
    }

    /// Reads a picture that [`Frame::write_png`] wrote.
    ///
    /// # Errors
    ///
    /// When it cannot be read, or is another picture.
    pub fn read_png(path: &Path) -> Result<Self, FrameError> {
        let file =
            File::open(path).map_err(|source| FrameError::File { path: path.into(), source })?;
        let pixels = decode(BufReader::new(file))
            .map_err(|source| FrameError::Decode { path: path.into(), source })?;
        pixels.map(|pixels| Self { pixels }).ok_or_else(|| FrameError::Foreign(path.into()))
    }
}

fn decode(file: impl std::io::BufRead + Seek) -> Result<Option<Vec<Rgb565>>, png::DecodingError> {
    let mut reader = png::Decoder::new(file).read_info()?;
    let info = reader.info();
    let ours = (info.width, info.height, info.color_type, info.bit_depth)
        == (SIZE.width, SIZE.height, png::ColorType::Rgb, png::BitDepth::Eight);
    if !ours {
        return Ok(None);
    }
    let mut rgb = vec![0; (SIZE.width * SIZE.height * 3) as usize];
    reader.next_frame(&mut rgb)?;
    let (pixels, _) = rgb.as_chunks();
    Ok(Some(pixels.iter().map(|[r, g, b]| Rgb565::from(Rgb888::new(*r, *g, *b))).collect()))
}

impl OriginDimensions for Frame {
    fn size(&self) -> Size {
        SIZE
    }
}

impl DrawTarget for Frame {
    type Color = Rgb565;
    type Error = Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Infallible>
    where
        I: IntoIterator<Item = Pixel<Rgb565>>,
    {
        let bounds = self.bounding_box();
        for Pixel(at, colour) in pixels.into_iter().filter(|pixel| bounds.contains(pixel.0)) {
            self.pixels[(at.y as u32 * SIZE.width + at.x as u32) as usize] = colour;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_comes_back_pixel_for_pixel_and_nothing_is_drawn_outside() -> Result<(), FrameError> {
        let mut frame = Frame::default();
        for (i, pixel) in frame.pixels.iter_mut().enumerate() {
            *pixel = Rgb565::new(i as u8, (i / 7) as u8, (i / 480) as u8);
        }
        let before = frame.clone();
        let outside = [(-1, 0), (480, 0), (0, 272), (0, -1)];
        let Ok(()) = frame.draw_iter(outside.map(|(x, y)| Pixel(Point::new(x, y), Rgb565::WHITE)));
        assert_eq!(frame, before);
        let folder = tempfile::tempdir()
            .map_err(|source| FrameError::File { path: PathBuf::new(), source })?;
        let path = folder.path().join("frame.png");
        frame.write_png(&path)?;
        assert_eq!(Frame::read_png(&path)?, frame);
        Ok(())
    }
}

//! Reads the device's log as a debug probe does: out of a ring in its memory.

use anyhow::Result;
use defmt_decoder::{DecodeError, StreamDecoder, Table};

use crate::chip::Memory;
use crate::image::Image;

/// Words of the control block up to the first channel.
const HEADER_BYTES: u32 = 24;

/// The probe.
pub struct Rtt {
    block: Option<u32>,
    decoder: Option<Box<dyn StreamDecoder>>,
    /// Lines read so far.
    pub lines: Vec<String>,
}

impl Rtt {
    /// A probe for an image; one without a log stays silent.
    ///
    /// # Errors
    /// When the image's table of messages is damaged.
    pub fn new(image: &Image) -> Result<Self> {
        // Lives as long as the process, which runs one image.
        let table = Table::parse(&image.elf)?.map(|table| &*Box::leak(Box::new(table)));
        Ok(Self {
            block: image.symbol("_SEGGER_RTT"),
            decoder: table.map(|table| -> Box<dyn StreamDecoder> { table.new_stream_decoder() }),
            lines: Vec::new(),
        })
    }

    /// Takes what is in the ring.
    pub fn drain(&mut self, memory: &mut dyn Memory) {
        let (Some(block), Some(decoder)) = (self.block, &mut self.decoder) else { return };
        let mut channel = [0; 20];
        if !memory.read(block + HEADER_BYTES, &mut channel) {
            return;
        }
        let (words, _) = channel.as_chunks::<4>();
        let [_, buffer, size, write, read] =
            [words[0], words[1], words[2], words[3], words[4]].map(u32::from_le_bytes);
        if write == read || write >= size || read >= size {
            return;
        }
        let mut bytes = vec![0; size as usize];
        if !memory.read(buffer, &mut bytes) {
            return;
        }
        let (write_at, read_at) = (write as usize, read as usize);
        if write_at > read_at {
            decoder.received(&bytes[read_at..write_at]);
        } else {
            decoder.received(&bytes[read_at..]);
            decoder.received(&bytes[..write_at]);
        }
        memory.write(block + HEADER_BYTES + 16, &write.to_le_bytes());
        loop {
            match decoder.decode() {
                Ok(frame) => self.lines.push(frame.display(false).to_string()),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => {
                    self.lines.push("(a part of the log was lost)".to_owned());
                    break;
                }
            }
        }
    }
}

//! Flash in RAM: for a board that has none, and for tests, which can cut its power.

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Bytes of a page: small, so that pages fill soon. A real chip's are 4 096.
const PAGE_BYTES: usize = 256;
/// Bytes written at once.
const WORD_BYTES: usize = 4;

/// Why a flash in RAM refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MemoryFlashError {
    /// The power has been cut.
    PowerCut,
    /// The place lies beyond its end.
    OutOfBounds,
    /// The place is not a multiple of a word or page.
    NotAligned,
}

impl NorFlashError for MemoryFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::PowerCut => NorFlashErrorKind::Other,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
        }
    }
}

/// A cut of power to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cut {
    /// Words and pages that are still written or erased whole.
    steps: u32,
    /// Share of the step after those that still happens, in 256ths.
    share: u8,
}

/// Flash of `BYTES` bytes in RAM: writing only clears bits, erasing a page sets them.
#[derive(Clone, Debug)]
pub struct MemoryFlash<const BYTES: usize> {
    bytes: [u8; BYTES],
    cut: Option<Cut>,
}

impl<const BYTES: usize> Default for MemoryFlash<BYTES> {
    fn default() -> Self {
        Self::new([0xff; BYTES])
    }
}

impl<const BYTES: usize> MemoryFlash<BYTES> {
    /// Flash that holds these bytes; erased ones are 0xff.
    #[must_use]
    pub const fn new(bytes: [u8; BYTES]) -> Self {
        Self { bytes, cut: None }
    }

    /// What it holds.
    #[must_use]
    pub const fn bytes(&self) -> &[u8; BYTES] {
        &self.bytes
    }

    /// Cuts the power after so many more words or pages; of the next, `share` 256ths are still written or erased.
    pub const fn cut_power(&mut self, steps: u32, share: u8) {
        self.cut = Some(Cut { steps, share });
    }

    /// Gives it power again, and tells whether the cut has happened.
    pub fn restore_power(&mut self) -> bool {
        self.cut.take().is_some_and(|cut| cut.steps == u32::MAX)
    }

    /// How much of a step happens, in 256ths.
    fn step(&mut self) -> Result<u32, MemoryFlashError> {
        match &mut self.cut {
            None => Ok(256),
            Some(Cut { steps: u32::MAX, .. }) => Err(MemoryFlashError::PowerCut),
            Some(Cut { steps, share }) => {
                let whole = *steps > 0;
                *steps = steps.wrapping_sub(1);
                Ok(if whole { 256 } else { u32::from(*share) })
            }
        }
    }

    /// The range of a page or word, checked.
    fn range(
        offset: u32,
        length: usize,
        unit: usize,
    ) -> Result<core::ops::Range<usize>, MemoryFlashError> {
        let start = offset as usize;
        if !start.is_multiple_of(unit) || !length.is_multiple_of(unit) {
            return Err(MemoryFlashError::NotAligned);
        }
        let end = start.checked_add(length).filter(|&end| end <= BYTES);
        Ok(start..end.ok_or(MemoryFlashError::OutOfBounds)?)
    }
}

impl<const BYTES: usize> ErrorType for MemoryFlash<BYTES> {
    type Error = MemoryFlashError;
}

impl<const BYTES: usize> ReadNorFlash for MemoryFlash<BYTES> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFlashError> {
        let range = Self::range(offset, bytes.len(), 1)?;
        bytes.copy_from_slice(&self.bytes[range]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl<const BYTES: usize> NorFlash for MemoryFlash<BYTES> {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryFlashError> {
        let length = to.checked_sub(from).ok_or(MemoryFlashError::OutOfBounds)?;
        let range = Self::range(from, length as usize, PAGE_BYTES)?;
        for start in range.step_by(PAGE_BYTES) {
            let erased = self.step()? as usize * PAGE_BYTES / 256;
            self.bytes[start..start + erased].fill(0xff);
            if erased < PAGE_BYTES {
                return Err(MemoryFlashError::PowerCut);
            }
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFlashError> {
        let range = Self::range(offset, bytes.len(), WORD_BYTES)?;
        for (start, word) in range.step_by(WORD_BYTES).zip(bytes.as_chunks::<WORD_BYTES>().0) {
            let bits = self.step()? * 32 / 256;
            // Bits that the cut came before stay as they are.
            let untouched = u32::MAX.checked_shl(bits).unwrap_or(0);
            let word = u32::from_le_bytes(*word) | untouched;
            for (byte, new) in self.bytes[start..].iter_mut().zip(word.to_le_bytes()) {
                *byte &= new;
            }
            if bits < 32 {
                return Err(MemoryFlashError::PowerCut);
            }
        }
        Ok(())
    }
}

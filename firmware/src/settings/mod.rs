//! The person's preferences, kept in flash.
//!
//! `sequential-storage` writes each version of the block behind the one before, checks it by CRC-32 and gives the last
//! that is whole: a cut of power while writing leaves the old one. `block.rs` says what is in it.

mod block;
mod memory;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::Cache;
use sequential_storage::map::{MapConfig, MapStorage};

use crate::instrument::{Fault, Preferences};

pub use block::{BLOCK_BYTES, BlockError, decode, encode};
pub use memory::{MemoryFlash, MemoryFlashError};

/// The only key.
const KEY: u8 = 1;

/// Room for the block, its key, and blocks that a later firmware may have written.
const BUFFER_BYTES: usize = 64;

/// Preferences could not be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SaveError {
    /// The flash refused.
    #[error("the flash did not take the preferences")]
    Flash,
    /// The pages lent are too few or too small.
    #[error("flash for preferences: two whole pages or more")]
    Region,
}

/// Preferences in a region of flash of two pages or more.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
    start: u32,
    end: u32,
}

impl<F: NorFlash> Store<F> {
    /// Preferences in the bytes from `start` to `end` of a flash.
    pub const fn new(flash: F, start: u32, end: u32) -> Self {
        Self { flash, start, end }
    }

    /// Gives the flash back.
    pub fn release(self) -> F {
        self.flash
    }

    /// What was saved last. [`Fault::Preferences`] beside the defaults when something is there that cannot be read.
    pub async fn load(&mut self) -> (Preferences, Option<Fault>) {
        match self.try_load().await {
            Ok(Some(preferences)) => (preferences, None),
            Ok(None) => (Preferences::default(), None),
            Err(fault) => (Preferences::default(), Some(fault)),
        }
    }

    async fn try_load(&mut self) -> Result<Option<Preferences>, Fault> {
        // Looked at first: a damaged region is erased by the repair, and would then look like a new one.
        let blank = self.is_blank().await.map_err(|_| Fault::Preferences)?;
        if blank {
            return Ok(None);
        }
        let config = self.config().ok_or(Fault::Preferences)?;
        let mut buffer = [0; BUFFER_BYTES];
        let mut map = MapStorage::<u8, _, _>::new(&mut self.flash, config, Cache::new_uncached());
        let found = map.fetch_item::<&[u8]>(&mut buffer, &KEY).await;
        let bytes = found.ok().flatten().ok_or(Fault::Preferences)?;
        decode(bytes).map(Some).map_err(|_| Fault::Preferences)
    }

    /// Saves. Until it has ended, the old preferences stand.
    ///
    /// # Errors
    /// When the flash fails, or is too small.
    pub async fn save(&mut self, preferences: &Preferences) -> Result<(), SaveError> {
        if self.write(preferences).await? {
            return Ok(());
        }
        // Damage in the region hides what is written behind it: begin anew.
        let config = self.config().ok_or(SaveError::Region)?;
        let mut map = MapStorage::<u8, _, _>::new(&mut self.flash, config, Cache::new_uncached());
        map.erase_all().await.map_err(|_| SaveError::Flash)?;
        if self.write(preferences).await? { Ok(()) } else { Err(SaveError::Flash) }
    }

    /// Writes behind what is there, and tells whether it can be read back.
    async fn write(&mut self, preferences: &Preferences) -> Result<bool, SaveError> {
        let config = self.config().ok_or(SaveError::Region)?;
        let mut buffer = [0; BUFFER_BYTES];
        let block = encode(preferences);
        let mut map = MapStorage::<u8, _, _>::new(&mut self.flash, config, Cache::new_uncached());
        let stored = match map.store_item(&mut buffer, &KEY, &block.as_slice()).await {
            // A flash that refuses is not damage: what it holds is left alone.
            Err(sequential_storage::Error::Storage { .. }) => return Err(SaveError::Flash),
            stored => stored.is_ok(),
        };
        match map.fetch_item::<&[u8]>(&mut buffer, &KEY).await {
            Err(sequential_storage::Error::Storage { .. }) => Err(SaveError::Flash),
            found => Ok(stored && found.ok().flatten() == Some(block.as_slice())),
        }
    }

    fn config<'f>(&self) -> Option<MapConfig<&'f mut F>> {
        MapConfig::try_new(self.start..self.end).ok()
    }

    async fn is_blank(&mut self) -> Result<bool, F::Error> {
        let mut buffer = [0; BUFFER_BYTES];
        let mut at = self.start;
        while at < self.end {
            let count = BUFFER_BYTES.min((self.end - at) as usize);
            let bytes = &mut buffer[..count];
            self.flash.read(at, bytes).await?;
            if bytes.iter().any(|&byte| byte != 0xff) {
                return Ok(false);
            }
            at += count as u32;
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests;

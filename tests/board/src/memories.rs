//! The memories: which are there, and what is in them.

use std::cell::Cell;
use std::rc::Rc;

use anyhow::{Result, anyhow, bail};
use unicorn_engine::unicorn_const::{HookType, MemType, Permission};
use unicorn_engine::{Unicorn, uc_error};

use crate::board::{Board, n25q};
use crate::chip::Memory;
use crate::cpu::Engine;
use crate::image::{FLASH, FLASH_BYTES};

/// Internal RAM.
const RAM: u32 = 0x2000_0000;
const RAM_BYTES: usize = 320 << 10;
const ITCM_BYTES: usize = 16 << 10;
const SDRAM: u32 = 0xc000_0000;
const SDRAM_BYTES: usize = 8 << 20;
/// Where the serial flash is read as memory.
const MAPPED: u32 = 0x9000_0000;
/// Identity of the chip and size of its flash.
const SYSTEM_MEMORY: u64 = 0x1ff0_0000;
const IDENTITY: [u8; 12] = *b"EVTACHBOARD1";
const FLASH_KB: u16 = 1024;
/// What RAM holds when power comes, so that nobody relies on zeros.
const POWER_ON: u8 = 0xa5;

/// The engine's memory as another bus master sees it.
pub struct Ram<'a>(pub &'a mut Engine);

impl Memory for Ram<'_> {
    fn read(&self, at: u32, bytes: &mut [u8]) -> bool {
        self.0.mem_read(u64::from(at), bytes).is_ok()
    }

    fn write(&mut self, at: u32, bytes: &[u8]) -> bool {
        self.0.mem_write(u64::from(at), bytes).is_ok()
    }
}

/// Memories that come and go with their controllers.
#[derive(Default)]
pub struct Memories {
    sdram_on: bool,
    mapped: bool,
    /// Where SDRAM is broken.
    broken: Rc<Cell<Option<u32>>>,
}

impl Memories {
    /// Puts the memories in that are always there, with this in the flash.
    ///
    /// # Errors
    /// When the engine has no room for them.
    pub fn new(engine: &mut Engine, flash: &[u8]) -> Result<Self, uc_error> {
        let code = Permission::READ | Permission::EXEC;
        engine.mem_map(0, ITCM_BYTES, Permission::ALL)?;
        engine.mem_map(u64::from(FLASH), FLASH_BYTES, code)?;
        engine.mem_map(u64::from(RAM), RAM_BYTES, Permission::ALL)?;
        engine.mem_map(SYSTEM_MEMORY, 0x1_0000, Permission::READ)?;
        engine.mem_write(u64::from(FLASH), flash)?;
        engine.mem_write(SYSTEM_MEMORY + 0xf420, &IDENTITY)?;
        engine.mem_write(SYSTEM_MEMORY + 0xf442, &FLASH_KB.to_le_bytes())?;
        let mut memories = Self::default();
        memories.lose(engine)?;
        Ok(memories)
    }

    /// RAM holds nothing of use after power comes.
    ///
    /// # Errors
    /// When the engine has lost it.
    pub fn lose(&mut self, engine: &mut Engine) -> Result<(), uc_error> {
        engine.mem_write(u64::from(RAM), &vec![POWER_ON; RAM_BYTES])
    }

    /// Follows the controllers: SDRAM that was started, serial flash that is read as memory.
    ///
    /// # Errors
    /// When the engine has no room for them.
    pub fn follow(&mut self, engine: &mut Engine, board: &mut Board) -> Result<(), uc_error> {
        let changed = std::mem::take(&mut board.quadspi.changed);
        let (sdram_on, mapped) = (board.fmc.is_ready(), board.quadspi.is_mapped());
        if sdram_on != self.sdram_on {
            let at = u64::from(SDRAM);
            if sdram_on {
                engine.mem_map(at, SDRAM_BYTES, Permission::READ | Permission::WRITE)?;
                engine.mem_write(at, &vec![POWER_ON; SDRAM_BYTES])?;
            } else {
                engine.mem_unmap(at, SDRAM_BYTES)?;
            }
            self.sdram_on = sdram_on;
        }
        let at = u64::from(MAPPED);
        if mapped && !self.mapped {
            engine.mem_map(at, n25q::BYTES, Permission::READ)?;
        } else if !mapped && self.mapped {
            engine.mem_unmap(at, n25q::BYTES)?;
        }
        if mapped && (changed || !self.mapped) {
            engine.mem_write(at, &board.quadspi.flash.cells)?;
        }
        self.mapped = mapped;
        Ok(())
    }

    /// A bit of SDRAM that reads as zero from now on, until it is mended.
    ///
    /// # Errors
    /// When one is broken already, or the engine takes no more hooks.
    pub fn break_sdram(&mut self, engine: &mut Engine, offset: u32) -> Result<()> {
        if self.broken.replace(Some(offset)).is_some() {
            bail!("one word is broken already");
        }
        let broken = Rc::clone(&self.broken);
        let at = u64::from(SDRAM + (offset & !3));
        let hook = move |engine: &mut Unicorn<'_, ()>, _: MemType, _: u64, _: usize, _: i64| {
            let mut word = [0; 4];
            if broken.get() == Some(offset) && engine.mem_read(at, &mut word).is_ok() {
                word[1] &= !0x10;
                // It has just been read.
                let _ = engine.mem_write(at, &word);
            }
            true
        };
        engine
            .add_mem_hook(HookType::MEM_READ, at, at + 3, hook)
            // What was translated before reads past the hook.
            .and_then(|_| engine.ctl_flush_tb())
            .map_err(|error| anyhow!("the engine: {error:?}"))
    }

    /// The SDRAM is as good as new.
    pub fn mend_sdram(&self) {
        self.broken.set(None);
    }
}

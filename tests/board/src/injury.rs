//! What a program cannot survive, done to it where it stands: for tests of what comes after.

use anyhow::{Result, anyhow, bail};
use unicorn_engine::RegisterARM as R;

use crate::cpu::{self, Engine};
use crate::image::Image;

/// Memory that the image leaves alone: the ITCM.
const SPARE: u32 = 0x3000;
/// `udf #0`, and a loop of many `nop`s, which the engine runs faster than one of none.
const UNDEFINED: u32 = SPARE;
const LOOP: u32 = SPARE + 2;
const LOOP_NOPS: usize = 250;
/// A `core::panic::Location`, and the name of its file.
const LOCATION: u32 = SPARE + 0x400;
const NAME: &[u8] = b"injured.rs";

/// What is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An instruction that does not exist.
    Undefined,
    /// A loop without an end.
    Hang,
    /// An index out of bounds.
    Panic,
}

/// An injury to come: in the handler of this exception, when it is next entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Injury {
    /// What is done.
    pub kind: Kind,
    /// Where.
    pub exception: usize,
}

impl Injury {
    /// An injury in words: `panic UART5`.
    ///
    /// # Errors
    /// When there is no such kind, or no such handler.
    pub fn parse(words: &str) -> Result<Self> {
        let (kind, place) = words.split_once(' ').ok_or_else(|| anyhow!("crash KIND HANDLER"))?;
        let kind = match kind {
            "undefined" => Kind::Undefined,
            "hang" => Kind::Hang,
            "panic" => Kind::Panic,
            _ => bail!("crash undefined, hang or panic"),
        };
        let exception = (0..crate::time::LEVELS).find(|number| cpu::name(*number) == place);
        let exception = exception.ok_or_else(|| anyhow!("no handler is called {place}"))?;
        Ok(Self { kind, exception })
    }

    /// Does it to a handler that has just been entered.
    ///
    /// # Errors
    /// When the image cannot panic in that way.
    pub fn strike(self, engine: &mut Engine, image: &Image) -> Result<()> {
        let mut spare = vec![0x00, 0xde];
        spare.extend([0x00, 0xbf].repeat(LOOP_NOPS));
        // `b` to the first of them: the processor counts from two instructions further.
        let back = (2 - (2 + LOOP_NOPS as i32 + 2)) & 0x7ff;
        spare.extend((0xe000 | back as u16).to_le_bytes());
        spare.resize((LOCATION - SPARE) as usize, 0);
        // Laid out as rustc 1.95 does: pointer and length of the name, line, column. The name's length counts its end.
        for word in [LOCATION + 0x20, NAME.len() as u32, 1, 1] {
            spare.extend(word.to_le_bytes());
        }
        spare.resize((LOCATION - SPARE) as usize + 0x20, 0);
        spare.extend(NAME);
        spare.push(0);
        engine
            .mem_write(u64::from(SPARE), &spare)
            .map_err(|error| anyhow!("the ITCM: {error:?}"))?;
        let to = match self.kind {
            Kind::Undefined => UNDEFINED,
            Kind::Hang => LOOP,
            Kind::Panic => {
                let function = image.symbol("core::panicking::panic_bounds_check");
                for (register, value) in [(R::R0, 5), (R::R1, 3), (R::R2, LOCATION)] {
                    cpu::set_register(engine, register, value);
                }
                function.ok_or_else(|| anyhow!("the image has no panic_bounds_check"))?
            }
        };
        cpu::set_register(engine, R::PC, to | 1);
        Ok(())
    }
}

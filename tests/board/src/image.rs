//! The ELF that a user flashes.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use object::{Object as _, ObjectSegment as _, ObjectSymbol as _, SymbolKind};

/// First address of the flash.
pub const FLASH: u32 = 0x0800_0000;
/// Bytes of the flash.
pub const FLASH_BYTES: usize = 1 << 20;

/// An image to run.
pub struct Image {
    /// The file.
    pub elf: Vec<u8>,
    /// What is in the flash.
    pub flash: Vec<u8>,
    /// Address and length of every function, by its address.
    functions: BTreeMap<u32, (u32, String)>,
    symbols: BTreeMap<String, u32>,
}

impl Image {
    /// Reads a file.
    ///
    /// # Errors
    /// When it is no ELF file, or not one for this chip.
    pub fn read(path: &Path) -> Result<Self> {
        let elf = std::fs::read(path).with_context(|| format!("{}", path.display()))?;
        let file = object::File::parse(&*elf).with_context(|| format!("{}", path.display()))?;
        let mut flash = vec![0xff; FLASH_BYTES];
        let mut loaded = 0;
        if let object::File::Elf32(elf32) = &file {
            use object::read::elf::ProgramHeader as _;
            let endian = elf32.endian();
            for header in elf32.elf_program_headers() {
                // A probe writes to where the segment is loaded, which is not where variables live.
                let at = header.p_paddr(endian);
                let Ok(bytes) = header.data(endian, &*elf) else { continue };
                if header.p_type(endian) != object::elf::PT_LOAD || bytes.is_empty() {
                    continue;
                }
                let place = at.checked_sub(FLASH).map(|at| at as usize);
                let Some(place) = place.filter(|at| at + bytes.len() <= FLASH_BYTES) else {
                    bail!(
                        "{}: {} bytes for {at:#010x}, which is no flash",
                        path.display(),
                        bytes.len()
                    );
                };
                flash[place..place + bytes.len()].copy_from_slice(bytes);
                loaded += bytes.len();
            }
        }
        if loaded == 0 {
            let segments = file.segments().map(|segment| segment.size()).sum::<u64>();
            bail!("{}: nothing for the flash in {segments} bytes", path.display());
        }
        let (mut functions, mut symbols) = (BTreeMap::new(), BTreeMap::new());
        for symbol in file.symbols() {
            let Ok(name) = symbol.name() else { continue };
            let name = format!("{:#}", rustc_demangle::demangle(name));
            if symbol.kind() == SymbolKind::Text {
                let at = symbol.address() as u32 & !1;
                functions.insert(at, (symbol.size() as u32, name.clone()));
            }
            symbols.insert(name, symbol.address() as u32);
        }
        Ok(Self { elf, flash, functions, symbols })
    }

    /// Address of a symbol.
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// The function that an address lies in, as `name+0x12`, else the bare address.
    pub fn place(&self, address: u32) -> String {
        let address = address & !1;
        match self.functions.range(..=address).next_back() {
            Some((start, (size, name))) if address - start < (*size).max(2) => {
                format!("{name}+{:#x}", address - start)
            }
            _ => format!("{address:#010x}"),
        }
    }

    /// Addresses at which this instruction of 16 bits may stand. Some are data: they are never carried out.
    pub fn find(&self, instruction: u16) -> impl Iterator<Item = u32> {
        let (halfwords, _) = self.flash.as_chunks::<2>();
        halfwords.iter().enumerate().filter_map(move |(index, bytes)| {
            (u16::from_le_bytes(*bytes) == instruction).then_some(FLASH + 2 * index as u32)
        })
    }
}

/// Instructions in a piece of code.
pub fn instructions(code: &[u8]) -> u64 {
    let (halfwords, _) = code.as_chunks::<2>();
    let (mut count, mut at) = (0, 0);
    while let Some(halfword) = halfwords.get(at) {
        // 0b11101, 0b11110 and 0b11111 begin an instruction of 32 bits.
        at += if u16::from_le_bytes(*halfword) >> 11 >= 0b11101 { 2 } else { 1 };
        count += 1;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_are_two_or_four_bytes() {
        // nop; bl; nop
        assert_eq!(instructions(&[0x00, 0xbf, 0x00, 0xf0, 0x01, 0xf8, 0x00, 0xbf]), 3);
    }
}

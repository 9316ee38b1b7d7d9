//! The firmware's ELF file.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use object::read::elf::{FileHeader as _, ProgramHeader as _};
use object::{
    Endianness, Object as _, ObjectSection as _, ObjectSymbol as _, SectionFlags, SectionKind, elf,
};

use super::DeviceError;

/// Cargo's home that sizes are told for: the image names the path of each source file that may panic, and what fits on one machine
/// would not on another.
const HOME: &str = "/root/.cargo";

/// What the linker made.
#[derive(Clone, Debug)]
pub struct Image {
    /// Where it lies.
    pub path: PathBuf,
    /// Bytes in flash: code, constants, and the values that variables start with. With cargo's home at `/root/.cargo`, wherever it is.
    pub flash_bytes: u64,
    /// Bytes of variables in RAM, without the stack.
    pub ram_bytes: u64,
    /// Bytes of RAM that the stack has.
    pub stack_bytes: u64,
    /// Names of all functions and variables.
    pub symbols: Vec<String>,
    /// What flash holds, from its start on; gaps are as erased.
    pub flash: Vec<u8>,
}

/// The repository that this program was built in.
pub(super) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Builds the firmware for QEMU's board, when it is not up to date.
///
/// # Errors
///
/// When cargo is missing, the build fails, or the image cannot be read.
pub fn build() -> Result<Image, DeviceError> {
    build_by("fw-qemu")
}

/// Builds the firmware for the STM32F746G-DISCO, when it is not up to date.
///
/// # Errors
///
/// When cargo is missing, the build fails, or the image cannot be read.
pub fn build_for_board() -> Result<Image, DeviceError> {
    build_by("fw")
}

/// Builds the image that an alias in .cargo/config.toml stands for.
fn build_by(alias: &'static str) -> Result<Image, DeviceError> {
    let root = root();
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(&cargo)
        .args([alias, "--quiet", "--message-format=json-render-diagnostics"])
        .current_dir(&root)
        .stderr(std::process::Stdio::inherit())
        .output()
        .map_err(|source| DeviceError::Start {
            program: cargo.to_string_lossy().into_owned(),
            source,
        })?;
    // Cargo knows where it puts the image, whatever its target folder is.
    let executable = String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .find_map(|message| message["executable"].as_str().map(PathBuf::from));
    match executable {
        Some(path) if output.status.success() => Image::read(path),
        _ => Err(DeviceError::Build { alias, root }),
    }
}

impl Image {
    /// Reads sizes and names from an ELF file.
    ///
    /// # Errors
    ///
    /// When it cannot be read, or is none.
    pub fn read(path: PathBuf) -> Result<Self, DeviceError> {
        let bytes =
            fs::read(&path).map_err(|source| DeviceError::File { path: path.clone(), source })?;
        let file = object::File::parse(&*bytes)
            .map_err(|source| DeviceError::Image { path: path.clone(), source })?;
        let (mut flash_bytes, mut ram_bytes) = (0, 0);
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
            let placed = sh_flags & u64::from(elf::SHF_ALLOC) != 0;
            if placed && section.kind() != SectionKind::UninitializedData {
                flash_bytes += section.size();
            }
            if placed && sh_flags & u64::from(elf::SHF_WRITE) != 0 {
                ram_bytes += section.size();
            }
        }
        let symbols = file.symbols().filter_map(|s| s.name().ok().map(str::to_owned)).collect();
        let address = |name| file.symbol_by_name(name).map_or(0, |symbol| symbol.address());
        let stack_bytes = address("_stack_start").saturating_sub(address("_stack_end"));
        let flash =
            flash(&bytes).map_err(|source| DeviceError::Image { path: path.clone(), source })?;
        if let Some(home) = cargo_home() {
            flash_bytes = flash_bytes.saturating_add_signed(-longer_by(&flash, &home));
        }
        Ok(Self { path, flash_bytes, ram_bytes, stack_bytes, symbols, flash })
    }

    /// Functions that do double-precision arithmetic or allocate: neither has a place on the device,
    /// the first because its processor has to emulate it, the second because there is no heap.
    #[must_use]
    pub fn unwanted_symbols(&self) -> Vec<&str> {
        // Run-time ABI for the Arm Architecture, tables 2 to 8 (double and its conversions), and the
        // names the same functions have in compiler-rt.
        const DOUBLE: [&str; 7] = [
            "__aeabi_d",
            "__aeabi_cd",
            "__aeabi_f2d",
            "__aeabi_i2d",
            "__aeabi_ui2d",
            "__aeabi_l2d",
            "__aeabi_ul2d",
        ];
        self.symbols
            .iter()
            .map(String::as_str)
            .filter(|name| {
                DOUBLE.iter().any(|start| name.starts_with(start))
                    || is_compiler_rt_double(name)
                    || name.contains("__rust_alloc")
                    || name.contains("__rg_alloc")
            })
            .collect()
    }
}

fn cargo_home() -> Option<PathBuf> {
    env::var_os("CARGO_HOME").map(PathBuf::from).or_else(|| Some(env::home_dir()?.join(".cargo")))
}

/// By how many bytes what flash holds is longer than with cargo's home at [`HOME`].
fn longer_by(flash: &[u8], home: &Path) -> i64 {
    let sources = home.join("registry").join("src");
    let sources = sources.as_os_str().as_encoded_bytes();
    let times = flash.windows(sources.len()).filter(|bytes| *bytes == sources).count();
    times as i64 * (home.as_os_str().len() as i64 - HOME.len() as i64)
}

/// What the image puts into flash, from the lowest address on: what `objcopy -O binary` writes.
fn flash(elf: &[u8]) -> Result<Vec<u8>, object::Error> {
    let header = elf::FileHeader32::<Endianness>::parse(elf)?;
    let endian = header.endian()?;
    // Where a segment is loaded, which for variables is not where they are.
    let segments = header
        .program_headers(endian, elf)?
        .iter()
        .filter(|segment| segment.p_type(endian) == elf::PT_LOAD && segment.p_filesz(endian) > 0);
    let start = segments.clone().map(|segment| segment.p_paddr(endian)).min().unwrap_or(0);
    let mut flash = Vec::new();
    for segment in segments {
        let bytes = segment.data(endian, elf).unwrap_or_default();
        let from = (segment.p_paddr(endian) - start) as usize;
        flash.resize(flash.len().max(from + bytes.len()), 0xff);
        flash[from..from + bytes.len()].copy_from_slice(bytes);
    }
    Ok(flash)
}

/// `__adddf3`, `__extendsfdf2`, `__fixdfsi` and their like: compiler-rt writes double as `df`.
fn is_compiler_rt_double(name: &str) -> bool {
    name.strip_prefix("__")
        .is_some_and(|rest| rest.contains("df") && rest.bytes().all(|b| b.is_ascii_alphanumeric()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tells_double_precision_and_allocation_from_the_rest() {
        let symbols = [
            "__aeabi_dadd",
            "__aeabi_f2d",
            "__adddf3",
            "__extendsfdf2",
            "_RNv__rust_alloc", // unwanted
            "__aeabi_idiv",
            "__aeabi_uldivmod",
            "__aeabi_fadd",
            "__addsf3",
            "__sheap",
            "main",
        ];
        let image = Image {
            path: PathBuf::new(),
            flash_bytes: 0,
            ram_bytes: 0,
            stack_bytes: 0,
            flash: Vec::new(),
            symbols: symbols.map(str::to_owned).to_vec(),
        };
        assert_eq!(image.unwanted_symbols(), symbols[..5]);
    }

    #[test]
    fn the_path_of_cargos_home_is_told_for_one_of_twelve_letters() {
        let flash = b"\xff/home/ada/.cargo/registry/src/a.rs/home/ada/.cargo/registry/src/b.rs/home/ada/c.rs";
        assert_eq!(longer_by(flash, Path::new("/home/ada/.cargo")), 2 * 4);
        assert_eq!(longer_by(flash, Path::new("/home/a")), 0);
        assert_eq!(longer_by(b"/c/registry/src/a.rs", Path::new("/c")), -10);
    }
}

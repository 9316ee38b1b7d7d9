//! The firmware's ELF file.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use object::{Object as _, ObjectSection as _, ObjectSymbol as _, SectionFlags, SectionKind, elf};

use super::DeviceError;

/// What the linker made.
#[derive(Clone, Debug)]
pub struct Image {
    /// Where it lies.
    pub path: PathBuf,
    /// Bytes in flash: code, constants, and the values that variables start with.
    pub flash_bytes: u64,
    /// Bytes of variables in RAM, without the stack.
    pub ram_bytes: u64,
    /// Names of all functions and variables.
    pub symbols: Vec<String>,
}

/// The repository that this program was built in.
pub(super) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Builds the firmware for the emulated board, when it is not up to date.
///
/// # Errors
///
/// When cargo is missing, the build fails, or the image cannot be read.
pub fn build() -> Result<Image, DeviceError> {
    let root = root();
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(&cargo)
        .args(["fw-qemu", "--quiet", "--message-format=json-render-diagnostics"])
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
        _ => Err(DeviceError::Build(root)),
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
        Ok(Self { path, flash_bytes, ram_bytes, symbols })
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
            symbols: symbols.map(str::to_owned).to_vec(),
        };
        assert_eq!(image.unwanted_symbols(), symbols[..5]);
    }
}

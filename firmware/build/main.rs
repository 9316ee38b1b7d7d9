//! Gives the linker the memory map at the root of the repository, and the screen its fonts.

use std::path::PathBuf;
use std::{env, fs};

mod fonts;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=build");
    println!("cargo:rerun-if-changed=src/ui/fonts.rs");
    println!("cargo:rerun-if-changed=../memory.x");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("fonts.rs"), fonts::packed()?)?;
    if env::var("CARGO_CFG_TARGET_OS")? == "none" {
        // A copy, because the linker finds the original from some folders only, and cargo would
        // not link again after it has been edited.
        fs::copy("../memory.x", out.join("memory.x"))?;
        println!("cargo:rustc-link-search={}", out.display());
        println!("cargo:rustc-link-arg-bins=-Tlink.x");
        // Flash does not begin at a page boundary.
        println!("cargo:rustc-link-arg-bins=--nmagic");
        // Functions with the same instructions are one.
        println!("cargo:rustc-link-arg-bins=--icf=all");
        // A file of its own would be passed over: the linker looks for memory.x where it is started, and cargo starts it
        // at the root of the repository.
        println!("cargo:rustc-link-arg-bin=mps2_an500=--defsym=_mps2_an500=1");
        if env::var_os("CARGO_FEATURE_STM32F746G_DISCO").is_some() {
            println!("cargo:rustc-link-arg-bin=stm32f746g_disco=-Tdefmt.x");
        }
    }
    Ok(())
}

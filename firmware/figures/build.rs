//! Gives the linker the memory: of the boards that are emulated those with the most of it.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let is_arm = env::var("CARGO_CFG_TARGET_ARCH").is_ok_and(|arch| arch == "arm");
    let board = if is_arm { "mps2_an386" } else { "virt" };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    fs::copy(format!("../board/memory/{board}.x"), out.join("memory.x")).expect("the board's memory");
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rerun-if-changed=../board/memory");
}

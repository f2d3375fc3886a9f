//! Programs without std, started by the C library: `--cfg program="…"` names the one that is built. A name in `proofs` is a crate's, one
//! in `ends` that of an end; `none` is the program that the ends are compared with.
#![no_std]
#![no_main]

use no_std as _;

macro_rules! program {
    ($name:literal, $body:block) => {
        #[cfg(program = $name)]
        #[unsafe(no_mangle)]
        extern "C" fn main() -> i32 $body
    };
}

mod ends;
mod proofs;

//! Programs without std, started by the C library, or by the reset of a Cortex-M: `--cfg program="…"` names the one that is
//! built. A name in `proofs` is a crate's, one in `ends` that of an end; `none` is the program that the ends are compared with.
#![no_std]
#![no_main]

use no_std as _;

macro_rules! program {
    ($name:literal, $body:block) => {
        #[cfg(all(program = $name, not(target_os = "none")))]
        #[unsafe(no_mangle)]
        extern "C" fn main() -> i32 $body

        #[cfg(all(program = $name, target_os = "none"))]
        #[cortex_m_rt::entry]
        fn start() -> ! {
            fn main() -> i32 $body
            no_std::exit(main())
        }
    };
}

mod ends;
#[cfg(not(target_os = "none"))]
mod proofs;

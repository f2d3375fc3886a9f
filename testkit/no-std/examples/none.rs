//! Nothing: what the others are compared with.
#![no_std]
#![no_main]

use no_std as _;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    0
}

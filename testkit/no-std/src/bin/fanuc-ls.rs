//! A program through the reader and the writer. It holds texts, so it needs an allocator: the C library's, and no std.
#![no_std]
#![no_main]

use core::alloc::{GlobalAlloc, Layout};
use core::ffi::c_void;

use fanuc_ls::{Program, Rules};
use no_std as _;

struct Malloc;

unsafe extern "C" {
    fn aligned_alloc(align: usize, size: usize) -> *mut c_void;
    fn free(block: *mut c_void);
}

// SAFETY: `aligned_alloc` gives blocks of this size (rounded up to the alignment, as C wants it) and alignment, or null;
// `free` takes them back.
unsafe impl GlobalAlloc for Malloc {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let align = layout.align().max(size_of::<*mut c_void>());
        // SAFETY: the alignment is a power of two and the size a multiple of it.
        unsafe { aligned_alloc(align, layout.size().next_multiple_of(align)) }.cast()
    }

    unsafe fn dealloc(&self, block: *mut u8, _: Layout) {
        // SAFETY: the block is one of `alloc`'s.
        unsafe { free(block.cast()) }
    }
}

#[global_allocator]
static MALLOC: Malloc = Malloc;

/// The `alloc` that comes compiled with the toolchain names these two, although nothing unwinds here: they stand for the
/// unwinder, which only std brings.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

#[unsafe(no_mangle)]
extern "C" fn _Unwind_Resume() {}

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some(true))
}

fn run() -> Option<bool> {
    let text = "/PROG  A\r\n/MN\r\n   1:J P[1] 2% FINE    ;\r\n/POS\r\nP[1]{\r\n   GP1:\r\n\tUF : 0, UT : 1,\t\r\n\tJ1=      .500 deg\r\n};\r\n/END\r\n";
    Some(Program::decode(text).ok()?.to_text(&Rules::default()).ok()? == text)
}

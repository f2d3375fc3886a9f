//! What a decoder holds of its stream.
#![no_std]
#![no_main]

use core::hint::black_box;

use robot_session::StreamBuffer;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let mut buffer = StreamBuffer::<256>::new();
    let used = black_box(&mut buffer);
    black_box(used.push(black_box(&[])));
    black_box(used.bytes());
    black_box(used.take(1));
    used.clear();
    no_std::print_size(&buffer)
}

//! A queue of events.
#![no_std]
#![no_main]

use core::hint::black_box;

use robot_session::EventQueue;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let mut queue = EventQueue::<u64, 16>::new();
    let used = black_box(&mut queue);
    let _ = black_box(used.push_outcome(1));
    used.push_notice(2);
    black_box(used.has_room(1));
    black_box(used.pop());
    no_std::print_size(&queue)
}

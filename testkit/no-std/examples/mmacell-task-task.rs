//! The cell's task, without the sessions that carry its orders.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::time::Duration;

use mmacell_task::{Device, Event, Task, TaskConfig};

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let now = black_box(Duration::ZERO);
    let mut task = Task::new(TaskConfig::DEFAULT);
    task.handle_event(now, black_box(Event::Ready(Device::Robot)));
    task.handle_timeout(now);
    black_box(task.poll_output(now));
    black_box((task.poll_timeout(), task.step(), task.fault()));
    no_std::print_size(&task)
}

//! Jobs through both ends, one of them out of order, and a reset.
#![no_std]
#![no_main]

use no_std as _;
use robot_work_queue::WorkQueue;

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    i32::from(run() != Some([2, 1, 4]))
}

fn run() -> Option<[u32; 3]> {
    let mut queue: WorkQueue<u32, 3> = WorkQueue::new(9).ok()?;
    let (mut writer, mut reader) = queue.split();
    for number in 1..=3 {
        writer.claim().ok()?.commit(number, number.into()).ok()?;
    }
    let first = reader.take_where(|_, job| *job == 2)?.complete();
    let second = reader.take()?.complete();
    writer.clear();
    writer.claim().ok()?.commit(4, 4).ok()?;
    let third = reader.take()?.complete();
    (writer.is_settled() && reader.take().is_none()).then_some([first, second, third])
}

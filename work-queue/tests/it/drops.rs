//! Jobs that are never executed are dropped once, even if the drop panics.

use core::panic::AssertUnwindSafe;
use std::rc::Rc;

use robot_work_queue::{WorkQueue, boxed};

#[test]
fn remaining_jobs_are_dropped_once() {
    let count = Rc::new(());
    for reader_first in [true, false] {
        let (mut writer, mut reader) = boxed::<Rc<()>>(4, 9).unwrap();
        for _ in 0..4 {
            writer.claim().unwrap().push(count.clone());
        }
        drop(reader.take_where(|number, _| number == 2).unwrap().complete());
        let _ = reader.take().unwrap();
        assert_eq!(Rc::strong_count(&count), 4);
        if reader_first {
            drop(reader);
            assert!(writer.claim().is_err());
            drop(writer);
        } else {
            drop(writer);
            drop(reader);
        }
        assert_eq!(Rc::strong_count(&count), 1);
    }

    let mut queue: WorkQueue<Rc<()>, 2> = WorkQueue::new(9).unwrap();
    let (mut writer, _) = queue.split();
    writer.claim().unwrap().push(count.clone());
    writer.claim().unwrap().push(count.clone());
    assert_eq!(Rc::strong_count(&count), 3);
    let (mut writer, _) = queue.split();
    assert_eq!(Rc::strong_count(&count), 1, "another split drops the remaining jobs");
    assert_eq!(writer.claim().unwrap().push(count.clone()), 1);
    drop(queue);
    assert_eq!(Rc::strong_count(&count), 1);
}

/// A job that panics when it is dropped, if armed.
struct PanicsOnDrop {
    armed: bool,
    _count: Rc<()>,
}

impl Drop for PanicsOnDrop {
    fn drop(&mut self) {
        assert!(!self.armed, "a job that panics when dropped");
    }
}

#[test]
fn a_job_whose_drop_panics_in_a_reset_is_dropped_once_and_the_queue_stays_usable() {
    let count = Rc::new(());
    let (mut writer, mut reader) = boxed::<PanicsOnDrop>(3, 9).unwrap();
    for armed in [true, false, false] {
        writer.claim().unwrap().push(PanicsOnDrop { armed, _count: count.clone() });
    }
    writer.clear();
    let take = AssertUnwindSafe(|| reader.take().is_none());
    std::panic::catch_unwind(take).unwrap_err();
    assert_eq!((Rc::strong_count(&count), writer.free()), (3, 1));
    assert!(reader.take().is_none());
    assert_eq!((Rc::strong_count(&count), writer.free()), (1, 3));
}

#[test]
fn a_remaining_job_whose_drop_panics_is_dropped_once() {
    let count = Rc::new(());
    let mut queue: WorkQueue<PanicsOnDrop, 3> = WorkQueue::new(9).unwrap();
    let (mut writer, _) = queue.split();
    for armed in [false, true, false] {
        writer.claim().unwrap().push(PanicsOnDrop { armed, _count: count.clone() });
    }
    let split = AssertUnwindSafe(|| drop(queue.split()));
    std::panic::catch_unwind(split).unwrap_err();
    assert_eq!(Rc::strong_count(&count), 2);
    drop(queue);
    assert_eq!(Rc::strong_count(&count), 1);
}

#[test]
fn a_job_whose_drop_panics_in_a_batch_is_dropped_once_and_the_queue_stays_usable() {
    let count = Rc::new(());
    let mut queue: WorkQueue<PanicsOnDrop, 3> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    for armed in [true, false, false] {
        writer.claim().unwrap().push(PanicsOnDrop { armed, _count: count.clone() });
    }
    let complete = AssertUnwindSafe(|| reader.take_batch(2).unwrap().complete());
    std::panic::catch_unwind(complete).unwrap_err();
    assert_eq!((writer.free(), reader.len()), (2, 1));
    assert_eq!(Rc::strong_count(&count), 3, "the second is forgotten");
    assert_eq!(reader.take().unwrap().number(), 3);
    drop(queue);
    assert_eq!(Rc::strong_count(&count), 2);
}

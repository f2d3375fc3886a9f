//! Many jobs published or executed at once.

use core::panic::AssertUnwindSafe;
use std::rc::Rc;

use robot_work_queue::{Full, NumberError, WorkQueue, boxed};

#[test]
fn the_jobs_of_a_batch_are_published_at_once_under_their_numbers() {
    let mut queue: WorkQueue<u16, 5> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    assert!(writer.claim_batch(6).is_err());
    let mut batch = writer.claim_batch(3).unwrap();
    batch.claim().unwrap().commit(1, 1).unwrap();
    assert_eq!(batch.claim().unwrap().commit(1, 9), Err(NumberError::Repeated { number: 1 }));
    assert_eq!(format!("{batch:?}"), "Batch { next: 2, .. }");
    batch.fill([2, 3]);
    assert!(reader.take().is_none());
    assert_eq!(batch.publish(), 3);
    assert_eq!((writer.last_number(), writer.len(), reader.len()), (Some(3), 3, 3));
    let mut batch = writer.claim_batch(2).unwrap();
    batch.fill(4..100);
    assert_eq!((batch.claim().err(), batch.publish()), (Some(Full), 2), "as many as were claimed");

    let mut taken = reader.take_batch(2).unwrap();
    assert_eq!(taken.iter_mut().map(|(number, job)| (number, *job)).collect::<Vec<_>>(), [(1, 1), (2, 2)]);
    assert_eq!(writer.free(), 0);
    assert_eq!(format!("{taken:?}"), "TakenBatch { jobs: 2, .. }");
    taken.complete();
    assert_eq!((writer.free(), reader.take_batch(0).is_none()), (2, true));
    assert_eq!(reader.take_where(|number, _| number == 4).unwrap().complete(), 4);
    assert_eq!(reader.take_batch(9).unwrap().iter_mut().len(), 1, "the next one was completed");
    assert_eq!(
        reader.iter().map(|(number, _)| number).collect::<Vec<_>>(),
        [3, 5],
        "not completed: they wait"
    );
}

#[test]
fn a_batch_is_filled_with_no_more_jobs_than_slots_were_claimed() {
    let mut queue: WorkQueue<u16, 5> = WorkQueue::new(9).unwrap();
    let (mut writer, _) = queue.split();
    let mut batch = writer.claim_batch(3).unwrap();
    batch.fill([1]);
    batch.fill(2..100);
    batch.fill(4..100);
    assert_eq!((batch.claim().err(), batch.publish()), (Some(Full), 3));
}

#[test]
fn a_batch_is_taken_up_to_the_end_of_the_lap_on_every_lap() {
    let mut queue: WorkQueue<u16, 4> = WorkQueue::new(1000).unwrap();
    let (mut writer, mut reader) = queue.split();
    for _ in 0..3 {
        for jobs in [4, 1, 3] {
            let mut batch = writer.claim_batch(jobs).unwrap();
            batch.fill([7; 4]);
            batch.publish();
            let mut taken = reader.take_batch(4).unwrap();
            assert_eq!(taken.iter_mut().len(), jobs);
            taken.complete();
        }
    }
}

#[test]
fn a_batch_that_is_not_published_has_no_effect() {
    let count = Rc::new(());
    let mut queue: WorkQueue<Rc<()>, 3> = WorkQueue::new(4).unwrap();
    let (mut writer, mut reader) = queue.split();
    for _ in 0..5 {
        let mut batch = writer.claim_batch(2).unwrap();
        batch.fill([count.clone(), count.clone()]);
        drop(batch);
        assert_eq!((Rc::strong_count(&count), writer.next_number(), writer.free()), (1, 1, 3));
    }
    assert!(reader.take().is_none());
}

/// Wherever the lap and the numbers end: at the end of the batch, within it, or both.
#[test]
fn a_batch_is_filled_over_the_ends_of_laps_and_numbers() {
    for (capacity, max) in [(5, 6), (5, 7), (6, 13), (4, 9)] {
        let (mut writer, mut reader) = boxed::<u16>(capacity, max).unwrap();
        let (mut queued, mut executed) = (1.., 1..);
        for slots in (1..=capacity).cycle().take(200) {
            let mut batch = writer.claim_batch(slots).unwrap();
            batch.fill(queued.by_ref().take(slots / 2));
            batch.fill(queued.by_ref().take(slots - slots / 2));
            assert_eq!((batch.claim().err(), batch.publish(), writer.len()), (Some(Full), slots, slots));
            while let Some(mut batch) = reader.take_batch(slots) {
                for (number, job) in batch.iter_mut() {
                    assert_eq!(Some(*job), executed.next());
                    assert_eq!(number, (*job - 1) % max + 1);
                }
                batch.complete();
            }
            assert!(writer.is_empty());
        }
    }
}

#[test]
fn what_was_filled_before_a_job_panics_is_dropped_with_the_batch() {
    let count = Rc::new(());
    let (mut writer, mut reader) = boxed::<Rc<()>>(5, 9).unwrap();
    for start in 0..5 {
        let jobs = (0..4).map(|job| if job == 3 { panic!("while it decodes") } else { count.clone() });
        let mut batch = writer.claim_batch(4).unwrap();
        let fill = AssertUnwindSafe(|| batch.fill(jobs));
        std::panic::catch_unwind(fill).unwrap_err();
        assert_eq!(Rc::strong_count(&count), 4);
        drop(batch);
        assert_eq!((Rc::strong_count(&count), writer.free(), writer.next_number()), (1, 5, start + 1));
        writer.claim().unwrap().push(count.clone());
        reader.take().unwrap().complete();
    }
}

#[test]
fn a_batch_filled_to_the_end_of_the_lap_by_an_iterator_that_panics_then_is_whole() {
    struct PanicsAtLast(core::ops::Range<u16>);
    impl Iterator for PanicsAtLast {
        type Item = u16;
        fn next(&mut self) -> Option<u16> {
            self.0.next()
        }
    }
    impl Drop for PanicsAtLast {
        fn drop(&mut self) {
            panic!("when it is dropped");
        }
    }
    let mut queue: WorkQueue<u16, 2> = WorkQueue::new(3).unwrap();
    let (mut writer, mut reader) = queue.split_at_lap(u16::MAX);
    for first in [1, 3] {
        let mut batch = writer.claim_batch(2).unwrap();
        let fill = AssertUnwindSafe(|| batch.fill(PanicsAtLast(first..first + 2)));
        std::panic::catch_unwind(fill).unwrap_err();
        assert_eq!((batch.claim().err(), batch.publish()), (Some(Full), 2));
        for job in first..first + 2 {
            let taken = reader.take().unwrap();
            assert_eq!((taken.number(), taken.complete()), ((job - 1) % 3 + 1, job));
        }
    }
}

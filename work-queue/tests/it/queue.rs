//! One test for each promise of the documentation.

use core::cell::Cell;
use core::panic::AssertUnwindSafe;
use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::rc::Rc;

use robot_work_queue::{ConfigError, Full, NoWake, NumberError, Reader, WorkQueue, Writer, boxed};

/// Fills the queue with `count` jobs, each being its own number.
fn fill(writer: &mut Writer<'_, u16>, count: usize) {
    for _ in 0..count {
        let claim = writer.claim().unwrap();
        let number = claim.number();
        claim.commit(number, number).unwrap();
    }
}

fn execute(reader: &mut Reader<'_, u16>) -> Option<u16> {
    let job = reader.take()?;
    assert_eq!(job.number(), *job);
    Some(job.complete())
}

#[test]
fn capacity_and_highest_number_are_checked() {
    assert_eq!(WorkQueue::<u8, 0>::new(5).err(), Some(ConfigError::Capacity { capacity: 0 }));
    assert_eq!(boxed::<u8>(10_000, 20_000).err(), Some(ConfigError::Capacity { capacity: 10_000 }));
    assert_eq!(WorkQueue::<u8, 7>::new(7).err(), Some(ConfigError::MaxNumber { max_number: 7, capacity: 7 }));
    assert!(WorkQueue::<u8, 7>::new(8).is_ok());
    assert!(boxed::<u8>(9999, 10_000).is_ok());
    assert!(boxed::<u8>(1, u16::MAX).is_ok());
    assert_eq!(
        ConfigError::Capacity { capacity: 10_000 }.to_string(),
        "a capacity of 10000 jobs is outside 1 to 9999"
    );
    assert_eq!(
        ConfigError::MaxNumber { max_number: 7, capacity: 7 }.to_string(),
        "the highest job number 7 is not above the capacity of 7 jobs"
    );
}

#[test]
fn capacities_that_are_no_power_of_two() {
    for capacity in [1, 2, 3, 5, 7, 10, 100, 9999] {
        let (mut writer, mut reader) = boxed::<u16>(capacity, 10_000).unwrap();
        for _ in 0..3 {
            fill(&mut writer, capacity);
            assert_eq!(writer.claim().err(), Some(Full));
            assert_eq!((writer.free(), reader.len()), (0, capacity));
            for _ in 0..capacity {
                execute(&mut reader).unwrap();
            }
            assert_eq!((writer.free(), reader.len()), (capacity, 0));
        }
    }
}

#[test]
fn the_ring_of_ten_in_the_source_s_figure() {
    let mut queue: WorkQueue<u16, 10> = WorkQueue::new(1000).unwrap();
    let (mut writer, mut reader) = queue.split();
    let numbers = |reader: &Reader<'_, u16>| reader.iter().map(|(number, _)| number).collect::<Vec<_>>();
    fill(&mut writer, 6);
    assert_eq!(execute(&mut reader), Some(1));
    fill(&mut writer, 3);
    assert_eq!(numbers(&reader), [2, 3, 4, 5, 6, 7, 8, 9]);
    for _ in 2..=4 {
        execute(&mut reader).unwrap();
    }
    fill(&mut writer, 1);
    assert_eq!(numbers(&reader), [5, 6, 7, 8, 9, 10]);
    fill(&mut writer, 4);
    assert_eq!(numbers(&reader), [5, 6, 7, 8, 9, 10, 11, 12, 13, 14]);
    assert!(writer.is_full());
}

#[test]
fn numbers_wrap_to_one_and_repeats_are_recognised_across_the_wrap() {
    let mut queue: WorkQueue<u16, 2> = WorkQueue::new(3).unwrap();
    let (mut writer, mut reader) = queue.split();
    assert_eq!((writer.last_number(), writer.next_number()), (None, 1));
    assert_eq!(
        writer.claim().unwrap().commit(0, 0),
        Err(NumberError::Unexpected { expected: 1, found: 0 }),
        "0 is never a number, not even before the first"
    );
    let mut last = None;
    for number in [1, 2, 3, 1, 2, 3, 1] {
        assert_eq!((writer.last_number(), writer.next_number()), (last, number));
        writer.claim().unwrap().commit(number, number).unwrap();
        assert_eq!(writer.claim().unwrap().commit(number, number), Err(NumberError::Repeated { number }));
        let expected = writer.next_number();
        for found in (0..=5).filter(|n| ![number, expected].contains(n)) {
            assert_eq!(
                writer.claim().unwrap().commit(found, found),
                Err(NumberError::Unexpected { expected, found })
            );
        }
        assert_eq!(execute(&mut reader), Some(number));
        last = Some(number);
    }
    assert_eq!(NumberError::Repeated { number: 3 }.to_string(), "job 3 is already queued");
    assert_eq!(NumberError::Unexpected { expected: 2, found: 9 }.to_string(), "expected job 2, found job 9");
}

#[test]
fn full_is_reported_before_a_wrong_number_and_before_anything_is_decoded() {
    let mut queue: WorkQueue<u16, 1> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    fill(&mut writer, 1);
    assert_eq!(writer.claim().err(), Some(Full));
    assert_eq!(Full.to_string(), "the work queue is full");
    assert_eq!(execute(&mut reader), Some(1));
    let claim = writer.claim().unwrap();
    assert_eq!(
        claim.commit_with(7, || panic!("not decoded: the number is wrong")),
        Err(NumberError::Unexpected { expected: 2, found: 7 })
    );
}

#[test]
fn a_claim_without_commit_has_no_effect() {
    let mut queue: WorkQueue<u16, 2> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    for _ in 0..10 {
        drop(writer.claim().unwrap());
    }
    assert!(reader.take().is_none());
    assert_eq!((writer.free(), writer.last_number()), (2, None));
    assert_eq!(writer.claim().unwrap().push(5), 1);
    assert_eq!(reader.take().unwrap().number(), 1);
}

#[test]
fn a_decoder_that_panics_has_no_effect() {
    let (mut writer, mut reader) = boxed::<u16>(1, 2).unwrap();
    let decode = || writer.claim().unwrap().push_with(|| panic!("while it decodes"));
    std::panic::catch_unwind(AssertUnwindSafe(decode)).unwrap_err();
    assert!(reader.take().is_none());
    fill(&mut writer, 1);
    assert_eq!(execute(&mut reader), Some(1));
}

#[test]
fn only_completing_a_job_frees_its_slot() {
    let mut queue: WorkQueue<u16, 1> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    fill(&mut writer, 1);
    for _ in 0..3 {
        let job = reader.take().unwrap();
        assert_eq!((job.number(), *job), (1, 1));
        assert!(writer.is_full());
    }
    reader.take().unwrap().complete();
    assert_eq!(writer.free(), 1);
}

#[test]
fn a_later_job_overtakes_and_its_slot_follows_those_before_it() {
    let mut queue: WorkQueue<u16, 4> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    fill(&mut writer, 4);
    assert_eq!(reader.take_where(|_, &job| job == 3).unwrap().complete(), 3);
    assert_eq!(reader.take_where(|number, _| number == 2).unwrap().complete(), 2);
    assert!(reader.take_where(|number, _| number == 2).is_none(), "executed once");
    assert_eq!((writer.free(), reader.len()), (0, 2));
    assert_eq!(reader.iter().collect::<Vec<_>>(), [(1, &1), (4, &4)]);
    assert_eq!(execute(&mut reader), Some(1));
    assert_eq!((writer.free(), reader.len()), (3, 1));
    fill(&mut writer, 3);
    assert_eq!((&reader).into_iter().map(|(number, _)| number).collect::<Vec<_>>(), [4, 5, 6, 7]);
    assert_eq!(reader.take_where(|number, _| number == 7).unwrap().complete(), 7);
    for number in [4, 5, 6] {
        assert_eq!(execute(&mut reader), Some(number));
    }
    assert_eq!(writer.free(), 4);
}

#[test]
fn the_low_water_mark_counts_the_jobs_that_are_left() {
    let mut queue: WorkQueue<u16, 5> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    assert!(writer.drained(0));
    fill(&mut writer, 5);
    assert_eq!([0, 2, 4, 5].map(|mark| writer.drained(mark)), [false, false, false, true]);
    for _ in 0..3 {
        execute(&mut reader).unwrap();
    }
    assert_eq!([0, 1, 2, 3].map(|mark| writer.drained(mark)), [false, false, true, true]);
    let job = reader.take().unwrap();
    assert!(!writer.drained(1), "a job in execution is still in the queue");
    job.complete();
    assert!(writer.drained(1));
}

#[test]
fn clear_discards_the_queued_jobs_and_keeps_later_ones() {
    let mut queue: WorkQueue<u16, 4> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    assert!(writer.is_settled());
    fill(&mut writer, 3);
    writer.clear();
    assert!(!writer.is_settled());
    fill(&mut writer, 1);
    assert_eq!(reader.iter().map(|(number, _)| number).collect::<Vec<_>>(), [4], "the numbering continues");
    assert_eq!(execute(&mut reader), Some(4));
    assert!(writer.is_settled());
    assert_eq!((writer.free(), writer.last_number(), writer.next_number()), (4, Some(4), 5));
}

#[test]
fn a_job_in_execution_is_not_discarded() {
    let mut queue: WorkQueue<u16, 4> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    fill(&mut writer, 3);
    let job = reader.take().unwrap();
    writer.reset();
    assert_eq!((writer.last_number(), writer.next_number()), (None, 1));
    assert_eq!(*job, 1);
    assert!(!writer.is_settled());
    assert_eq!(job.complete(), 1);
    assert!(!writer.is_settled(), "2 and 3 are still there");
    assert!(reader.take().is_none());
    assert!(writer.is_settled());
    fill(&mut writer, 4);
    assert_eq!(reader.len(), 4);
    assert_eq!(execute(&mut reader), Some(1));
}

#[test]
fn a_job_executed_out_of_order_is_not_discarded_either() {
    let mut queue: WorkQueue<u16, 3> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    fill(&mut writer, 2);
    let job = reader.take_where(|number, _| number == 2).unwrap();
    writer.clear();
    fill(&mut writer, 1);
    assert_eq!(job.complete(), 2);
    assert_eq!(reader.take_where(|number, _| number == 3).unwrap().complete(), 3);
    assert_eq!(writer.free(), 3);
    assert!(writer.is_settled());
}

#[test]
fn a_stale_reset_discards_nothing_after_many_laps() {
    let mut queue: WorkQueue<u16, 1> = WorkQueue::new(2).unwrap();
    let (mut writer, mut reader) = queue.split();
    writer.clear();
    for _ in 0..200_000 {
        fill(&mut writer, 1);
        assert!(execute(&mut reader).is_some());
        assert!(writer.is_settled());
    }
}

#[test]
fn each_end_detects_that_the_other_is_gone() {
    let (mut writer, mut reader) = boxed::<u16>(2, 9).unwrap();
    assert!(!writer.is_abandoned() && !reader.is_abandoned());
    fill(&mut writer, 2);
    drop(writer);
    assert!(reader.is_abandoned());
    assert_eq!([execute(&mut reader), execute(&mut reader), execute(&mut reader)], [Some(1), Some(2), None]);

    let mut queue: WorkQueue<u16, 2> = WorkQueue::new(9).unwrap();
    let (writer, reader) = queue.split();
    drop(reader);
    assert!(writer.is_abandoned());
    drop(writer);
    let (writer, reader) = queue.split();
    assert!(!writer.is_abandoned() && !reader.is_abandoned());
}

#[test]
fn payloads_of_every_size_and_alignment() {
    fn pass<T: Copy + PartialEq + core::fmt::Debug>(job: T) {
        let (mut writer, mut reader) = boxed::<T>(3, 9).unwrap();
        for _ in 0..7 {
            writer.claim().unwrap().push(job);
            assert_eq!(*reader.take().unwrap(), job);
            assert_eq!(reader.take().unwrap().complete(), job);
        }
        let mut queue: WorkQueue<T, 3> = WorkQueue::new(9).unwrap();
        let (mut writer, mut reader) = queue.split();
        writer.claim().unwrap().push(job);
        let job_ref: *const T = &raw const *reader.take().unwrap();
        assert!(job_ref.is_aligned());
    }
    #[derive(Clone, Copy, PartialEq, Debug)]
    #[repr(align(256))]
    struct Wide(u8);
    pass(());
    pass(7u8);
    pass([1u8; 3]);
    pass(u128::MAX);
    pass([3u64; 7]);
    pass([4u64; 100]);
    pass(Wide(9));
}

#[test]
fn slots_hold_the_jobs_and_nothing_else() {
    let (mut writer, reader) = boxed::<[u64; 7]>(2, 9).unwrap();
    writer.claim().unwrap().push([1; 7]);
    writer.claim().unwrap().push([2; 7]);
    let addresses: Vec<usize> = reader.iter().map(|(_, job)| job.as_ptr().addr()).collect();
    assert_eq!(addresses[1] - addresses[0], 56);
}

#[test]
fn a_job_can_be_changed_while_it_is_executed() {
    let mut queue: WorkQueue<u16, 2> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    fill(&mut writer, 1);
    *reader.take().unwrap() += 10;
    assert_eq!(reader.take().unwrap().complete(), 11, "it waited as it was left");
}

/// The mark has half of a position: resets that are 2^16 jobs apart, or nearly, are not mistaken for one another.
#[test]
fn resets_far_apart_are_told_apart() {
    let (mut writer, mut reader) = boxed::<u32>(5, u16::MAX).unwrap();
    for apart in (1 << 16) - 8..(1 << 16) + 8u32 {
        writer.reset();
        for serial in 0..apart {
            let number = u16::try_from(serial % u32::from(u16::MAX)).unwrap() + 1;
            assert_eq!(writer.claim().unwrap().push(serial), number);
            let job = reader.take().unwrap();
            assert_eq!((*job, job.number()), (serial, number));
            job.complete();
        }
        writer.claim().unwrap().push(u32::MAX);
        writer.reset();
        assert!(!writer.is_settled());
        assert!(reader.take().is_none() && writer.is_settled());
    }
}

/// A mark is renewed before half of a position no longer shows its age, however late the reader is.
#[test]
fn a_reset_of_long_ago_stays_settled() {
    for capacity in [1, 2, 9999] {
        let (mut writer, mut reader) = boxed::<u32>(capacity, u16::MAX).unwrap();
        let (mut queued, mut executed) = (0.., 0..);
        let number = |serial: u32| u16::try_from(serial % u32::from(u16::MAX)).unwrap() + 1;
        for round in 0..200_000 {
            if round % 2 == 0 {
                let mut batch = writer.claim_batch(1).unwrap();
                batch.fill(queued.by_ref().take(1));
                assert_eq!(batch.publish(), 1);
            } else {
                let serial = queued.next().unwrap();
                assert_eq!(writer.claim().unwrap().push(serial), number(serial));
            }
            if writer.is_full() {
                let (job, serial) = (reader.take().unwrap(), executed.next().unwrap());
                assert_eq!((job.number(), job.complete()), (number(serial), serial));
            }
            assert!(writer.is_settled(), "capacity {capacity}, round {round}");
        }
        writer.clear();
        assert_eq!(writer.is_settled(), capacity == 1, "all but one are queued");
        assert!(reader.take().is_none() && writer.is_settled());
    }
}

static QUEUE: WorkQueue<Counted, 3> = WorkQueue::numbered::<9>();

static DROPPED: AtomicUsize = AtomicUsize::new(0);

struct Counted;

impl Drop for Counted {
    fn drop(&mut self) {
        DROPPED.fetch_add(1, Relaxed);
    }
}

#[test]
fn a_queue_that_becomes_static_drops_its_jobs() {
    let count = Rc::new(());
    let queue: &'static mut WorkQueue<Rc<()>, 2> = Box::leak(Box::new(WorkQueue::numbered::<9>()));
    queue.split().0.claim().unwrap().push(count.clone());
    let shared: &'static WorkQueue<Rc<()>, 2> = queue;
    let (writer, mut reader) = shared.split_static(NoWake, NoWake).unwrap();
    assert_eq!((Rc::strong_count(&count), writer.free()), (1, 2));
    assert!(reader.take().is_none());
}

#[test]
fn a_queue_in_a_static_has_one_pair_of_ends_at_a_time() {
    let (mut writer, reader) = QUEUE.split_static(NoWake, NoWake).unwrap();
    assert!(QUEUE.split_static(NoWake, NoWake).is_none());
    writer.claim().unwrap().push(Counted);
    drop(reader);
    assert!(QUEUE.split_static(NoWake, NoWake).is_none());
    drop(writer);
    assert_eq!(DROPPED.load(Relaxed), 1, "the last end drops what is left");
    let (mut writer, reader) = QUEUE.split_static(NoWake, NoWake).unwrap();
    assert_eq!((writer.claim().unwrap().push(Counted), reader.len()), (1, 1));
}

#[test]
fn an_end_that_is_forgotten_leaves_its_jobs_to_the_queue() {
    let count = Rc::new(());
    let mut queue: WorkQueue<Rc<()>, 3> = WorkQueue::new(9).unwrap();
    let (mut writer, reader) = queue.split();
    writer.claim().unwrap().push(count.clone());
    core::mem::forget((writer, reader));
    let queue = Box::new(queue); // it has moved
    assert_eq!(Rc::strong_count(&count), 2);
    drop(queue);
    assert_eq!(Rc::strong_count(&count), 1);
}

#[test]
fn ends_that_sleep_are_woken() {
    let (reader_woken, writer_woken) = (Cell::new(0), Cell::new(0));
    let mut queue: WorkQueue<u8, 8> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue
        .split_with(|| reader_woken.set(reader_woken.get() + 1), || writer_woken.set(writer_woken.get() + 1));
    let woken = || (reader_woken.get(), writer_woken.get());
    writer.claim().unwrap().push(1);
    assert_eq!(woken(), (1, 0), "by a job");
    let mut batch = writer.claim_batch(4).unwrap();
    batch.fill([2, 3, 4, 5]);
    assert_eq!(woken(), (1, 0));
    batch.publish();
    assert_eq!(woken(), (2, 0), "by a batch");
    reader.take().unwrap().complete();
    reader.take_batch(2).unwrap().complete();
    assert_eq!(woken(), (2, 2), "by free slots");
    writer.clear();
    assert_eq!(woken(), (3, 2), "by a reset");
    assert!(reader.take().is_none());
    assert_eq!(woken(), (3, 4), "by each discarded job");
    drop(writer);
    drop(reader);
    assert_eq!(woken(), (4, 5), "by the other end's leaving");
}

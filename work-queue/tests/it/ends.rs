//! The getters and `Debug` output of the two ends, where jobs lie, and a queue that starts on another lap.

use core::cell::Cell;

use robot_work_queue::{Reader, WorkQueue, Writer, boxed};

#[test]
fn both_ends_know_the_sizes_and_print_without_their_jobs() {
    let mut queue: WorkQueue<u16, 3> = WorkQueue::new(9).unwrap();
    assert_eq!(format!("{queue:?}"), "WorkQueue { capacity: 3, max_number: 9, .. }");
    let (mut writer, mut reader) = queue.split();
    assert_eq!((writer.capacity(), reader.capacity(), writer.max_number()), (3, 3, 9));
    assert!(reader.is_empty() && !writer.is_full());
    let claim = writer.claim().unwrap();
    assert_eq!(format!("{claim:?}"), "Claim { number: 1 }");
    assert_eq!(claim.push(700), 1);
    assert!(!reader.is_empty() && !writer.is_empty());
    assert_eq!(format!("{:?}", reader.iter()), "Iter { .. }");
    assert!(format!("{writer:?}").starts_with("Writer { cursor: Cursor { at: 1, "), "{writer:?}");
    assert!(
        format!("{reader:?}").starts_with("Reader { front: Front { cursor: Cursor { at: 0, "),
        "{reader:?}"
    );
    let job = reader.take().unwrap();
    assert_eq!(format!("{job:?}"), "Taken { number: 1, job: 700 }");
    assert_eq!(job.complete(), 700);
    assert!(reader.is_empty());
}

#[test]
fn each_end_is_woken_by_what_the_other_has_done() {
    let (to_reader, to_writer) = (Cell::new(0), Cell::new(0));
    let mut queue: WorkQueue<u16, 4> = WorkQueue::new(9).unwrap();
    let count = |wakes: &Cell<u32>| wakes.set(wakes.get() + 1);
    let (mut writer, mut reader) = queue.split_with(|| count(&to_reader), || count(&to_writer));
    let mut expected = (0, 0);
    let mut woken = |reader, writer| {
        expected = (expected.0 + reader, expected.1 + writer);
        assert_eq!((to_reader.get(), to_writer.get()), expected);
    };
    writer.claim().unwrap().push(1);
    woken(1, 0);
    let mut batch = writer.claim_batch(3).unwrap();
    batch.fill([2, 3, 4]);
    assert_eq!(batch.publish(), 3);
    woken(1, 0);
    assert_eq!(writer.claim_batch(0).unwrap().publish(), 0);
    woken(0, 0);
    drop(reader.take().unwrap());
    woken(0, 0);
    // The job's slot is free when those before it are: it is completed all the same.
    reader.take_where(|number, _| number == 3).unwrap().complete();
    woken(0, 1);
    reader.take().unwrap().complete();
    woken(0, 1);
    reader.take_batch(1).unwrap().complete();
    woken(0, 1);
    writer.clear();
    woken(1, 0);
    assert!(reader.take().is_none() && writer.is_settled());
    woken(0, 1);
    drop(writer);
    woken(1, 0);
    drop(reader);
    woken(0, 1);
}

#[test]
fn a_reset_passes_over_a_job_that_was_executed_out_of_turn() {
    let mut queue: WorkQueue<u16, 4> = WorkQueue::new(9).unwrap();
    let (mut writer, mut reader) = queue.split();
    for job in 1..=4 {
        writer.claim().unwrap().push(job);
    }
    assert_eq!(reader.take_where(|number, _| number == 2).unwrap().complete(), 2);
    assert!(format!("{reader:?}").contains("ahead: 1"), "{reader:?}");
    writer.reset();
    assert!(reader.take().is_none());
    assert_eq!((writer.free(), writer.is_settled(), reader.is_empty()), (4, true, true));
    assert!(format!("{reader:?}").contains("ahead: 0"), "{reader:?}");
    for job in 5..=8 {
        writer.claim().unwrap().push(job);
    }
    assert!(writer.is_full());
    assert_eq!(reader.iter().collect::<Vec<_>>(), [(1, &5), (2, &6), (3, &7), (4, &8)]);
}

#[test]
fn a_queue_may_start_on_any_lap_and_wraps_around_them() {
    let mut queue: WorkQueue<u16, 3> = WorkQueue::new(9).unwrap();
    for lap in [0, 1, u16::MAX] {
        let (mut writer, mut reader) = queue.split_at_lap(lap);
        for job in 0..20 {
            writer.claim().unwrap().push(job);
            if job == 10 {
                writer.clear();
                assert!(reader.take().is_none() && writer.is_settled());
            } else {
                assert_eq!(reader.take().unwrap().complete(), job);
            }
            let at = (u32::from(lap) * 3 + u32::from(job) + 1) % (3 << 16);
            assert!(format!("{writer:?}").starts_with(&format!("Writer {{ cursor: Cursor {{ at: {at}, ")));
        }
        assert_eq!((writer.free(), writer.next_number()), (3, 3));
    }
}

#[test]
fn a_queue_that_was_moved_to_another_thread_is_split_there() {
    let mut queue: WorkQueue<String, 3> = WorkQueue::new(9).unwrap();
    let (mut writer, _) = queue.split();
    writer.claim().unwrap().push("left behind".into());
    let last = std::thread::spawn(move || {
        let (mut writer, mut reader) = queue.split();
        assert!(reader.is_empty());
        writer.claim().unwrap().push("there".into());
        reader.take().unwrap().complete()
    });
    assert_eq!(last.join().unwrap(), "there");
}

#[test]
fn a_job_of_a_power_of_two_lies_in_one_cache_line() {
    fn assert_in_lines<T: Copy + Default>(mut writer: Writer<'_, T>, mut reader: Reader<'_, T>) {
        while let Ok(claim) = writer.claim() {
            claim.push(T::default());
        }
        let line = (if cfg!(target_pointer_width = "64") { 64 } else { 32 }).min(size_of::<T>());
        while let Some(job) = reader.take() {
            assert_eq!(core::ptr::from_ref(&*job).addr() % line, 0);
            job.complete();
        }
    }
    fn assert_sizes<T: Copy + Default>() {
        for capacity in [1, 3, 100] {
            let (writer, reader) = boxed::<T>(capacity, 1000).unwrap();
            assert_in_lines(writer, reader);
        }
        let mut queue = WorkQueue::<T, 3>::new(1000).unwrap();
        let (writer, reader) = queue.split();
        assert_in_lines(writer, reader);
    }
    assert_sizes::<[u8; 16]>();
    assert_sizes::<[u64; 4]>();
    // An array longer than a cache line is in several lines.
    if cfg!(target_pointer_width = "64") {
        assert_sizes::<[u64; 8]>();
        assert_sizes::<[u64; 16]>();
    }
}

//! An end leaves, sleeps, or is held while the other continues.

use super::*;

/// The writer leaves: the reader finds everything that was queued before, and then knows that nothing will come.
#[test]
fn writer_leaves_then_drain() {
    model_of(2, |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || assert_eq!(execute_all(&mut reader), [1, 2]));
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        drop(writer);
        reader.join().unwrap();
    });
}

/// The same with inline storage, whose ends free nothing.
#[test]
fn writer_leaves_then_drain_inline() {
    model(|| {
        let queue = Box::leak(Box::new(WorkQueue::<u16, 2>::new(9).unwrap()));
        let (mut writer, mut reader) = queue.split();
        let reader = thread::spawn(move || {
            while !reader.is_abandoned() {
                thread::yield_now();
            }
            assert_eq!(reader.take().unwrap().complete(), 1);
            assert_eq!(reader.take().unwrap().complete(), 2);
            assert!(reader.take().is_none());
        });
        writer.claim().unwrap().push(1);
        writer.claim().unwrap().push(2);
        drop(writer);
        reader.join().unwrap();
    });
}

/// The reader leaves: the writer sees it, and all that the reader did.
#[test]
fn reader_leaves() {
    model_of(2, |jobs, mut writer, mut reader| {
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        let world = World::new();
        let robot = world.clone();
        let reader = thread::spawn(move || {
            execute(&mut reader);
            robot.act(1);
        });
        while !writer.is_abandoned() {
            thread::yield_now();
        }
        assert_eq!((world.look(), writer.free()), (vec![1], 1));
        drop(writer);
        reader.join().unwrap();
    });
}

/// Both leave at once: the second one drops the remaining jobs, and sees all of them.
#[test]
fn both_leave() {
    model_of(3, |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || {
            if let Some(job) = reader.take_where(|number, _| number == 2) {
                job.complete();
            }
            let _ = reader.take();
        });
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        drop(writer);
        reader.join().unwrap();
    });
}

/// A queue in a static: one pair of ends at a time, and the second pair starts empty.
#[test]
fn a_static_queue_is_split_again() {
    model(|| {
        let queue: &'static _ = Box::leak(Box::new(WorkQueue::<u16, 2>::numbered::<9>()));
        let (mut writer, mut reader) = queue.split_static(NoWake, NoWake).unwrap();
        let reader = thread::spawn(move || {
            assert!(reader.take().is_none_or(|job| job.complete() == 1));
        });
        assert_eq!(writer.claim().unwrap().push(1), 1);
        drop(writer);
        let (mut writer, mut again) = loop {
            match queue.split_static(NoWake, NoWake) {
                Some(ends) => break ends,
                None => thread::yield_now(),
            }
        };
        assert_eq!([7, 8].map(|job| writer.claim().unwrap().push(job)), [1, 2]);
        assert_eq!([(); 2].map(|()| again.take().unwrap().complete()), [7, 8]);
        reader.join().unwrap();
    });
}

/// A reader that sleeps until it is woken executes everything.
#[test]
fn a_sleeping_reader_misses_nothing() {
    model(|| {
        let jobs = Arc::new(Counter::default());
        let event = Arc::new(Notify::new());
        let wake = event.clone();
        let (mut writer, mut reader) = boxed_with::<Job, _, _>(2, 9, move || wake.notify(), NoWake).unwrap();
        let reader = thread::spawn(move || {
            let mut numbers = Vec::new();
            loop {
                let last_look = reader.is_abandoned();
                match execute(&mut reader) {
                    Some(number) => numbers.push(number),
                    None if last_look => return numbers,
                    None => event.wait(),
                }
            }
        });
        queue_next(&mut writer, &jobs);
        queue_next(&mut writer, &jobs);
        drop(writer);
        assert_eq!(reader.join().unwrap(), [1, 2]);
        jobs.assert_each_dropped_once();
    });
}

/// A job stays in its slot as long as its guard lives, whatever the writer does.
#[test]
fn held_while_the_writer_goes_on() {
    model_of(2, |jobs, mut writer, mut reader| {
        queue_next(&mut writer, jobs);
        let reader = thread::spawn(move || {
            if let Some(job) = reader.take() {
                thread::yield_now();
                assert_eq!((job.value, job.copy), (1, 1));
            } // not completed: it waits again, unless a reset discards it
            execute_all(&mut reader)
        });
        queue_next(&mut writer, jobs);
        assert!(writer.claim().is_err() || writer.free() > 0);
        writer.clear();
        drop(writer);
        let numbers = reader.join().unwrap();
        assert!([&[][..], &[1], &[1, 2]].contains(&&*numbers), "{numbers:?}");
    });
}
